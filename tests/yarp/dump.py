#!/usr/bin/env python3
"""A recording of a skin port, as yarpdatadumper writes it, gives the force that the same frames give.

    tests/yarp/dump.py TAXELD SCRATCH

The recorded insole (TAXELD_DATA) is put on a port as a robot's software would: every 20 ms what came last, so that each scan
is there three times.
"""

import gzip
import itertools
import json
import os
import pathlib
import subprocess
import sys

TRIANGLES_13, TRIANGLES_12 = [*range(14), 15], [*range(9), 11]
PORT, BAG = "/icub/skin/insole", "/bag/pressure:o"
CONFIG = """
[store]
path = "unused.db"
[[bus]]
name = "skin"
{bus}
[[patch]]
name = "insole"
bus = "skin"
{port}
period_ms = 61
boards = [{{ address = 13, modules = "0-13, 15" }}, {{ address = 12, modules = "0-8, 11" }}] # without the three that are dead
gauge = {{ {gauge}, unit = "Pa", noise_kpa = 0.2 }}
[patch.session]
pressurised_chamber = true
target_kpa = 300.0
noise_band_kpa = 2.0
rise_max_kpa_per_s = 50.0
"""


def frames(log):
    for line in gzip.open(log, "rt"):
        time, _, frame = line.split()[:3]
        identifier, data = frame.split("#")
        yield float(time[1:-1]), int(identifier, 16), bytes.fromhex(data)


def record(log, folder):
    """The two folders of a dumper, and the triangles that ever changed."""
    vector, pressure, changed = [240] * 384, 0, set()
    files = {}
    for name, source in ((PORT, "skin"), (BAG, "bag")):
        inner = folder / source
        inner.mkdir(parents=True, exist_ok=True)
        (inner / "info.log").write_text(f"Type: Bottle;\n[0.0] {name} [connected]\nStamp: tx;\n")
        files[source] = open(inner / "data.log", "w")
    due, number = None, 0
    for time, identifier, data in frames(log):
        due = time if due is None else due
        while time > due:
            files["skin"].write(f"{number} {due:.6f} {' '.join(f'{count}.0' for count in vector)}\n")
            files["bag"].write(f"{number} {due:.6f} {pressure}.0\n")
            due, number = due + 0.02, number + 1
        if identifier == 0x3A1:
            pressure = int.from_bytes(data[:4], "little", signed=True)
            continue
        board, triangle = identifier >> 4 & 15, identifier & 15
        at = 192 * (13 - board) + 12 * triangle + (0 if data[0] == 0x40 else 7)
        new = list(data[1:8] if data[0] == 0x40 else data[1:6])
        if vector[at : at + len(new)] != new:
            changed.add((board, triangle))
        vector[at : at + len(new)] = new
    for file in files.values():
        file.close()
    return changed


def replay(taxeld, source, config, *more):
    command = [taxeld, "replay", source, "--config", config, *more]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def main():
    taxeld, scratch = sys.argv[1], pathlib.Path(sys.argv[2]).resolve()
    scratch.mkdir(parents=True, exist_ok=True)
    log = pathlib.Path(os.environ.get("TAXELD_DATA", "")) / "insole/left_calibration_16hz.candump.gz"
    if not log.is_file():
        print("SKIPPED: the insole recordings are not here (TAXELD_DATA)")
        return
    changed = record(log, scratch / "dump")
    can, port = scratch / "can.toml", scratch / "port.toml"
    can.write_text(CONFIG.format(bus='interface = "can0"', port="listen_only = true", gauge='id = 0x3A1, signal = "0|32@1-"'))
    port.write_text(CONFIG.format(bus='source = "yarp"', port=f'port = "{PORT}"', gauge=f'port = "{BAG}"'))
    models = scratch / "models.json"
    for name, source, config in (("can", log, can), ("port", scratch / "dump", port)):
        replay(taxeld, source, config, "--calibrate", "300", "--out", models)
        models.rename(scratch / f"{name}.json")
    sets = [json.loads((scratch / f"{name}.json").read_text())["taxels"] for name in ("can", "port")]
    both = [pair for pair in zip(*sets) if all(taxel["status"] == "ok" for taxel in pair)]
    usable = [sum(taxel["status"] == "ok" for taxel in taxels) for taxels in sets]
    ratios = []
    for line in itertools.islice(open(scratch / "dump/skin/data.log"), 0, None, 25):
        values = [float(word) for word in line.split()[2:]]
        sums = [0.0, 0.0]
        for pair in both:
            count = values[row(pair[0]["taxel"])]
            if all(taxel["range"][0] <= count <= taxel["range"][1] for taxel in pair):
                for at, taxel in enumerate(pair):
                    sums[at] += sum(c * count**power for power, c in enumerate(taxel["coefficients"]))
        if sums[0] > 1000:  # kPa over all taxels
            ratios.append(sums[1] / sums[0] - 1)
    mean = sum(ratios) / len(ratios)
    print(
        f"{len(changed)} triangles changed; usable taxels by frames {usable[0]}, by the port {usable[1]}; over the {len(both)} of "
        f"both the port's models give {100 * mean:+.2f} % more in the mean of {len(ratios)} scans, {100 * max(map(abs, ratios)):.2f} % at most"
    )
    assert len(both) > 170 and len(ratios) > 500 and abs(mean) < 0.003, mean


def row(taxel):
    """Of a taxel of the insole: its place in the port's vector."""
    board, triangle = (0, taxel // 10) if taxel < 150 else (1, taxel // 10 - 15)
    triangle = [TRIANGLES_13, TRIANGLES_12][board][triangle]
    return 192 * board + 12 * triangle + [0, 1, 2, 3, 4, 5, 7, 8, 9, 11][taxel % 10]


main()
