#!/usr/bin/env python3
"""Three arrays that are no skin of iCub, from their description alone, beside one that is.

The frames are encoded by cantools, which shares no code with taxeld. All four skins obey one law and bear one known
load; each is calibrated by `taxeld replay --calibrate` and then weighed by `taxeld replay --models`. The force of a
described array must be within half a point of that of the native path.

    python tests/arrays/arrays.py TAXELD SCRATCH
"""

import csv
import json
import pathlib
import random
import subprocess
import sys

import cantools

HERE = pathlib.Path(__file__).parent
PERIOD_S = 0.02
AREA_MM2 = 16.0
# The noise of untouched taxels beside the load adds some 0.06 N: far below half a point of this one.
LOAD_KPA = 40.0
LOADED = 40
TOP_KPA = 72.0
RATE = 2.4
# Half a point of the force beside the native path.
MARGIN = 0.005


def swing(taxel, kpa):
    """Units (256ths of the converter's range) by which a pressure moves a taxel: a law that bends, other for each taxel."""
    gain = 100.0 + (taxel * 37 % 40)
    return gain * kpa / (kpa + 60.0)


class Skin:
    """Raw counts of an array: `rest` in units, falling or rising, of so many bits, with noise of 0.8 units."""

    def __init__(self, taxels, bits, rest, sign, seed):
        self.taxels, self.bits, self.rest, self.sign = taxels, bits, rest, sign
        self.dice = random.Random(seed)
        self.per_unit = 2**bits / 256

    def scan(self, pressure):
        """One raw count per taxel."""
        counts = []
        for taxel in range(self.taxels):
            units = self.rest + self.sign * swing(taxel, pressure(taxel)) + self.dice.gauss(0.0, 0.8)
            counts.append(max(0, min(2**self.bits - 1, round(units * self.per_unit))))
        return counts


class Log:
    """Lines of a candump log, as `candump -L` writes them."""

    def __init__(self):
        self.lines, self.time = [], 1_600_000_000.0

    def frame(self, ident, extended, data, fd=False):
        name = f"{ident:08X}" if extended else f"{ident:03X}"
        mark = "##5" if fd else "#"
        self.lines.append(f"({self.time:.6f}) can0 {name}{mark}{data.hex().upper()}\n")
        self.time += 0.000_12


class Native:
    """Four boards' triangles as the skin boards send them; the gauge as the insole's."""

    config = "native.toml"

    def __init__(self):
        self.skin = Skin(60, 8, 240.0, -1, 1)

    def send(self, log, counts, kpa, scan):
        log.frame(0x3A1, False, round(kpa * 1000).to_bytes(4, "little", signed=True))
        for module in range(6):
            values = [230] * 12
            for k, slot in enumerate((0, 1, 2, 3, 4, 5, 7, 8, 9, 11)):
                values[slot] = counts[10 * module + k]
            log.frame(0x4D0 | module, False, bytes([0x40] + values[:7]))
            log.frame(0x4D0 | module, False, bytes([0xC0] + values[7:] + [0, 0]))


class Encoded:
    """Any array that a DBC file describes: signals T0, T1, ... and Pressure in kPa."""

    def __init__(self, skin, name):
        self.skin, self.config = skin, f"{name}.toml"
        self.dbc = (HERE / f"{name}.dbc").read_text(encoding="ascii")
        self.database = cantools.database.load_string(self.dbc, "dbc")

    def send(self, log, counts, kpa, scan):
        for message in self.database.messages:
            names = {signal.name for signal in message.signals}
            values = {f"T{n}": count for n, count in enumerate(counts) if f"T{n}" in names}
            values |= {name: value for name, value in (("Pressure", kpa), ("Scan", scan % 16)) if name in names}
            kinds = range(16) if "Kind" in names else [None]
            for kind in kinds:
                own = dict(values) if kind is None else values | {"Kind": kind}
                data = message.encode(own, strict=False)
                log.frame(message.frame_id, message.is_extended_frame, data, message.length > 8)


