#!/usr/bin/env python3
"""The Debian package under a real systemd: run as `package.py PACKAGE` by `run`, as root on a machine of its own."""

import gzip
import json
import os
import re
import subprocess
import sys

from machine import CONFIG, ROOT, UNIT, documented, job, journal, run, state, told, until

# What the machine has written to its files, and nothing else of them; see init.sh.
WRITTEN = "/host/mnt/written"
STATE = ["/var/lib/taxeld", "/var/lib/private/taxeld"]
EXAMPLES = "/usr/share/doc/taxeld/examples/"
NETWORK, RULES = "80-can0.network", "70-taxeld-can.rules"
# What the simulated skin of the source `sim` lays down every ten seconds, in newtons.
MASS_N = 0.5 * 9.81


def dpkg(*words):
    # Nothing here outlives the machine, so nothing is flushed.
    return run("dpkg", "--force-unsafe-io", *words, stdin=subprocess.DEVNULL, env={**os.environ, "LC_ALL": "C"})


def enabled():
    return subprocess.run(["systemctl", "is-enabled", UNIT], text=True, capture_output=True, check=False).stdout.strip()


def files_of(package):
    """The files that it brings, as absolute paths."""
    listed = run("dpkg-deb", "--contents", package).splitlines()
    return [line.split(maxsplit=5)[5].removeprefix(".") for line in listed if not line.startswith("d")]


def needs_what_is_there(package):
    """A robot has no network: nothing but the C library and what makes groups."""
    needed = run("dpkg-deb", "--field", package, "Depends").strip()
    assert re.fullmatch(r"libc6 \(>= [0-9.]+\), systemd \| systemd-standalone-sysusers", needed), needed
    told(f"{os.path.basename(package)}, {os.path.getsize(package) // 1000} kB, needs {needed}")


def installs(package):
    dpkg("-i", package)
    for path in files_of(package):
        assert os.path.exists(path), path
    # Nothing is started or enabled, and no network is set up: the example is that of some other robot.
    assert (enabled(), state("ActiveState")) == ("disabled", "inactive"), (enabled(), state("ActiveState"))
    assert run("getent", "group", "skin").startswith("skin:")
    with open("/proc/sys/net/core/rmem_max", encoding="ascii") as granted:
        assert int(granted.read()) == 8388608
    run("taxeld", "check", "--config", CONFIG)
    told("installed: neither enabled nor started, with the group skin and the receive buffer")


def can_be_read():
    """Manual pages, completions, and a unit that systemd finds nothing wrong with."""
    pages = "/usr/share/man/man1/"
    own = sorted(page for page in os.listdir(pages) if re.match(r"taxeld(-|\.)", page))
    for page in own:
        with gzip.open(pages + page, "rt", encoding="utf-8") as text:
            assert ".TH taxeld" in text.read(), page
    assert run("man", "-w", "taxeld-calibrate").strip() == pages + "taxeld-calibrate.1.gz"
    completions = "/usr/share/bash-completion/completions/taxeld"
    assert "_taxeld" in run("bash", "-c", f"source {completions} && complete -p taxeld")
    run("systemd-analyze", "verify", "--man=no", UNIT)
    told(f"{len(own)} manual pages, completions, and a unit without a fault")


def sets_up_the_bus():
    """The examples for udev and networkd, copied as deploy/README.md says, on an interface that comes then."""
    with open(EXAMPLES + RULES, "r+", encoding="utf-8") as rules:
        # Those for names of adapters too, so that udev reads them; they match none here.
        text = rules.read().replace("# ACTION", "ACTION")
        rules.seek(0)
        rules.write(text)
        rules.truncate()
    for line in documented("**The bus.**", "**The receive buffer.**"):
        if NETWORK in line or RULES in line:
            run("sh", "-c", line.replace("deploy/", EXAMPLES))
    if subprocess.run(["udevadm", "verify", "--help"], capture_output=True, check=False).returncode == 0:
        run("udevadm", "verify", f"/etc/udev/rules.d/{RULES}")
    else:
        told("SKIPPED: `udevadm verify` is there from systemd 254 on")
    run("ip", "link", "add", "dev", "can0", "type", "vcan")

    def up():
        """The link, once networkd has brought it up."""
        link = json.loads(run("ip", "-json", "link", "show", "can0"))[0]
        return link if "UP" in link["flags"] else None

    link = until("can0 is up", up)
    assert link["txqlen"] == 128, link
    with open(f"/run/systemd/netif/links/{link['ifindex']}", encoding="ascii") as says:
        assert f"NETWORK_FILE=/etc/systemd/network/{NETWORK}\n" in says.read()
    # What they do not know they name by file and line. A virtual bus has no bit rate to set.
    complaint = re.search(rf".*({NETWORK}|{RULES}):\d+.*", journal("systemd-networkd") + journal("systemd-udevd"))
    assert not complaint, complaint.group(0)
    told("can0, which was added down, is up by networkd, with udev's transmit queue, and neither finds a fault")


