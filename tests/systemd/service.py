#!/usr/bin/env python3
"""The service under a real systemd: run as `service.py TAXELD` by `run`, as root on a machine of its own."""

import json
import os
import re
import shutil
import subprocess
import sys
import time

from machine import CONFIG, ROOT, UNIT, documented, job, journal, run, serves, state, told, until

sys.path.insert(0, os.path.join(ROOT, "tests", "e2e"))
from logs import synthetic  # noqa: E402

STORE = "/var/lib/private/taxeld/taxeld.db"


def install(taxeld):
    """Word for word what deploy/README.md says, but for the build. Returns the start, which waits for the bus."""
    lines = documented("**As a service.**", "[deploy/taxeld.service]")
    assert lines[0].startswith("cargo build"), lines
    start = next(number for number, line in enumerate(lines) if line.startswith("systemctl"))
    for line in lines[1:start]:
        subprocess.run(line.replace("target/release/taxeld", taxeld), shell=True, check=True, cwd=ROOT)
        told(f"installed: {line}")
    return subprocess.Popen(lines[start], shell=True, cwd=ROOT)


def does_what_the_readme_says(taxeld):
    """README's lines for a robot as they stand, in a folder that is gone before the configuration is read again. What needs a
    bus is left out: can0 is not there yet."""
    with open(os.path.join(ROOT, "README.md"), encoding="utf-8") as readme:
        block = readme.read().split("## On a robot")[1].split("```")[0].split("\nLook at")[0]
    text = "\n".join(line[4:] for line in block.splitlines() if line.startswith("    ")).replace("\\\n", " ")
    folder, path = "/run/lab/from-the-robot", {"PATH": os.path.dirname(taxeld) + ":" + os.environ["PATH"]}
    os.makedirs(folder)
    with open(f"{folder}/left_forearm_V2.txt", "w", encoding="ascii") as positions:
        rows = [f"{0.018 * (row // 12)} {0.005 * (row % 12) + 0.001} 0.02 0 0 1\n" for row in range(384)]
        positions.write("name l_forearm\n[calibration]\n" + "".join(rows))
    before, check = text.split("taxeld check")
    for line in before.splitlines():
        if not line.startswith(("ip link", "taxeld scan")):
            subprocess.run(line, shell=True, check=True, cwd=folder, env={**os.environ, **path})
            told(f"README: {line.split(' #')[0]}")
    assert check.lstrip().startswith("&& taxeld run"), check
    shutil.rmtree(folder)
    assert "left_forearm" in run(taxeld, "check", cwd="/")
    told("README: the configuration stands by itself")
    shutil.rmtree("/etc/taxeld")


class Watching:
    """A client's stream, one JSON object a sample, in a file."""

    def __init__(self, path):
        self.path = path
        with open(path, "wb") as out:
            self.process = subprocess.Popen(["taxeld", "watch", "--json"], stdout=out, stderr=subprocess.DEVNULL)

    def samples(self):
        with open(self.path, encoding="utf-8") as lines:
            return [json.loads(line) for line in lines if line.endswith("\n")]

    def more(self, number):
        """Waits for so many more samples than there are now."""
        there = len(self.samples())
        until(f"{number} more samples", lambda: len(self.samples()) >= there + number)


def starts_when_its_bus_is_there(start):
    until("the start waits", lambda: "taxeld.service" in run("systemctl", "list-jobs", "--no-legend"))
    assert state("ActiveState") == "inactive", state("ActiveState")
    told("without can0 the start waits")
    run("ip", "link", "add", "dev", "can0", "type", "vcan")
    run("ip", "link", "set", "can0", "up")
    until("`systemctl enable --now` returns", lambda: start.poll() is not None)
    assert start.returncode == 0, journal()
    # Type=notify: now that it has returned the daemon serves, at once.
    assert state("ActiveState") == "active" and state("StatusText") == "serving 1 patch", journal()
    assert serves(), "the daemon said that it serves"
    told(f"with can0 it is active: {state('StatusText')!r}")


def has_no_privilege():
    with open(f"/proc/{state('MainPID')}/status", encoding="ascii") as lines:
        status = dict(line.rstrip("\n").split(":\t", 1) for line in lines if ":\t" in line)
    assert "0" not in status["Uid"].split(), status["Uid"]
    assert int(status["CapEff"], 16) == 0 and int(status["CapBnd"], 16) == 0, status
    assert status["NoNewPrivs"] == "1" and status["Seccomp"] == "2", status
    told(f"account {status['Uid'].split()[0]}, no capability, no way to one, system calls filtered")


