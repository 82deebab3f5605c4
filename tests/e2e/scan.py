#!/usr/bin/env python3
"""`taxeld scan` on a live bus: the boards, modules and periods that are there, and a configuration begun with them.

Two boards with different periods and a gauge send on vcan0.

usage: scan.py TAXELD SCRATCH      (inside tests/vcan/lab)
"""

import pathlib
import re
import subprocess
import sys
import tempfile

from logs import GAUGE, TAXEL_SLOTS, Log
from run import Boards

SECONDS = 3.0
# Boards send no faster than their period, and a busy machine holds them up.
PERIOD_SHARES = (0.9, 1.6)


def boards(path, address, modules, period_ms, gauge=False):
    """A log of one board at rest, for three seconds; the gauge's bag is pumped meanwhile, to 30 kPa."""
    log = Log()
    for scan in range(round(3000 / period_ms)):
        begin = log.time
        if gauge:
            pascal = round(10 * period_ms * scan) + 40 * (7 * scan % 5)  # a gauge has noise, or it counts
            log.frame(GAUGE, pascal.to_bytes(4, "little", signed=True))
        for module in modules:
            values = [240] * 12
            for slot in TAXEL_SLOTS:
                values[slot] = 239 + (7 * scan + 5 * slot + module) % 3
            ident = 0x400 | address << 4 | module
            log.frame(ident, bytes([0x40] + values[:7]))
            log.frame(ident, bytes([0xC0] + values[7:] + [0, 0]))
        log.time = begin + 1e-3 * period_ms
    return log.write(str(path))


def taxeld_scan(taxeld, *words):
    """What it says; its exit code is checked."""
    command = [taxeld, "scan", "--interface", "vcan0", "--seconds", str(SECONDS), *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def check_boards(taxeld, scratch):
    present = {13: ([0, 1, 2, 5, 15], "0-2, 5, 15", 50), 12: ([1, 3], "1, 3", 20)}
    begun = scratch / "begun.toml"
    logs = {a: boards(scratch / f"{a}.log", a, numbers, ms, gauge=a == 13) for a, (numbers, _, ms) in present.items()}
    with Boards(logs[13]), Boards(logs[12]):
        said = taxeld_scan(taxeld, "--out", begun)
    found = {int(a): (m, float(ms)) for a, m, ms in re.findall(r"^board (\d+): modules (.*), every (\S+) ms$", said, re.M)}
    assert found.keys() == present.keys(), said
    for address, (_, modules, period_ms) in present.items():
        assert found[address][0] == modules, said
        assert PERIOD_SHARES[0] < found[address][1] / period_ms < PERIOD_SHARES[1], said
    assert re.search(f"^identifier {GAUGE:03X}: .* of 4 bytes, last ", said, re.M), said
    checked = subprocess.run([taxeld, "check", "--config", str(begun)], capture_output=True, text=True)
    assert checked.returncode == 0, checked.stderr
    assert "70 taxels on 7 modules" in checked.stdout, checked.stdout
    print(f"{said.splitlines()[0]}: both boards, 7 modules and the gauge's frames found", flush=True)
    silent = taxeld_scan(taxeld)
    assert "no skin board was heard" in silent, silent


def main():
    taxeld, scratch = sys.argv[1], pathlib.Path(sys.argv[2])
    scratch.mkdir(parents=True, exist_ok=True)
    scratch = pathlib.Path(tempfile.mkdtemp(dir=scratch))
    check_boards(taxeld, scratch)
    print("1 passed, 0 failed")


if __name__ == "__main__":
    main()
