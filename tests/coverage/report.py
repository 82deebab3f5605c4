"""Lines that tests come by, by crate, and whether that is as many as was aimed for.

    python tests/coverage/report.py LLVM_COV FOLDER [--lines] [PACKAGE...]

FOLDER has `built.json`, what cargo said of the test binaries, and `all.profdata`. Tests themselves do not count, nor do
examples and build scripts; of a file with tests in it the lines above `#[cfg(test)]` do.
"""

import collections
import json
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Share of the lines: what reads from outside, keeps, serves and lets in, and all else.
AIMS = {"taxel-wire": 0.95, "taxel-store": 0.95, "taxel-rpc": 0.95, "authorisation": 0.95}
AIM = 0.90
AUTHORISATION = "crates/taxel-rpc/src/access/"


def binaries(folder):
    """The test binaries, and what they start."""
    messages = [json.loads(line) for line in (folder / "built.json").read_text().splitlines() if line.startswith("{")]
    return sorted({message["executable"] for message in messages if message.get("executable")})


def is_counted(path):
    name = path.rsplit("/", 1)[-1]
    test = "/tests/" in path or "/examples/" in path or name in ("tests.rs", "build.rs") or name.endswith("_tests.rs")
    return "/src/" in path and not test


def counts_by_file(llvm_cov, folder):
    """How often each line was run, by file of the repository."""
    objects = [argument for binary in binaries(folder) for argument in ("--object", binary)]
    command = [llvm_cov, "export", "--format=lcov", f"--instr-profile={folder / 'all.profdata'}", *objects]
    text = subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout
    files, lines = {}, {}
    for line in text.splitlines():
        if line.startswith("SF:"):
            path = line[3:].removeprefix(f"{ROOT}/")
            lines = files.setdefault(path, {}) if path.startswith("crates/") and is_counted(path) else {}
        elif line.startswith("DA:"):
            number, count = line[3:].split(",")[:2]
            lines[int(number)] = lines.get(int(number), 0) + int(count)
    return {path: without_tests(path, lines) for path, lines in files.items() if lines}


def without_tests(path, lines):
    """The lines above the tests in a file."""
    text = (ROOT / path).read_text().splitlines()
    tests = (number for number, line in enumerate(text, 1) if re.match(r"#\[cfg\((all\()?test\b", line))
    inside = (number for number in tests if number < len(text) and re.match(r"(pub )?mod \w+ \{", text[number]))
    end = next(inside, len(text) + 1)
    return {number: count for number, count in lines.items() if number < end}


def main():
    llvm_cov, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    wanted = [argument for argument in sys.argv[3:] if argument != "--lines"]
    files = counts_by_file(llvm_cov, folder)
    # Of a package whose own tests did not run nothing can be said.
    files = {path: lines for path, lines in files.items() if not wanted or path.split("/")[1] in wanted}
    groups = collections.defaultdict(list)
    for path in files:
        groups[path.split("/")[1]].append(path)
        if path.startswith(AUTHORISATION):
            groups["authorisation"].append(path)
    missed = []
    print("| crate | lines | run | share | aim |\n|---|---:|---:|---:|---:|")
    for name, paths in sorted(groups.items()):
        lines = sum(len(files[path]) for path in paths)
        run = sum(count > 0 for path in paths for count in files[path].values())
        aim = AIMS.get(name, AIM)
        print(f"| {name} | {lines} | {run} | {100 * run / lines:.1f} % | {100 * aim:.0f} % |")
        if run < aim * lines:
            missed.append(name)
    share = lambda path: sum(count > 0 for count in files[path].values()) / max(len(files[path]), 1)
    print("\n| file | lines that nothing runs | share run |\n|---|---:|---:|")
    worst = sorted(files, key=lambda path: -sum(count == 0 for count in files[path].values()))
    for path in worst[:25]:
        unrun = [number for number, count in sorted(files[path].items()) if count == 0]
        print(f"| {path} | {len(unrun)} | {100 * share(path):.0f} % |")
        if "--lines" in sys.argv:
            print("  " + " ".join(map(str, unrun)))
    if missed:
        print(f"\nbelow the aim: {', '.join(missed)}")
        sys.exit(1)


main()
