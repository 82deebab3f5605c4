#!/usr/bin/env python3
"""Weighs on the second simulated skin (skin.py): calibrates taxeld in the bag, lays masses or fingers, reads the force.

usage: weigh.py TAXELD SCRATCH [--first-seed 1] [--seeds 3] [--placements 24] [--quick]      needs numpy

Per row of the table: mean and bias of the force's error, share of placements whose truth lies within two stated standard
uncertainties, of single scans the stated uncertainty over the root mean square of the error and the share within 95 %, the bias
of the lightest mass, and the force that is read where nothing lies (99 % of the scans below it).
The skin that is simulated has the area of its drawing and the gain of the day of its calibration; a real one has not, and the
stated uncertainty has both. So for single scans they are drawn, normally distributed, and the mean over all draws is told.
A skin that was never pressed before its calibration has another dead zone on that first ramp than on all loads that follow.
Rows of "both branches" calibrate over the rise and the fall of the same log: their error is at most that of the rise alone.
With --quick a small number of placements, and exit status 1 if the aims are missed.
"""

import argparse
import csv
import json
import math
import os
import statistics as st
import subprocess
import sys

import numpy as np

from skin import Log, PERIOD_S, Skin, footprint, positions_file

CONFIG = """
[store]
path = "none.db"
[[bus]]
name = "skin"
interface = "can0"
[[patch]]
name = "arm"
bus = "skin"
listen_only = true
geometry = "positions.txt"
outputs = ["fill"]
{area}
boards = [{{ address = 13, modules = "0-15" }}, {{ address = 12, modules = "0-6" }}]
gauge = {{ id = 0x3A1, signal = "0|32@1-", unit = "Pa", noise_kpa = 0.02 }}
[patch.session]
branches = "{branches}"
"""
MASSES_KG = (0.2, 0.3, 0.4, 0.6, 0.8, 1.0)
# Standard deviations that the daemon takes for the area and for the gain of the day, shares of the force.
DRAWN = math.hypot(0.05, 0.017)
# What, hysteresis, rest between venting and zero in s, area, contact, branches.
ROWS = [
    ("no hysteresis, creep or drift", "none", 8, "", "mass", "rising"),
    ("the same, both branches", "none", 8, "", "mass", "both"),
    ("play", "play", 8, "", "mass", "rising"),
    ("the same, both branches", "play", 8, "", "mass", "both"),
    ("play, pressed once before", "pressed play", 8, "", "mass", "rising"),
    ("play, rest of 120 s", "play", 120, "", "mass", "rising"),
    ("play, the paper's equal areas without gaps", "play", 8, 'area = "equal"', "mass", "rising"),
    ("loop that closes at rest", "loop", 8, "", "mass", "rising"),
    ("loop that closes at rest, both branches", "loop", 8, "", "mass", "both"),
    ("the same, rest of 120 s", "loop", 120, "", "mass", "rising"),
    ("the same, fingers of 1 to 10 N", "loop", 8, "", "finger", "rising"),
    ("the same, half of a mass taken off", "loop", 8, "", "half", "rising"),
    ("the same, both branches", "loop", 8, "", "half", "both"),
]


def simulate(folder, hysteresis, rest_s, kind, seed, placements):
    """Writes a calibration log, a log of placements and the positions; returns of each when it was laid, from when and to when it is
    read, all in s, and its force in N."""
    rng = np.random.default_rng(seed)
    skin = Skin(rng, hysteresis.removeprefix("pressed "))
    zero = np.zeros(skin.taxels)

    def run(log, seconds, pads_kpa, gauge_kpa=lambda t: 0.0):
        for k in range(round(seconds / PERIOD_S)):
            t = k * PERIOD_S
            log.scan(skin.scan(zero + pads_kpa(t)), gauge_kpa(t) + rng.normal(0, 0.02))

    rise, fall = (lambda t: min(2 * t, 72.0)), (lambda t: max(0.0, 72 - 3 * t))
    if hysteresis.startswith("pressed "):
        for kpa in [rise(k * PERIOD_S) for k in range(740)] + [fall(k * PERIOD_S) for k in range(540)]:
            skin.scan(zero + kpa)
    log = Log(f"{folder}/calibration.log")
    run(log, 4, lambda t: 0.0)
    run(log, 37, rise, rise)
    run(log, 27, fall, fall)
    log.close()
    for _ in range(round(rest_s / PERIOD_S)):
        skin.scan(zero)
    log, truth = Log(f"{folder}/placements.log"), []
    run(log, 4, lambda t: 0.0)
    for i in range(placements):
        newton = math.exp(rng.uniform(0, math.log(10))) if kind == "finger" else MASSES_KG[i % 6] * 9.80665
        pads = skin.pads_kpa(footprint(rng, skin, "finger" if kind == "finger" else "mass", newton))
        laid = log.time
        run(log, 3.0, lambda t: pads * min(t / 0.3, 1))
        if kind == "half":
            run(log, 3.0, lambda t: pads * max(1 - t / 0.3, 0.5))
            newton, pads = newton / 2, pads / 2
        truth.append((laid, log.time - 1.0, log.time - 0.1, newton))
        run(log, 5.0, lambda t: pads * max(1 - t / 0.3, 0))
    log.close()
    with open(f"{folder}/positions.txt", "w", encoding="ascii") as out:
        out.write(positions_file(skin))
    return truth


