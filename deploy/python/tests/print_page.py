"""Prints what `taxel.shm` reads of a page, in the form of the tests of taxel-shm."""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))

from taxel.shm import Reader  # noqa: E402

force = Reader(sys.argv[1]).force()
sample = vars(force) if force else force.sample
if sample is None:
    sys.exit(f"status {force.why.value}")


def figures(name, key):
    figure = sample[key] if force else None
    count = 3 if key.endswith(("resultant_n", "moment_nm", "pressure_m")) else 1
    shown = figure if isinstance(figure, tuple) else (figure,) * count
    print(name, *("-" if part is None else f"{part:.3f}" for part in shown))


STATES = ("UNSPECIFIED", "OK", "DEGRADED", "STALE", "TARE_INVALID", "UNCALIBRATED")
print("status", 0 if force else force.why.value)
print("sequence", sample["sequence"], "stamps", sample["monotonic_ns"] or 0, sample["wall_ns"], sample["written_ns"])
flags = ("lower_bound", "simulated")
print("state", STATES.index(sample["state"]), *(f"{flag} {int(sample[flag])}" for flag in flags))
for name, key in (
    ("total", "total_n"),
    ("sigma", "sigma_n"),
    ("floor", "detection_floor_n"),
    ("resultant", "resultant_n"),
    ("moment", "moment_nm"),
    ("centre", "centre_of_pressure_m"),
):
    figures(name, key)
print("taxels", *(sample[key] for key in ("active", "excluded", "stale", "out_of_range", "filled")))
print(f"shares {sample['filled_share']:.3f} {sample['uncovered_share']:.3f}")
print("models", sample["model_set"])
print("reasons", sample["reasons"])
