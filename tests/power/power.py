#!/usr/bin/env python3
"""Power cuts of the store on ext4, in the lab; started by `run` beside this.

One process does to a store what a daemon does for days, on a device that writes down all writes and flushes. Then the disk
is put back to each moment, mounted, and the store is opened: what was acknowledged by then has to be there, and nothing that
was refused.
"""

import argparse
import ctypes
import os
import random
import subprocess
import sys
import time

from device_mapper import LoggedDevice
from disk import SECTOR, Disk, read_log

SIZE, LOG_SIZE = 16 << 20, 64 << 20
DATA, LOG, CUT = "/dev/ram0", "/dev/ram1", "/dev/ram2"
FOLDER = "/tmp/disk"
STORE = f"{FOLDER}/store.db"
LIBC = ctypes.CDLL(None, use_errno=True)

# Where flushes do nothing in a run that must lose something, by the end of the file's path.
CUTS_OF_CONTROLS = 30
CONTROLS = {"anywhere": "", "the write-ahead log": "-wal", "the database": "store.db", "the copy": "-copy-part"}


def checked(result, what):
    if result != 0:
        raise OSError(ctypes.get_errno(), f"{what}: {os.strerror(ctypes.get_errno())}")


def mount(device):
    checked(LIBC.mount(device.encode(), FOLDER.encode(), b"ext4", 0, None), f"mount {device}")


def unmount():
    checked(LIBC.umount(FOLDER.encode()), f"unmount {FOLDER}")


def whole(path):
    with open(path, "rb") as device:
        return device.read(SIZE)