def weigh(taxeld, folder, area, branches, truth):
    """Truth, force and standard uncertainty of each placement in N (mean of a second), and the forces read at rest."""
    config = f"{folder}/scene.toml"
    with open(config, "w", encoding="ascii") as out:
        out.write(CONFIG.format(area=area, branches=branches))
    replay = lambda log, *more: subprocess.run(
        [taxeld, "replay", f"{folder}/{log}.log", "--config", config, *more], check=True, capture_output=True)
    replay("calibration", "--calibrate", "--out", f"{folder}/models.json")
    replay("placements", "--models", f"{folder}/models.json", "--force", f"{folder}/force.csv")
    with open(f"{folder}/force.csv", encoding="ascii") as table:
        rows = [(float(r["time_s"]), float(r["total_n"]), float(r["sigma_n"]))
                for r in csv.DictReader(table) if r["total_n"]]
    read, scans = [], []
    for _, begin, end, newton in truth:
        inside = [row for row in rows if begin <= row[0] <= end]
        assert inside, f"no force between {begin} and {end} s"
        scans += [(r[1] - newton, r[2], DRAWN * newton) for r in inside]
        read.append((newton, st.mean(r[1] for r in inside), st.mean(r[2] for r in inside)))
    lies = lambda t: any(laid - 0.5 <= t <= end + 1 for laid, _, end, _ in truth)
    return read, scans, [row[1] for row in rows if not lies(row[0])]


def row(args, what, hysteresis, rest_s, area, kind, branches):
    read, scans, at_rest = [], [], []
    for seed in range(args.first_seed, args.first_seed + args.seeds):
        folder = f"{args.scratch}/{hysteresis}-{rest_s}-{kind}-{seed}"
        os.makedirs(folder, exist_ok=True)
        truth_file = f"{folder}/truth.json"
        if not os.path.exists(truth_file):
            with open(truth_file, "w", encoding="ascii") as out:
                json.dump(simulate(folder, hysteresis, rest_s, kind, seed, args.placements), out)
        with open(truth_file, encoding="ascii") as file:
            of_seed = weigh(args.taxeld, folder, area, branches, json.load(file))
        read += of_seed[0]
        scans += of_seed[1]
        at_rest += of_seed[2]
    errors = [(force - newton) / newton for newton, force, _ in read]
    light = [(force - newton) / newton for newton, force, _ in read if kind == "mass" and newton < 2.0]
    within = sum(abs(force - newton) <= 2 * sigma for newton, force, sigma in read) / len(read)
    mean = st.mean(map(abs, errors))
    ratio = math.sqrt(sum(sigma**2 for _, sigma, _ in scans) / sum(error**2 + drawn**2 for error, _, drawn in scans))
    held = st.mean(st.NormalDist(error, drawn).cdf(1.96 * sigma) - st.NormalDist(error, drawn).cdf(-1.96 * sigma)
                   for error, sigma, drawn in scans)
    ghost_n = sorted(at_rest)[int(0.99 * len(at_rest))]
    lightest = f"{100 * st.mean(light):+.0f} %" if light else ""
    print(f"| {what} | {len(read)} | {100 * mean:.1f} % | {100 * st.mean(errors):+.1f} % | {100 * within:.0f} % | "
          f"{ratio:.2f} | {100 * held:.0f} % | {lightest} | {ghost_n:.2f} N |", flush=True)
    return mean, within


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("taxeld")
    parser.add_argument("scratch")
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--placements", type=int, default=24)
    parser.add_argument("--quick", action="store_true")
    args = parser.parse_args()
    if args.quick:
        args.seeds, args.placements = 1, 24
    print("| skin | placements | mean error | bias | within 2 sigma | single scans: sigma / error | within 95 % | "
          "bias at 0.2 kg | read at rest, 99 % below |")
    print("|---|---|---|---|---|---|---|---|---|")
    quick = [what for what in ROWS if what[1:5] in (("play", 8, "", "mass"), ("loop", 8, "", "mass"))]
    of_rows = {what[1:]: row(args, *what) for what in (quick if args.quick else ROWS)}
    if args.quick and any(mean > 0.12 or within < 0.9 for mean, within in of_rows.values()):
        sys.exit("a mean error above 12 %, or fewer than 90 % of the placements within two standard uncertainties")
    for what, (mean, _) in of_rows.items():
        rising = of_rows.get((*what[:-1], "rising"))
        if mean > 1.05 * rising[0]:
            sys.exit(f"{what}: both branches err by {100 * mean:.2f} %, the rising one by {100 * rising[0]:.2f} %")


main()