def simulated():
    """The simulated skin in the place of the example's bus and its boards."""
    with open(CONFIG, encoding="utf-8") as config:
        text = config.read()
    for there, instead in [
        (r'source = "socketcan"', 'source = "sim"'),
        (r'interface = "can0"\n', ""),
        (r'modules = "1, 5, 8-10, 12-13"', 'modules = "0-6"'),
        # This machine is slow, and may stand still for a moment, which is no silence of boards.
        (r"period_ms = 50 ", "period_ms = 100 "),
        (r"stale_periods = 3 ", "stale_periods = 10 "),
    ]:
        text, found = re.subn(there, instead, text)
        assert found == 1, (there, found)
    with open(CONFIG, "w", encoding="utf-8") as config:
        config.write(text)
    return text


def answer(*command):
    return subprocess.run(["taxeld", *command], text=True, capture_output=True, check=False)


def feels_the_mass():
    """Waits until it does. Returns the model set by which it does, and what it feels in words."""
    answers = ["not asked"]

    def sample():
        answers[:] = [answer("watch", "--once", "--json")]
        force = json.loads(answers[0].stdout or "{}") if answers[0].returncode == 0 else {}
        if not force or any("when the zero was taken" in reason for reason in force["reasons"]):
            # The skin had not recovered from the bag, or this machine stood still: another zero, as the daemon says.
            answers.append(answer("tare"))
            # A new process has new simulated boards, with zeros of their own. If the mass was lifted just when that was found, the
            # daemon wants somebody's word; one that was wrong shows when the mass leaves.
            if "--confirmed-by" in answers[-1].stderr and "new zero" in answers[-1].stderr:
                answers.append(answer("tare", "--confirmed-by", "test"))
        total, sigma = force.get("totalN", 0.0), force.get("totalSigmaN", 0.0)
        return force if total > MASS_N / 2 and abs(total - MASS_N) < 3 * sigma < MASS_N else None

    force = until("half a kilogram is felt", sample, lambda: answers)
    said = f"{force['totalN']:.2f} N +- {2 * force['totalSigmaN']:.2f} (k = 2) of {MASS_N:.2f} N"
    return force["modelSet"], said


def calibrates():
    run("systemctl", "enable", "--now", UNIT)
    assert (enabled(), state("ActiveState")) == ("enabled", "active"), journal()
    assert os.readlink(f"/proc/{state('MainPID')}/exe") == "/usr/bin/taxeld"
    told(f"started: {state('StatusText')!r}")
    run("taxeld", "calibrate", "--target", "10", "--confirmed-by", "test")
    run("taxeld", "models", "use", "newest", "--yes")  # of so low a target it may be not good
    # Refused while the mass lies there.
    until("a zero", lambda: answer("tare").returncode == 0)
    models, said = feels_the_mass()
    told(f"calibrated: {said}")
    return models


def upgrades(package, text, models):
    before = state("MainPID")
    dpkg("-i", package)
    until("the daemon runs", lambda: state("ActiveState") == "active")
    assert state("MainPID") != before and enabled() == "enabled", "an upgrade starts the new programme"
    with open(CONFIG, encoding="utf-8") as config:
        assert config.read() == text
    models_now, said = feels_the_mass()
    assert models_now == models, (models, models_now)
    told(f"upgraded: another process, the same configuration and models: {said}")


def removes(files, text):
    """What was installed goes; what the operator made of it stays for the next installation."""
    dpkg("--remove", "taxeld")
    assert state("ActiveState") == "inactive", journal()
    assert [path for path in files if os.path.exists(path)] == [CONFIG]
    with open(CONFIG, encoding="utf-8") as config:
        assert config.read() == text
    assert os.path.exists(STATE[1] + "/taxeld.db")
    told("removed: stopped, and only the configuration and the store are left")


def purges(files):
    dpkg("--purge", "taxeld")
    left = [path for path in [*files, *STATE, "/etc/taxeld"] if os.path.lexists(path)]
    for top in ("etc", "usr", "var"):
        for folder, folders, names in os.walk(f"{WRITTEN}/{top}"):
            # What was deleted is there as a mark of that, which the machine does not see.
            here = [os.path.join(folder, name).removeprefix(WRITTEN) for name in folders + names if "taxel" in name]
            left += [path for path in here if os.path.lexists(path) and not path.startswith(ROOT)]
    assert set(left) == {f"/etc/udev/rules.d/{RULES}"}, left
    assert state("LoadState") == "not-found", state("LoadState")
    told("purged: nothing is left but the rule that was copied by hand")


def main():
    package = sys.argv[1]
    needs_what_is_there(package)
    installs(package)
    can_be_read()
    sets_up_the_bus()
    text = simulated()
    models = calibrates()
    upgrades(package, text, models)
    files = files_of(package)
    removes(files, text)
    purges(files)


job(main)
