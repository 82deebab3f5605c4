#!/usr/bin/env python3
"""Each test exists that tests/README.md names in its table of faults, and crates/README.md in that of invariants."""

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
text = (ROOT / "tests" / "README.md").read_text(encoding="utf-8")
table = text.split("\n## Faults\n")[1].split("\n## ")[0]
rows = [line for line in table.splitlines() if line.startswith("| ") and not line.startswith("| fault |")]
sources = (path.read_text(encoding="utf-8") for path in (ROOT / "crates").rglob("*.rs"))
tests = {name for source in sources for name in re.findall(r"\bfn (\w+)\(", source)}
missing = []
for row in rows:
    named = re.findall(r"`([^`]+)`", row.split("|")[-2])
    found = [name in tests or (ROOT / name).is_file() for name in named]
    if not named or not all(found):
        missing.append(f"{row.split('|')[1].strip()}: {[name for name, there in zip(named, found) if not there]}")
invariants = (ROOT / "crates" / "README.md").read_text(encoding="utf-8").split("\n| invariant | held by |\n")[1].split("\n\n")[0]
held_by = re.findall(r"`(\w+)` \(", invariants)
missing += [f"invariant: {name}" for name in held_by if name not in tests]
print(f"{len(rows)} faults in the table, {len(held_by)} tests of invariants")
sys.exit("\n".join(["no such test:", *missing]) if missing or min(len(rows), len(held_by)) < 50 else 0)