def multiplexed():
    """64 taxels of 12 bits in sixteen multiplexed frames of four, falling; the gauge in a message of its own."""
    return Encoded(Skin(64, 12, 240.0, -1, 2), "multiplexed")


def can_fd():
    """16 x 16 taxels of 16 bits in eight frames of CAN FD, falling."""
    return Encoded(Skin(256, 16, 240.0, -1, 3), "can-fd")


def rising():
    """48 taxels of ten bits that rise, big endian, six a frame beside a scan counter, with identifiers of 29 bits; the
    gauge in the same file."""
    return Encoded(Skin(48, 10, 30.0, 1, 4), "rising")


def write(array, path, seconds, bag, pressure):
    log = Log()
    for scan in range(round(seconds / PERIOD_S)):
        begin, t = log.time, scan * PERIOD_S
        array.send(log, array.skin.scan(lambda taxel: pressure(taxel, t)), bag(t), scan)
        log.time = begin + PERIOD_S
    path.write_text("".join(log.lines), encoding="ascii")
    return path


def run(*words):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(str(word) for word in words)}\n{done.stdout}{done.stderr}")
    return done.stdout


def weigh(array, taxeld, scratch):
    """The relative error of the force under the known load, and in how many scans it is within two sigmas."""
    scratch.mkdir(parents=True, exist_ok=True)
    config = scratch / array.config
    config.write_text((HERE / array.config).read_text(), encoding="ascii")
    if hasattr(array, "dbc"):
        (scratch / array.config.replace(".toml", ".dbc")).write_text(array.dbc, encoding="ascii")
    print(run(taxeld, "check", "--config", config), end="")

    def bag(t):
        return max(0.0, min(TOP_KPA, RATE * (t - 3.0)))

    ramp = write(array, scratch / "ramp.log", 4.0 + TOP_KPA / RATE, bag, lambda taxel, t: bag(t))
    models = scratch / "models.json"
    print(run(taxeld, "replay", ramp, "--config", config, "--calibrate", "70", "--out", models), end="")

    def load(taxel, t):
        return LOAD_KPA if taxel < LOADED and 4.0 <= t < 8.0 else 0.0

    log = write(array, scratch / "load.log", 9.0, lambda t: 0.0, load)
    force = scratch / "force.csv"
    run(taxeld, "replay", log, "--config", config, "--models", models, "--force", force)
    truth = LOADED * LOAD_KPA * AREA_MM2 * 1e-3
    with open(force, encoding="ascii") as rows:
        rows = list(csv.DictReader(rows))
    begin = float(rows[0]["time_s"])
    under = [row for row in rows if 4.5 <= float(row["time_s"]) - begin < 7.5]
    good = [(float(row["total_n"]), float(row["sigma_n"])) for row in under if row["state"] in ("OK", "DEGRADED")]
    if len(good) < 0.95 * len(under) or not under:
        sys.exit(f"{array.config}: a force in {len(good)} of {len(under)} scans under load: {under[-1:]}")
    free = [row for row in rows if 2.5 <= float(row["time_s"]) - begin < 3.9 and row["total_n"]]
    empty = max(abs(float(row["total_n"])) for row in free)
    error = sum(total for total, _ in good) / len(good) / truth - 1.0
    held = sum(abs(total - truth) <= 2.0 * sigma for total, sigma in good) / len(good)
    print(f"{array.config}: {truth:.2f} N reads {100 * error:+.2f} %, within two sigmas in {100 * held:.0f} % of {len(good)} "
          f"scans, {empty:.3f} N without a load")
    return {"error": error, "held": held, "empty": empty}


def main():
    taxeld, scratch = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
    arrays = [Native(), multiplexed(), can_fd(), rising()]
    found = {array.config: weigh(array, taxeld, scratch / array.config.removesuffix(".toml")) for array in arrays}
    print(json.dumps(found, indent=1))
    native = found["native.toml"]["error"]
    for name, one in found.items():
        worse = abs(one["error"]) - abs(native)
        if worse > MARGIN or one["held"] < 0.95 or one["empty"] > 0.05:
            sys.exit(f"{name}: {one}, the native path {100 * native:+.2f} %")


if __name__ == "__main__":
    main()
