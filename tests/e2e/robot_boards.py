"""All boards of one bus of a whole robot, and its gauge: run as `robot_boards.py INTERFACE GAUGE_ID MODULES`.

MODULES is JSON: [identifier, kind, pressed] of each module. The law is count = 240 - pressure in kPa on every taxel, with
a dither of one count for noise; thermal pads stay. Boards send a scan every 50 ms, later when they are held up and never
sooner. A word on the standard input says what comes next: `rest`, `ramp` (the bag is pumped and vented again; answered
with `done`), `load` (30 kPa on the modules that are pressed), `end` (answered with the number of frames sent).
"""

import json
import select
import socket
import struct
import sys
import time

HEADER = struct.Struct("=IB3x")
PERIOD_S = 0.05
LOAD_KPA = 30
RISE_KPA_PER_S, TOP_KPA, FALL_KPA_PER_S = 4.0, 73.0, 30.0
# Values that are no taxels.
PADS = {"triangle": (6, 10), "fingertip": (), "palm-pad11": (11,), "palm-pad7": (7,)}


def payloads(kind, kpa, phase):
    """The two frames of a module under this pressure."""
    values = [240 - kpa + (phase + slot) % 3 - 1 for slot in range(12)]
    for pad in PADS[kind]:
        values[pad] = 240
    return bytes([0x40] + values[:7]), bytes([0xC0] + values[7:] + [0, 0])


class Boards:
    """What is sent next, all of it made once."""

    def __init__(self, gauge, modules):
        self.gauge = HEADER.pack(gauge, 4)
        self.modules = [(HEADER.pack(ident, 8), kind, pressed) for ident, kind, pressed in modules]
        self.made = {}
        self.what, self.began_s, self.sent = "rest", 0.0, 0

    def kpa(self):
        if self.what != "ramp":
            return 0.0
        t = time.monotonic() - self.began_s
        top_s = TOP_KPA / RISE_KPA_PER_S
        kpa = RISE_KPA_PER_S * t if t < top_s else max(0.0, TOP_KPA - FALL_KPA_PER_S * (t - top_s))
        if t > top_s + TOP_KPA / FALL_KPA_PER_S + 0.5:
            self.what = "rest"
            print("done", flush=True)
        return kpa

    def scan(self, number):
        """The frames of a scan."""
        kpa, phase = self.kpa(), number % 3
        frames = [self.gauge + round(1000 * kpa).to_bytes(4, "little", signed=True) + bytes(4)]
        key = (round(kpa), phase, self.what == "load")
        if key not in self.made:
            loaded = LOAD_KPA if self.what == "load" else 0
            self.made[key] = [
                header + payload
                for header, kind, pressed in self.modules
                for payload in payloads(kind, round(kpa) + pressed * loaded, phase)
            ]
        return frames + self.made[key]

    def obey(self, word):
        self.what, self.began_s = word, time.monotonic()
        if word == "end":
            print(self.sent, flush=True)
            sys.exit()


def main():
    boards = Boards(int(sys.argv[2]), json.loads(sys.argv[3]))
    with socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as bus:
        bus.bind((sys.argv[1],))
        due, number = time.monotonic(), 0
        while True:
            if select.select([sys.stdin], [], [], max(0.0, due - time.monotonic()))[0]:
                boards.obey(sys.stdin.readline().strip() or "end")
                continue
            for frame in boards.scan(number):
                bus.send(frame)
                boards.sent += 1
            number += 1
            due = max(due, time.monotonic() - 0.25 * PERIOD_S) + PERIOD_S


if __name__ == "__main__":
    main()
