#!/usr/bin/env python3
"""Where two builds differ on the same stories: tests/lies.py BEFORE.csv AFTER.csv [ROWS]

Each file is written by one build:
LIES_OUT=FILE LIES_STORIES=500 cargo test --release -p taxel-engine --test lies -- --ignored a_line
"""
import csv
import sys


def read(path):
    with open(path, newline="") as file:
        return {row.pop("seed"): {name: float(cell) for name, cell in row.items()} for row in csv.DictReader(file)}


def main(before, after, rows=15):
    before, after = read(before), read(after)
    seeds = [seed for seed in before if seed in after]
    names = list(before[seeds[0]])
    print(f"{len(seeds)} stories in both\n\n| number | before | after | better | worse |\n|---|---:|---:|---:|---:|")
    for name in names:
        pairs = [(before[seed][name], after[seed][name]) for seed in seeds]
        up = -1 if name in ("with_force", "ok") else 1
        moved = [up * (a - b) for b, a in pairs if abs(a - b) > 1e-3]
        means = [sum(column) / len(seeds) for column in zip(*pairs)]
        print(f"| {name} | {means[0]:.4f} | {means[1]:.4f} | {sum(m < 0 for m in moved)} | {sum(m > 0 for m in moved)} |")
    for name in ("lies", "score_n", "with_force"):
        by = sorted(seeds, key=lambda seed: -abs(after[seed][name] - before[seed][name]))[: int(rows)]
        print(f"\n{name} differs most:")
        for seed in (seed for seed in by if before[seed][name] != after[seed][name]):
            print(f"  LIES_SEED={seed}: {before[seed][name]:.4f} -> {after[seed][name]:.4f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
