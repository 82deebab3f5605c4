"""Candump logs for the end-to-end test, made without any code of taxeld's.

The synthetic skin has a known law, so that its force is known: count = 240 - pressure in kPa, rounded, on every taxel.
The insole's log is real skin in a pressure chamber, cut and played faster.
"""

import gzip
import math

TAXEL_SLOTS = (0, 1, 2, 3, 4, 5, 7, 8, 9, 11)
GAUGE = 0x3A1


class Log:
    """Lines of a candump log, in the order of time."""

    def __init__(self):
        self.lines = []
        self.time = 1_600_000_000.0

    def frame(self, ident, data, after=0.000_12):
        self.lines.append(f"({self.time:.6f}) can0 {ident:03X}#{data.hex().upper()}\n")
        self.time += after

    def write(self, path):
        with open(path, "w", encoding="ascii") as out:
            out.writelines(self.lines)
        return path


def synthetic(path, modules, seconds, pressures, bag_kpa, period=0.05, noise=0):
    """`pressures(taxel, t)` and `bag_kpa(t)` in kPa, on board 13 with `modules` triangles."""
    log = Log()
    scans = round(seconds / period)
    for scan in range(scans):
        begin, t = log.time, scan * period
        log.frame(GAUGE, round(bag_kpa(t) * 1000).to_bytes(4, "little", signed=True))
        for module in range(modules):
            values = [240] * 12
            for k, slot in enumerate(TAXEL_SLOTS):
                taxel = 10 * module + k
                # A dither of one count stands for the noise of a real taxel; its mean is zero.
                dither = noise * ((scan * 7 + taxel * 3) % 3 - 1)
                values[slot] = max(0, min(255, math.floor(240 - pressures(taxel, t) + dither + 0.5)))
            ident = 0x4D0 | module
            log.frame(ident, bytes([0x40] + values[:7]))
            log.frame(ident, bytes([0xC0] + values[7:] + [0, 0]))
        log.time = begin + period
    return log.write(path)


class Insole:
    """The recorded scans of the insole, each a list of (offset s, rest of line) with its pressure in kPa."""

    def __init__(self, path):
        self.scans = []
        scan, first = [], None
        with gzip.open(path, "rt", encoding="ascii") as log:
            for line in log:
                stamp, _, frame = line.split()
                time = float(stamp.strip("()"))
                if frame.startswith("3A1#"):
                    if scan:
                        self.scans.append(scan)
                    scan, first = [], time
                scan.append((time - first, frame))
        self.scans.append(scan)

    def pressure(self, index):
        data = bytes.fromhex(self.scans[index][0][1].split("#")[1])
        return int.from_bytes(data, "little", signed=True) / 1000

    def write(self, path, indices, period=0.016):
        """Plays the scans of these indices, one a period; frames stay as far apart as on a bus."""
        log = Log()
        for index in indices:
            begin = log.time
            for _, frame in self.scans[index]:
                ident, data = frame.split("#")
                log.frame(int(ident, 16), bytes.fromhex(data))
            log.time = begin + period
        return log.write(path)