def lets_in_whom_the_example_says():
    """By taxeld.toml of deploy/: root is an admin over the socket, whoever comes over loopback an observer."""
    nobody = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
    tare = ["taxeld", "tare", "--server"]
    refused = subprocess.run([*nobody, *tare, "127.0.0.1:50051"], text=True, capture_output=True, check=False)
    assert refused.returncode != 0 and "operator" in refused.stderr, refused
    kept_out = subprocess.run([*nobody, *tare, "unix:/run/taxeld/taxeld.sock"], text=True, capture_output=True, check=False)
    assert kept_out.returncode != 0, kept_out
    assert "ermission denied" in kept_out.stderr, kept_out
    entries = run("taxeld", "audit", "--server", "unix:/run/taxeld/taxeld.sock")
    assert "Tare" not in entries, entries
    told(f"nobody over loopback: {refused.stderr.strip().splitlines()[0]}")


def comes_back(what, signal, restarts, reason):
    """Sends a signal, waits for another process that serves, and finds the reason in the journal."""
    before, begun = state("MainPID"), time.monotonic()
    run("kill", signal, before)
    until(f"{what}: another process", lambda: int(state("NRestarts")) == restarts and state("ActiveState") == "active")
    seconds = time.monotonic() - begun
    assert state("MainPID") not in ("0", before), state("MainPID")
    assert serves(), what
    said = re.search(reason, journal())
    assert said, journal()
    told(f"{what}: serves again after {seconds:.1f} s; the journal: {said.group(0)!r}")


def reloads_without_a_gap(watching):
    before = state("MainPID")
    watching.more(20)
    with open(CONFIG, encoding="utf-8") as config:
        text = config.read()
    with open(CONFIG, "w", encoding="utf-8") as config:
        config.write(text.replace("\n[access]\n", '\n[access]\nobservers = ["unix", "loopback"]\n', 1))
    run("systemctl", "reload", UNIT)
    until("the rules are reloaded", lambda: "taxeld::reload: reloaded" in journal())
    watching.more(20)
    assert state("MainPID") == before and state("ActiveState") == "active"
    samples = watching.samples()
    numbers = [(int(sample["sequence"]), int(sample.get("skipped", 0))) for sample in samples]
    for (last, _), (number, skipped) in zip(numbers, numbers[1:]):
        # A sample that has become too old is sent once more, without its figures, to say so.
        assert number in (last, last + 1 + skipped), f"after sample {last} came {number}, {skipped} skipped"
    told(f"reload: one stream over it, {len(samples)} samples, none missing that is not told")


def stops_cleanly(watching):
    run("systemctl", "stop", UNIT)
    assert state("ActiveState") == "inactive" and state("Result") == "success", journal()
    until("the stream ends", lambda: watching.process.poll() is not None)
    for end, there in [("", True), ("-wal", False), ("-open", False)]:
        assert os.path.exists(STORE + end) == there, STORE + end
    assert "taxeld stops" in journal()
    checked = run("taxeld", "check", "--store", STORE)
    told(f"stopped: the store is closed; {checked.strip().splitlines()[0]}")


def a_configuration_that_cannot_be_used_is_told():
    """It does not start, says why, and is not tried for ever."""
    with open(CONFIG, "a", encoding="utf-8") as config:
        config.write("\n[sevrice]\n")
    started = subprocess.run(["systemctl", "start", UNIT], text=True, capture_output=True, check=False)
    assert started.returncode != 0
    until("systemd gives up", lambda: state("ActiveState") == "failed")
    said = re.search(r".*sevrice.*", journal())
    assert said, journal()
    told(f"a wrong configuration: {state('Result')}; the journal: {said.group(0).strip()!r}")


def main():
    taxeld = sys.argv[1]
    os.makedirs("/run/lab", exist_ok=True)
    log = synthetic("/run/lab/rest.log", 16, 5, lambda taxel, t: 0.0, lambda t: 0.0, noise=1)
    does_what_the_readme_says(taxeld)
    start = install(taxeld)
    starts_when_its_bus_is_there(start)
    has_no_privilege()
    lets_in_whom_the_example_says()
    boards = os.path.join(ROOT, "tests", "e2e", "boards.py")
    with subprocess.Popen([sys.executable, boards, "can0", log], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL) as bus:
        comes_back("frozen", "-STOP", 1, r".*Watchdog timeout.*")
        comes_back("killed", "-KILL", 2, r".*Main process exited, code=killed, status=9/KILL.*")
        watching = Watching("/run/lab/samples")
        reloads_without_a_gap(watching)
        stops_cleanly(watching)
        bus.kill()
    a_configuration_that_cannot_be_used_is_told()


job(main)
