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
print("state", STATES.index(sample["state"]), "simulated", int(sample["simulated"]))
for name, key in (
    ("total", "total_n"),
    ("sigma", "sigma_n"),
    ("low", "low_n"),
    ("high", "high_n"),
    ("undetected", "undetected_n"),
    ("step", "step_n"),
):
    figures(name, key)
print("epoch", sample["zero_epoch"])
for name, key in (("resultant", "resultant_n"), ("moment", "moment_nm"), ("centre", "centre_of_pressure_m")):
    figures(name, key)
print("taxels", *(sample[key] for key in ("active", "excluded", "stale", "out_of_range")))
print("models", sample["model_set"])
print("reasons", sample["reasons"])
