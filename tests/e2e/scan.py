#!/usr/bin/env python3
"""`taxeld scan` on a live bus: the boards, modules and periods that are there, and a configuration begun with them.

Two boards with different periods and a gauge send on vcan0, two arrays that cantools encodes on buses of their own.

usage: scan.py TAXELD SCRATCH      (inside tests/vcan/lab: makes the interfaces that it needs)
"""

import json
import pathlib
import re
import subprocess
import sys
import tempfile

import foreign_arrays
from foreign_arrays import arrays
from logs import GAUGE, TAXEL_SLOTS, Log
from run import Boards

SECONDS = 3.0
# Boards send no faster than their period, and a busy machine holds them up.
PERIOD_SHARES = (0.9, 1.6)
HELD_UP_SHARE = 0.05


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


def taxeld_scan(taxeld, interface, *words):
    """What it says as JSON; its exit code is checked."""
    command = [taxeld, "scan", "--interface", interface, "--seconds", str(SECONDS), "--json", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout)


def unhurried(differences):
    """Without those that say that something comes more slowly than configured: that may be this machine's fault."""
    def slow(line):
        board = re.search(r"sends every (\d+) ms, the configuration says (\d+) ms", line)
        described = re.search(r"(\S+) frames with identifier \S+ came a second, the configuration says (\S+)", line)
        return board and int(board[1]) > int(board[2]) or described and float(described[1]) < float(described[2])

    return [line for line in differences if not slow(line)]


def check_config(taxeld, config):
    done = subprocess.run([taxeld, "check", "--config", str(config)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def check_boards(taxeld, scratch):
    present = {13: ([0, 1, 2, 5, 15], 50), 12: ([1, 3], 20)}
    begun = scratch / "begun.toml"
    logs = {a: boards(scratch / f"{a}.log", a, *what, gauge=a == 13) for a, what in present.items()}
    with Boards(logs[13]), Boards(logs[12]):
        found = taxeld_scan(taxeld, "vcan0", "--out", begun)["findings"]
        again = unhurried(taxeld_scan(taxeld, "vcan0", "--config", begun)["differences"])
    # Senders in Python that share a processor with the daemon are some milliseconds early or late.
    pace = re.match(r"board 12 sends every (\d+) ms, the configuration says (\d+) ms$", again[0]) if len(again) == 1 else None
    assert pace and 18 <= int(pace[1]) < 40 and 45 <= int(pace[2]) < 90, again
    assert found["boards"].keys() == {"12", "13"}, found["boards"].keys()
    for address, (modules, period_ms) in present.items():
        board = found["boards"][str(address)]
        assert sorted(map(int, board["modules"])) == modules, board
        assert PERIOD_SHARES[0] < board["period_ms"] / period_ms < PERIOD_SHARES[1], board["period_ms"]
        # A machine that holds the sender up between the two halves of a scan makes orphans of them.
        orphans = [module["orphans"] / module["scans"] for module in board["modules"].values()]
        assert max(orphans) <= HELD_UP_SHARE and not any(module["flickering"] for module in board["modules"].values()), board
    gauge = next(other for other in found["others"] if other["id"] == f"{GAUGE:03X}")
    first = gauge["pressures"][0]
    assert (first["unit"], first["length_bits"], first["start_bit"], first["moving"]) == ("Pa", 32, 0, True), first
    said = check_config(taxeld, begun)
    assert "70 taxels on 7 modules" in said and "calibration with the gauge" in said, said
    print(f"boards: {found['frames']} frames in {found['seconds']:.1f} s, both boards, 7 modules and the gauge found", flush=True)
    silent = taxeld_scan(taxeld, "vcan0", "--config", begun)["differences"]
    assert silent[:2] == ["board 12 is configured and was not heard", "board 13 is configured and was not heard"], silent
    assert "the gauge, identifier 3A1, was not heard" in silent[2], silent


def bag(t):
    """Pumped, with the noise of a gauge."""
    return 10.0 * t + 0.04 * (7 * round(50 * t) % 5)


def check_arrays(taxeld, scratch):
    """A description is compared with what comes: nothing to say of the right one, and each silent frame is named."""
    for n, array in enumerate([arrays.can_fd(), arrays.rising()], start=1):
        interface, config = f"vcan{n}", scratch / array.config
        foreign_arrays.make_interface(interface)
        text = (foreign_arrays.HERE.parent / "arrays" / array.config).read_text(encoding="ascii")
        config.write_text(text.replace('"can0"', f'"{interface}"'), encoding="ascii")
        config.with_suffix(".dbc").write_text(array.dbc, encoding="ascii")
        check_config(taxeld, config)
        log = str(arrays.write(array, scratch / "array.log", 3.0, bag, lambda *_: 0.0))
        with Boards(log, interface=interface):
            differences = unhurried(taxeld_scan(taxeld, interface, "--config", config)["differences"])
            assert not differences, differences
        silent = taxeld_scan(taxeld, interface, "--config", config)["differences"]
        assert len(silent) == 9 and all("not heard" in line for line in silent), silent
        print(f"{array.config}: as described, and silent when it is", flush=True)


def main():
    taxeld, scratch = sys.argv[1], pathlib.Path(sys.argv[2])
    scratch.mkdir(parents=True, exist_ok=True)
    scratch = pathlib.Path(tempfile.mkdtemp(dir=scratch))
    check_boards(taxeld, scratch)
    check_arrays(taxeld, scratch)
    print("2 passed, 0 failed")


if __name__ == "__main__":
    main()