class Child:
    """A test of the store's crate that takes and gives lines."""

    def __init__(self, binary, test, plan, **environment):
        name = f"tests::power::{test}"
        self.process = subprocess.Popen(
            [binary, "--exact", name, "--nocapture", "--test-threads=1"],
            env={**os.environ, "TAXEL_STORE_POWER_PLAN": plan, **environment},
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )

    def say(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def lines(self, *words):
        """Lines that begin with one of these words; the rest is the test harness's."""
        for line in self.process.stdout:
            if line.split(" ")[0].strip() in words:
                yield line.strip()

    def end(self):
        self.process.stdin.close()
        self.process.stdout.read()
        if self.process.wait() != 0:
            raise RuntimeError(f"{self.process.args}: ended with {self.process.returncode}")


def record(binary, plan, empty, **environment):
    """The log of a run on an empty disk."""
    for path, content in ((DATA, empty), (LOG, bytes(SECTOR))):
        with open(path, "wb") as device:
            device.write(content)
    device = LoggedDevice("power", DATA, LOG, SIZE)
    mount(device.path)
    child = Child(binary, "writing_child", plan, TAXEL_STORE_POWER_WRITER=STORE, **environment)
    for line in child.lines("begins", "done"):
        device.mark(line.replace(" ", "-"))
        if line.startswith("begins"):
            child.say("")
    child.end()
    unmount()
    device.close()
    entries = read_log(LOG)
    disk = Disk(empty, entries)
    while not disk.ended():
        disk.step()
    if disk.all_written() != whole(DATA):
        raise RuntimeError("the log is not all that was written to the disk")
    return entries


class Looker:
    """Opens what a cut has left."""

    def __init__(self, binary, plan, keep):
        self.child = Child(binary, "looking_child", plan, TAXEL_STORE_POWER_LOOKER="1")
        self.answers = self.child.lines("sound", "lost")
        # Where a disk on which something is lost is kept.
        self.keep = keep
        # How many acknowledgements there have to be before anything is looked at.
        self.least = 0

    def look(self, content, disk, what):
        """Raises Lost if what is on a disk with this content is not what it has to be."""
        if disk.done < self.least:
            return
        with open(CUT, "wb") as device:
            device.write(content)
        mount(CUT)
        try:
            self.child.say(f"{STORE} {disk.done} {disk.begun}")
            answer = next(self.answers, "lost the process that looks")
        finally:
            unmount()
        if answer.startswith("lost"):
            if self.keep:
                with open(self.keep, "wb") as image:
                    image.write(content)
            raise Lost(f"{what}, {disk.done} acknowledged, {disk.begun} begun: {answer}")

    def end(self):
        self.child.end()


class Lost(Exception):
    """Something acknowledged is not there, or something is there that should not be."""


def at_each_flush(looker, disk):
    """Looks at the disk as each flush leaves it: all that was acknowledged before the next one has to be there. Gives how
    many flushes there were."""
    flushes = 0
    while True:
        if disk.ended() or disk.keeps_more_next():
            flushes += 1
            looker.look(disk.kept, disk, f"at flush {flushes}")
        if disk.ended():
            return flushes
        disk.step()


def at_random(looker, disk, seeds):
    """Looks at what power cuts at random moments leave. Gives at how many of them something was written and not flushed."""
    undecided = 0
    moments = sorted((random.Random(seed).randrange(len(disk.entries)), seed) for seed in seeds)
    for position, seed in moments:
        while disk.position < position:
            disk.step()
        undecided += bool(disk.open)
        content, left = disk.cut(seed)
        looker.look(content, disk, f"cut {seed} after entry {position} of {len(disk.entries)}, {left}")
    return undecided


def loss(looker, disks, where):
    """What is lost first in a run whose flushes of something do nothing: if nothing is, the test could not fail."""
    try:
        at_each_flush(looker, disks())
        at_random(looker, disks(), range(CUTS_OF_CONTROLS))
    except Lost as lost:
        return f"without flushes of {where}, {str(lost)[:160]}"
    raise SystemExit(f"power: without flushes of {where} nothing was lost, so that this test shows nothing")


def told(what):
    print(f"{time.monotonic():6.1f} s  {what}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("binary", help="the tests of taxel-store")
    parser.add_argument("faults", help="the compiled disk_faults.c")
    parser.add_argument("keep", help="where a disk on which something is lost is kept")
    parser.add_argument("--seed", type=int, default=1, help="of what is done to the store")
    parser.add_argument("--events", type=int, default=40, help="how much is done to it")
    parser.add_argument("--cuts", type=int, default=30, help="at random moments")
    options = parser.parse_args()

    for module in (f"brd rd_nr=3 rd_size={LOG_SIZE >> 10}", "dm-mod", "dm-log-writes"):
        subprocess.run(["modprobe", "-d", "/run/modules", *module.split()], check=True)
    subprocess.run(["mkfs.ext4", "-q", "-E", "nodiscard", "-J", "size=4", DATA, f"{SIZE >> 10}k"], check=True)
    os.mkdir(FOLDER)
    empty = whole(DATA)

    plan = f"{options.seed} {options.events}"
    entries = record(options.binary, plan, empty)
    told(f"seed {options.seed}: {options.events} things were done to a store, {len(entries)} entries in the log")
    looker = Looker(options.binary, plan, options.keep)
    flushes = at_each_flush(looker, Disk(empty, entries))
    told(f"{flushes} flushes: at each all that was acknowledged is there")
    first = options.seed * 1_000_000
    undecided = at_random(looker, Disk(empty, entries), range(first, first + options.cuts))
    told(f"{options.cuts} power cuts at random moments, {undecided} of them with writes that were not flushed: the same")

    # What is acknowledged, not a store that never came to be.
    looker.keep, looker.least = None, 1
    told(loss(looker, lambda: Disk(empty, entries, obeys=False), "the disk itself"))
    for where, end in CONTROLS.items():
        environment = {"LD_PRELOAD": options.faults, "FAULT": "unflushed", "FAULT_DIR": FOLDER, "FAULT_OF": end}
        unflushed = record(options.binary, plan, empty, **environment)
        told(loss(looker, lambda: Disk(empty, unflushed), where))
    looker.end()


if __name__ == "__main__":
    try:
        main()
    except Lost as lost:
        sys.exit(f"power: {lost}")
