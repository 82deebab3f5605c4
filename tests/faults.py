#!/usr/bin/env python3
"""Each test that tests/README.md names in its table of faults exists."""

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
print(f"{len(rows)} faults in the table")
sys.exit("\n".join(["no such test:", *missing]) if missing or len(rows) < 50 else 0)
