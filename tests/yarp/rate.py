#!/usr/bin/env python3
"""What twelve skin parts at 50 Hz cost the daemon, and how long a value takes from its port into shared memory.

    tests/yarp/rate.py TAXELD SCRATCH PROGRAMS [--seconds 60]      (PROGRAMS: what tests/yarp/build prints)

The name server is YARP's own. The ports are this script's: it writes what `yarp write` writes, and knows when. Each scan is sent three
times, 20 ms apart. The delay is from the writing of a changed vector to the new sample in the page of the patch, which a second
thread polls; where the machine is busy, its own wait for the processor is in it.
"""

import argparse
import mmap
import os
import pathlib
import random
import socket
import sys
import tempfile
import threading
import time

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "bridge"))
from stage import Stage, free_port, quantiles, until  # noqa: E402
from yarp import Yarp  # noqa: E402

# As on an iCub: boards of each part, in the order of its port.
HAND, FOREARM, ARM, THIGH, SHANK = [14], [13, 12], [11, 10, 9, 8], [1, 2, 3, 4, 5, 6, 7], [8, 9, 10, 11]
SIDED = [("hand", HAND), ("forearm", FOREARM), ("arm", ARM), ("leg_upper", THIGH), ("leg_lower", SHANK)]
PARTS = [(f"{side}_{name}", boards) for side in ("left", "right") for name, boards in SIDED] + [("torso", [7, 8, 9, 10]), ("left_foot", FOREARM)]
TRIANGLES = range(11)  # alive, of each board
CONFIG = """
listen = ["tcp:127.0.0.1:{grpc}"]
[store]
path = "{folder}/taxeld.db"
[shared_memory]
path = "{pages}"
[[bus]]
name = "robot"
source = "yarp"
server = "127.0.0.1:{yarp}"
"""
WRITES = 16  # the word of a page that counts its samples: deploy/shared-memory.md


class Port:
    """A skin port: what it sends when, and who reads it."""

    def __init__(self, name, boards, server):
        self.name, self.listener = name, socket.create_server(("127.0.0.1", 0))
        at = self.listener.getsockname()[1]
        with socket.create_connection(("127.0.0.1", server)) as ask:
            ask.sendall(f"CONNECT rate\nd\nregister {name} tcp 127.0.0.1 {at}\n".encode())
            answer = ask.makefile()
            assert any(line.startswith("registration") for line in iter(answer.readline, "*** end of message\n")), name
        noise = random.Random(name)
        value = lambda triangle: 240 - noise.randrange(4) if triangle % 16 in TRIANGLES else 240
        rows = 192 * len(boards)
        self.scans = [" ".join(f"{value(row // 12)}.0" for row in range(rows)) for _ in range(16)]
        self.readers = []
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            reader, _ = self.listener.accept()
            reader.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            said = b""
            while not said.endswith(b"\nr\n"):
                said += reader.recv(100)
            reader.sendall(b"Welcome rate\r\n")
            self.readers.append(reader)

    def send(self, number):
        message = f"do {number} {time.time():.6f}\r\n{self.scans[number // 3 % 16]}\r\n".encode()
        for reader in list(self.readers):
            try:
                reader.sendall(message)
            except OSError:
                self.readers.remove(reader)


def cpu_s(pid):
    fields = open(f"/proc/{pid}/stat").read().rsplit(") ", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Page:
    """Polls a page, and says when a sample came after a moment."""

    def __init__(self, path):
        with open(path, "rb") as file:
            self.words = memoryview(mmap.mmap(file.fileno(), 4096, prot=mmap.PROT_READ)).cast("Q")

    def next_after(self, count, limit_s=0.05):
        """When the count of samples went beyond `count`, in ns; None if it did not."""
        end = time.monotonic_ns() + int(limit_s * 1e9)
        while (now := time.monotonic_ns()) < end:
            if self.words[WRITES] != count:
                return now
        return None


def play(stage, taxeld, programs, seconds, pages):
    yarp, folder = Yarp(stage, programs), stage.scratch
    ports = [Port(f"/icub/skin/{name}", boards, yarp.port) for name, boards in PARTS]
    config = CONFIG.format(grpc=free_port(), folder=folder, pages=pages, yarp=yarp.port)
    for name, boards in PARTS:
        list_of = ", ".join(f'{{ address = {board}, modules = "{TRIANGLES[0]}-{TRIANGLES[-1]}" }}' for board in boards)
        config += f'[[patch]]\nname = "{name}"\nbus = "robot"\nport = "/icub/skin/{name}"\nperiod_ms = 60\nboards = [{list_of}]\n'
    (folder / "taxeld.toml").write_text(config)
    daemon = stage.start("taxeld", taxeld, "run", "--config", folder / "taxeld.toml")
    until("the page is there", (pages / "left_forearm").exists)
    page, number, delays = Page(pages / "left_forearm"), 0, []
    due = time.monotonic()
    first = ports[[name for name, _ in PARTS].index("left_forearm")]
    others = [port for port in ports if port is not first]
    begin = None
    while begin is None or time.monotonic() < begin[0] + seconds:
        if begin is None and number > 150 and all(port.readers for port in ports):
            begin = (time.monotonic(), cpu_s(daemon.pid), number)
        for port in others:
            port.send(number)
        count, sent = page.words[WRITES], time.monotonic_ns()
        first.send(number)
        if number % 3 == 0 and begin:
            came = page.next_after(count)
            delays.append((came or sent + 50_000_000) - sent)
        number, due = number + 1, due + 0.02
        time.sleep(max(0.0, due - time.monotonic()))
    elapsed, used = time.monotonic() - begin[0], cpu_s(daemon.pid) - begin[1]
    taxels = 10 * len(TRIANGLES) * sum(len(boards) for _, boards in PARTS)
    rate = (number - begin[2]) / elapsed
    print(f"{len(PARTS)} parts, {taxels} taxels, {rate:.1f} messages/s each: {100 * used / elapsed:.2f} % of a core")
    missed = sum(delay >= 50_000_000 for delay in delays)
    print(f"value on the port -> force in shared memory: {quantiles(delays)}; {len(delays)} scans, {missed} later than 50 ms")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("taxeld")
    parser.add_argument("scratch", type=pathlib.Path)
    parser.add_argument("programs")
    parser.add_argument("--seconds", type=float, default=60)
    args = parser.parse_args()
    stage = Stage(args.scratch.resolve())

    def measured():
        with tempfile.TemporaryDirectory(dir="/dev/shm") as folder:
            try:
                play(stage, args.taxeld, args.programs, args.seconds, pathlib.Path(folder) / "pages")
            finally:
                for process in stage.processes:
                    stage.end(process)

    stage.play(measured)


main()
