"""Tries the changes of cargo-mutants on files of one crate: which does no test notice?

    python tests/mutants/run.py SCRATCH crates/taxel-engine/src/zero ... [--seconds 60]

The changes are those of `cargo mutants --list`. All are built into one copy of the crate (switch.py), so a change costs
no build. Each test runs once to say which places it comes by; then each change is tried with the tests that come by its
place, quick ones first, until one fails or the seconds are used up. Times are processor time, so other work on the
machine changes nothing. What is left over is printed, and all of it is in SCRATCH/results.json.
"""

import argparse
import collections
import json
import os
import pathlib
import re
import resource
import shutil
import subprocess
import sys

from switch import RUNTIME, Change, with_switches

ROOT = pathlib.Path(__file__).resolve().parents[2]
# The tests of a crate that its changes are tried with.
BINARIES = {
    "taxel-engine": ["--lib", "--test", "scenarios", "--test", "sessions", "--test", "lies"],
    "taxel-rpc": ["--lib", "--test", "service"],
    "taxel-store": ["--lib"],
}
# Stories of lies: so many minutes from each of these seeds on.
LIES_MINUTES, LIES_FIRST_SEEDS = 40, [1, 1001, 2001, 3001]
ENVIRONMENT = dict(os.environ, PROPTEST_CASES="100", PROPTEST_RNG_SEED="1")
# A test that takes so many times its time, and ten seconds more, never ends.
PATIENCE = 10
# A test may wait for what never comes, which takes no processor time. So many times the limit on that is longer than any
# test waits beside other work.
WAITING = 6


class Test:
    """A test of a binary: how to run it, how long it takes, and which places it comes by."""

    def __init__(self, binary, name, arguments=(), environment=None):
        self.binary, self.name = binary, name
        self.arguments = ["--exact", *arguments]
        self.environment = environment or {}
        self.seconds, self.reached = 60.0, set()

    def run(self, **environment):
        """How it ends (passed, failed, endless), and its processor time."""
        limit = int(PATIENCE * self.seconds) + 10
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        try:
            done = subprocess.run(
                [self.binary, self.name.split(" ")[0], *self.arguments],
                env=ENVIRONMENT | self.environment | environment,
                cwd=os.path.dirname(self.binary),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit)),
                timeout=WAITING * limit,
            )
            how = "passed" if done.returncode == 0 else "endless" if done.returncode in (-24, -9) else "failed"
        except subprocess.TimeoutExpired:
            how = "endless"
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return how, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def crate_of(files):
    """The crate that all of these files are of."""
    crates = {pathlib.Path(file).parts[1] for file in files}
    if len(crates) != 1 or not crates <= set(BINARIES):
        sys.exit(f"files of one of these crates, expected: {', '.join(BINARIES)}; given are files of {', '.join(crates)}")
    return crates.pop()


def listed(crate, files):
    """The changes that cargo-mutants would make."""
    chosen = [a for file in files for a in ("-f", file + "/**" if (ROOT / file).is_dir() else file)]
    command = ["cargo", "mutants", "--list", "--json", "--no-config", "-p", crate, *chosen]
    text = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    return [Change(number, entry) for number, entry in enumerate(json.loads(text), 1)]


def build(copy, crate, changes):
    """Binaries with the changes in them; the changes that do not compile, and those that cannot be switched."""
    by_file = collections.defaultdict(list)
    for change in changes:
        by_file[change.file].append(change)
    bad = set()
    while True:
        copied(copy, crate)
        left = []
        for file, of_file in by_file.items():
            path = copy / file
            text, without = with_switches(path.read_text(), [c for c in of_file if c.number not in bad])
            path.write_text(text)
            left += without
        sites = str(len(changes) + 1)
        source = copy / "crates" / crate / "src"
        (source / "mutant.rs").write_text(RUNTIME.replace("SITES", sites))
        with open(source / "lib.rs", "a") as lib:
            lib.write("\n#[doc(hidden)]\npub mod mutant;\n")
        binaries, found = compiled(copy, crate, {c.number for c in changes if "match arm" in c.name} - bad)
        if found is None:
            return binaries, bad, {c.number for c in left}
        if not found - bad:
            sys.exit("the changed crate does not compile, and no change is to blame")
        bad |= found
        print(f"{len(found)} changes do not compile", flush=True)


