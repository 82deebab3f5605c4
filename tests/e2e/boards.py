"""Boards on a CAN interface, played from candump logs: run as `boards.py INTERFACE LOG...`.

canplayer keeps to the log's clock: when the machine holds it up, it sends what is overdue at once, several scans of a
module within a millisecond. A board does not do that, and taxeld refuses such scans as old frames out of a queue.
These boards send a module's scans a period apart at least, and are late when they are held up. Nor do they fall silent
between two logs: they begin with the first log, again and again. A number on the standard input is the log to play
next: `1` once, with a line on the standard output at its end, and then on with the log before it; `loop 1` for good.
"""

import select
import socket
import struct
import sys
import time

FRAME = struct.Struct("=IB3x8s")
FD_FRAME = struct.Struct("=IBB2x64s")
EXTENDED = 0x80000000
FDF = 0x04
# A longer pause between two frames of a log parts two scans; within a scan frames follow each other as on a bus.
SCAN_GAP_S = 0.002


def wire(text):
    """Identifier and bytes for a socket of a frame as `candump -L` writes it: `123#00`, `12345678#00` or `123##500`."""
    ident, data = text.split("#", 1)
    number = int(ident, 16) | (EXTENDED if len(ident) == 8 else 0)
    if data.startswith("#"):
        payload = bytes.fromhex(data[2:])
        return number, FD_FRAME.pack(number, len(payload), FDF | int(data[1], 16), payload)
    payload = bytes.fromhex(data)
    return number, FRAME.pack(number, len(payload), payload)


def scans(path):
    """The log's scans, each with a list of frames for each identifier, and the period between two scans in seconds."""
    starts, scans_of_log, last = [], [], None
    with open(path, encoding="ascii") as lines:
        for line in lines:
            stamp, _, frame = line.split()
            stamp_s = float(stamp.strip("()"))
            if last is None or stamp_s - last > SCAN_GAP_S:
                starts.append(stamp_s)
                scans_of_log.append({})
            number, sent = wire(frame)
            scans_of_log[-1].setdefault(number, []).append(sent)
            last = stamp_s
    return scans_of_log, (starts[-1] - starts[0]) / (len(starts) - 1)


def wanted():
    """The command on the standard input, if one has come; an end of it ends the boards."""
    if not select.select([sys.stdin], [], [], 0)[0]:
        return None
    line = sys.stdin.readline()
    if not line:
        sys.exit()
    return line.split()


class Boards:
    """What is sent next."""

    def __init__(self, logs):
        self.logs = logs
        self.looped, self.once, self.at = 0, None, 0

    def obey(self, command):
        if command[0] == "loop":
            self.looped, self.once = int(command[1]), None
        else:
            self.once = int(command[0])
        self.at = 0

    def next_scan(self):
        """The next scan, and how long after the one before it each of its modules is due, in seconds."""
        log, period = self.logs[self.looped if self.once is None else self.once]
        scan = log[self.at]
        self.at += 1
        if self.at == len(log):
            self.at = 0
            if self.once is not None:
                print(f"played {self.once}", flush=True)
            self.once = None
        return scan, period


def main():
    boards = Boards([scans(path) for path in sys.argv[2:]])
    with socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as bus:
        bus.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        bus.bind((sys.argv[1],))
        sent_s = {}
        while True:
            command = wanted()
            if command:
                boards.obey(command)
            scan, period = boards.next_scan()
            # All of a scan wait for the one that was held up most, so that gauge and modules stay together.
            due = max(sent_s.get(ident, 0.0) for ident in scan) + period
            early = due - time.monotonic()
            if early > 0:
                time.sleep(early)
            for ident, frames in scan.items():
                for frame in frames:
                    bus.send(frame)
                # A quarter of a period is made up for, or every hold-up would make the boards slower for good.
                sent_s[ident] = max(due, time.monotonic() - 0.25 * period)


main()
