"""Judges each case of taxel-proto's judge.csv by `taxel.force.judge`: judge.py FILE."""

import csv
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))

from taxel.force import judge  # noqa: E402

cases = list(csv.DictReader(open(sys.argv[1])))
for case in cases:
    names = ("total_n", "age_s", "waited_s", "max_age_s", "own_s")
    why = judge(case["state"], *(float(case[name]) if case[name] else None for name in names))
    assert (why.name if why else "FORCE") == case["verdict"], (case, why)
print(len(cases), "cases")
