"""A real YARP on the loopback: name server, ports, programs that write and read them."""

import os
import pathlib
import random
import re
import subprocess
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "bridge"))
from stage import free_port, until  # noqa: E402


class Yarp:
    def __init__(self, stage, programs):
        self.stage, self.programs = stage, pathlib.Path(programs)
        self.port = free_port()
        folders = {name: stage.scratch / name.lower() for name in ("YARP_CONFIG_HOME", "YARP_DATA_HOME")}
        for folder in folders.values():
            folder.mkdir(parents=True, exist_ok=True)
        os.environ.update({"YARP_IP": "127.0.0.1", **{name: str(folder) for name, folder in folders.items()}})
        self.run("conf", "127.0.0.1", self.port)
        self.serve()

    def serve(self):
        command = [self.programs / "yarpserver", "--read", "--ip", "127.0.0.1", "--socket", self.port]
        self.server = self.stage.start("yarpserver", *command)
        until("the name server answers", lambda: "/root" in self.run("name", "list"))

    def run(self, *words, text=None):
        command = [str(self.programs / "yarp"), *map(str, words)]
        return subprocess.run(command, input=text, capture_output=True, text=True, timeout=30, check=False).stdout

    def names(self):
        return set(re.findall(r"registration name (\S+)", self.run("name", "list")))

    def read(self, name, source):
        """A process that reads a port, and the file that it writes to. What fails on a busy machine is tried again."""
        reader = self.stage.start("yarp-read", self.programs / "yarp", "read", name)
        until(f"{name} reads {source}", lambda: name in self.names() and "Success" in self.run("connect", source, name))
        return reader

    def write(self, name):
        """A process that sends each line of its input from a port."""
        command = [str(self.programs / "yarp"), "write", name]
        log = open(self.stage.scratch / f"write{name.replace('/', '-')}.log", "w")
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=log, stderr=log, text=True, bufsize=1)
        self.stage.processes.append(process)
        until(f"{name} is registered", lambda: name in self.names())
        return process


def messages(reader):
    """The lines of data that a reader has printed."""
    lines = reader.log.read_text().splitlines()
    return [line for line in lines if not line.startswith("[")]


class Robot:
    """A robot's software and a skin in a bag: what its boards scan every 60 ms, on a port every 20 ms; the bag's pressure beside it.

    `bag_kpa` loads all taxels, `loads` those of a triangle, in kPa.
    """

    def __init__(self, yarp, bag="{:.4f}"):
        self.yarp, self.bag_format = yarp, bag
        self.frozen, self.odd = set(), None
        self.bag_kpa, self.rise_kpa_per_s, self.loads = 0.0, 0.0, {}
        shape = random.Random(2)
        self.swings = [shape.uniform(90, 130) for _ in range(384)]
        self.values = [240] * 384
        self.alive = threading.Event()
        self.start()

    def start(self):
        self.skin, self.bag = self.yarp.write("/icub/skin/left_forearm"), self.yarp.write("/bag/pressure:o")
        self.alive.set()
        self.thread = threading.Thread(target=self.play, daemon=True)
        self.thread.start()

    def end(self):
        self.alive.clear()
        self.thread.join()
        for process in (self.skin, self.bag):
            process.stdin.close()
            process.wait(30)

    def play(self):
        noise, due, number = random.Random(1), time.monotonic(), 0
        while self.alive.is_set():
            self.bag_kpa = max(0.0, min(72.0, self.bag_kpa + 0.02 * self.rise_kpa_per_s))
            if number % 3 == 0:
                for triangle in set(range(32)) - self.frozen:
                    kpa = self.bag_kpa + self.loads.get(triangle, 0.0)
                    for k in range(12):
                        row, loaded = 12 * triangle + k, 0.0 if k in (6, 10) else kpa  # two are thermal pads
                        self.values[row] = round(239 - self.swings[row] * loaded / (loaded + 40) + noise.uniform(-1.4, 1.4))
            line = self.odd or " ".join(f"{count}.0" for count in self.values)
            self.skin.stdin.write(line + "\n")
            self.bag.stdin.write(self.bag_format.format(self.bag_kpa + noise.gauss(0.1, 0.01)) + "\n")
            # After a stall of the machine it goes on from there: a burst would be a pressure that jumps.
            number, due = number + 1, max(due + 0.02, time.monotonic())
            time.sleep(max(0.0, due - time.monotonic()))
