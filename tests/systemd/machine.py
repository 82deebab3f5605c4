"""What the jobs of `run` share: the machine's service manager, and the unit that they are about."""

import json
import os
import subprocess
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
UNIT = "taxeld.service"
CONFIG = "/etc/taxeld/taxeld.toml"
# What an installation makes: the machine is one where taxeld never was.
PLACES = ["/etc/taxeld", "/var/lib/taxeld", "/var/lib/private/taxeld", "/usr/bin/taxeld", "/usr/local/bin/taxeld"]
# Nothing that is waited for takes longer, on the slowest machine.
PATIENCE_S = 120


def run(*command, **more):
    return subprocess.run(command, check=True, text=True, capture_output=True, **more).stdout


def told(what):
    print(f"{time.monotonic():6.1f} s  {what}", flush=True)


def state(name):
    return run("systemctl", "show", "--value", "-p", name, UNIT).strip()


def journal(unit=UNIT):
    return run("journalctl", "--no-pager", "-o", "cat", "-u", unit)


def until(what, holds, why=lambda: ""):
    """What `holds` gives, as soon as it gives something; `why` says why it did not."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        found = holds()
        if found:
            return found
        time.sleep(0.05)
    raise AssertionError(f"not within {PATIENCE_S} s: {what} {why()}")


def documented(begin, end):
    """The commands between two words of deploy/README.md."""
    with open(os.path.join(ROOT, "deploy", "README.md"), encoding="utf-8") as readme:
        block = readme.read().split(begin)[1].split(end)[0]
    return [line.strip() for line in block.splitlines() if line.startswith("    ")]


def serves():
    """Whether a client gets a sample now, and which."""
    got = subprocess.run(["taxeld", "watch", "--json", "--count", "1"], text=True, capture_output=True, check=False)
    return json.loads(got.stdout) if got.stdout else None


def job(main):
    """Runs it; where it fails the journal says what the machine saw of it."""
    try:
        lies_about = [place for place in PLACES if os.path.lexists(place)]
        assert not lies_about, f"the host's own: {lies_about}"
        told(f"systemd {run('systemctl', '--version').split()[1]} runs")
        main()
        told("all of it")
    except BaseException as error:
        for said in (getattr(error, "stdout", None), getattr(error, "stderr", None)):
            print(said or "", flush=True)
        print(run("journalctl", "--no-pager", "-n", "150"), flush=True)
        raise