def copied(copy, crate):
    """A fresh copy of the sources; what did not change keeps its time, so that cargo leaves it alone."""
    shutil.rmtree(copy / "crates" / crate, ignore_errors=True)
    command = ["git", "ls-files", "-co", "--exclude-standard"]
    files = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    for file in files.splitlines():
        if (ROOT / file).is_file():
            (copy / file).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / file, copy / file)


def compiled(copy, crate, arms):
    """The test binaries, or the numbers of the changes that do not compile; `arms` are those that take an arm out of a match."""
    command = ["cargo", "test", "--no-run", "--message-format", "json", "-p", crate, *BINARIES[crate]]
    done = subprocess.run(command, cwd=copy, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    binaries, bad, failed = [], set(), False
    for line in done.stdout.splitlines():
        message = json.loads(line)
        if message["reason"] == "compiler-artifact" and message.get("executable"):
            binaries.append((message["target"]["name"], message["executable"]))
        if message["reason"] == "compiler-message" and message["message"]["level"] == "error":
            failed = True
            rendered = message["message"]["rendered"]
            for span in message["message"]["spans"]:
                # What a macro of the standard library wrote is where it was called.
                while not (copy / span["file_name"]).is_file() and span["expansion"]:
                    span = span["expansion"]["span"]
                if not (copy / span["file_name"]).is_file():
                    continue
                lines = (copy / span["file_name"]).read_text().split("\n")
                at = "\n".join(lines[span["line_start"] - 1 : span["line_end"]])
                bad |= {int(number) for number in re.findall(r"/\*m(\d+)\*/", at)}
            if not bad and (message["message"]["code"] or {}).get("code") == "E0004":
                bad |= arms_of_match(copy, message["message"]) & arms
            if not bad:
                print(rendered)
    if done.returncode and not failed:
        sys.exit(done.stderr)
    return binaries, bad if failed else None


def arms_of_match(copy, message):
    """Changes between a match that does not cover all cases and where the compiler would have the missing arm."""
    [place] = [span for span in message["spans"] if span["is_primary"]]
    hints = [span for child in message["children"] for span in child["spans"] if span["file_name"] == place["file_name"]]
    last = max((span["line_end"] for span in hints if span["line_start"] >= place["line_start"]), default=place["line_end"])
    lines = (copy / place["file_name"]).read_text().split("\n")
    between = "\n".join(lines[place["line_start"] - 1 : last])
    return {int(number) for number in re.findall(r"/\*m(\d+)\*/", between)}


def tests_of(binaries, scratch):
    """All tests that pass without a change, with their times and the places that they come by."""
    tests = []
    for target, binary in binaries:
        if target == "lies":
            for seed in LIES_FIRST_SEEDS:
                environment = {"LIES_MINUTES": str(LIES_MINUTES), "LIES_SEED": str(seed)}
                name = f"a_long_run_holds_no_lie_but_argued_ones from {seed}"
                tests.append(Test(binary, name, ["--ignored"], environment))
            continue
        out = subprocess.run([binary, "--list"], stdout=subprocess.PIPE, text=True).stdout
        tests += [Test(binary, line.removesuffix(": test")) for line in out.splitlines() if line.endswith(": test")]
    passed = []
    for test in tests:
        reached = scratch / "reached"
        reached.unlink(missing_ok=True)
        how, test.seconds = test.run(MUTANTS_REACHED=str(reached))
        if how != "passed":
            print(f"{test.name}: {how} without a change, left out")
            continue
        test.reached = {int(line) for line in reached.read_text().split()} if reached.exists() else set()
        if test.reached:
            passed.append(test)
    return passed


def tried(change, site, tests, kills, seconds):
    """What became of a change: how the first test that noticed it ended, and which; how many have not tried it."""
    able = [test for test in tests if site in test.reached]
    # What comes by few places is about this one; what has noticed many of the changes so far, for its time, comes first, too.
    able.sort(key=lambda test: (test.seconds + 0.004) * (30 + len(test.reached)) / (1 + kills[test.name]))
    spent = 0.0
    for i, test in enumerate(able):
        if spent > seconds:
            return {"how": "survives", "tests": i, "untried": len(able) - i}
        how, took = test.run(MUTANT=str(change.number))
        spent += took
        if how != "passed":
            kills[test.name] += 1
            return {"how": how, "by": test.name, "tests": i + 1}
    return {"how": "survives" if able else "not reached", "tests": len(able), "untried": 0}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scratch", type=pathlib.Path)
    parser.add_argument("files", nargs="+")
    parser.add_argument("--seconds", type=float, default=60.0, help="processor time for a change")
    parser.add_argument("--again", action="store_true", help="leave out what SCRATCH/results.json says was noticed")
    options = parser.parse_args()
    options.scratch = options.scratch.resolve()  # tests run elsewhere
    options.scratch.mkdir(parents=True, exist_ok=True)
    copy = options.scratch / "copy"
    crate = crate_of(options.files)
    changes = listed(crate, options.files)
    binaries, bad, left = build(copy, crate, changes)
    print(f"{len(changes)} changes, {len(bad)} do not compile, {len(left)} cannot be switched", flush=True)
    sites = places(copy, changes)
    tests = tests_of(binaries, options.scratch)
    print(f"{len(tests)} tests, {sum(test.seconds for test in tests):.0f} s", flush=True)
    path = options.scratch / "results.json"
    known = json.loads(path.read_text()) if path.exists() else {}
    kills = collections.Counter(entry["by"] for entry in known.values() if "by" in entry)
    for change in changes:
        before = known.get(change.name)
        if options.again and before and before["how"] in ("failed", "endless"):
            continue
        if change.number in bad:
            known[change.name] = {"how": "does not compile"}
        elif change.number in left:
            known[change.name] = {"how": "cannot be switched"}
        else:
            known[change.name] = tried(change, sites[change.number], tests, kills, options.seconds)
        if known[change.name]["how"] in ("survives", "not reached", "cannot be switched"):
            print(f"{known[change.name]} {change.name}", flush=True)
        path.write_text(json.dumps(known, indent=1))
    for how, count in collections.Counter(known[change.name]["how"] for change in changes).items():
        print(f"{count} {how}")
    survivors = collections.Counter(
        change.plain for change in changes if known[change.name]["how"] in ("survives", "not reached")
    )
    allowed = allowances()
    for plain in sorted(survivors):
        if survivors[plain] > allowed[plain]:
            print(f"{survivors[plain]} survive, {allowed[plain]} are allowed: {plain}")
    tried_files = {change.file for change in changes}
    for plain in sorted(allowed):
        if plain.split(":")[0] in tried_files and survivors[plain] < allowed[plain]:
            print(f"{survivors[plain]} survive, {allowed[plain]} are allowed, which is too many: {plain}")
    sys.exit(any(survivors[plain] > allowed[plain] for plain in survivors))


def allowances():
    """How many of each change may survive, from allowed.txt: a number and what cargo-mutants calls it, without lines."""
    lines = (pathlib.Path(__file__).parent / "allowed.txt").read_text().splitlines()
    entries = (line.split(" ", 1) for line in lines if line and not line.startswith("#"))
    return collections.Counter({plain: int(number) for number, plain in entries})


def places(copy, changes):
    """The place of each change, as its switch has it."""
    sites, site = {}, None
    for file in {change.file for change in changes}:
        for found in re.finditer(r"crate::mutant::at\((\d+)\)|/\*m(\d+)\*/", (copy / file).read_text()):
            if found.group(1):
                site = int(found.group(1))
            else:
                sites[int(found.group(2))] = site
    return sites


if __name__ == "__main__":
    main()
