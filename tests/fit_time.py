"""How long `taxel-lab fit` takes as a process, beside a loop of numpy.polyfit over counts that are in memory already.

    python tests/fit_time.py TAXEL_LAB [ROUNDS]

230 taxels, 6,000 scans of one ramp to 70 kPa with a count of noise, in turns; medians of wall-clock time and of processor time.
"""

import os
import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile
import time

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # a loop of small fits, as one would write it
import numpy  # noqa: E402

TAXELS, SCANS, ORDER, SEED = 230, 6_000, 5, 1


def recording():
    """Pressure, and counts by taxel."""
    random = numpy.random.default_rng(SEED)
    kpa = numpy.linspace(0.0, 70.0, SCANS)
    gain, rest = random.uniform(0.8, 1.4, TAXELS), random.uniform(232.0, 248.0, TAXELS)
    fall = 150.0 * (1.0 - numpy.exp(-kpa / 60.0))
    counts = rest - numpy.outer(fall, gain) + random.normal(0.0, 0.6, (SCANS, TAXELS))
    return kpa, numpy.clip(numpy.round(counts), 0, 255)


def write(path, kpa, counts):
    with open(path, "w", encoding="ascii") as file:
        file.write(",".join(["t_s", "pressure_kpa", *(f"c{taxel}" for taxel in range(TAXELS))]) + "\n")
        for scan, row in enumerate(counts):
            file.write(f"{0.02 * scan:.3f},{kpa[scan]:.4f}," + ",".join(f"{count:.0f}" for count in row) + "\n")


def timed(work, whose):
    """Wall-clock and processor time, in ms."""
    used = lambda: sum(resource.getrusage(whose)[:2])
    begun, before = time.perf_counter(), used()
    work()
    return 1e3 * (time.perf_counter() - begun), 1e3 * (used() - before)


def main():
    lab, rounds = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 11
    kpa, counts = recording()
    columns = [numpy.ascontiguousarray(column) for column in counts.T]
    with tempfile.TemporaryDirectory() as folder:
        data, models = pathlib.Path(folder, "data.csv"), pathlib.Path(folder, "models.json")
        write(data, kpa, counts)
        fit = [lab, "fit", data, "--patch", "left_forearm", "--out", models]
        process = lambda: subprocess.run(fit, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        loop = lambda: [numpy.polyfit(column, kpa, ORDER) for column in columns]
        ours, theirs = [], []
        for _ in range(rounds):
            ours.append(timed(process, resource.RUSAGE_CHILDREN))
            theirs.append(timed(loop, resource.RUSAGE_SELF))
        size = os.path.getsize(data) / 1e6
    for name, times in [(f"taxel-lab fit, from {size:.1f} MB of CSV to MODELS.json", ours), ("numpy.polyfit in a loop", theirs)]:
        wall, processor = (statistics.median(column) for column in zip(*times))
        print(f"{name}: {wall:.0f} ms, {processor:.0f} ms of processor time")
    ratio = statistics.median(our[0] / their[0] for our, their in zip(ours, theirs))
    print(f"ratio of the wall-clock times: {ratio:.2f}")


if __name__ == "__main__":
    main()
