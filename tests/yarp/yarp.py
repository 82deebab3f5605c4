"""A real YARP on the loopback: name server, ports, programs that write and read them."""

import os
import pathlib
import re
import subprocess
import sys

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
        """A process that reads a port, and the file that it writes to."""
        return self.stage.start("yarp-read", self.programs / "yarp", "read", name, source)

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
