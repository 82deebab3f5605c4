#!/usr/bin/env python3
"""A certificate of the simulated forearm, recomputed from what is exported by a script that shares no code with taxeld.

    tests/certificate/run.py TAXELD SCRATCH

Takes taxel-lab from the folder of TAXELD. Calibrates over two ramps, up and down, lays masses on, makes the certificate of the
daemon and of exported files, and has recompute.py recompute it. A fit of the exported session is the session's own. Then one coefficient or one sample is another, and the script must say so.
"""

import json
import pathlib
import re
import signal
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).parent
SCRIPT = HERE / "recompute.py"
# Two ramps of 20 kPa at 2 kPa/s, up and down, take 40 s; a busy machine may need several times as long.
PATIENCE_S = 600
LOADS = 3


def run(*words, allowed=(0,)):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=PATIENCE_S)
    if done.returncode not in allowed:
        sys.exit(f"{' '.join(str(word) for word in words)}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done


class Daemon:
    def __init__(self, taxeld, scratch):
        self.taxeld, self.server = taxeld, f"unix:{scratch / 's'}"
        self.config = scratch / "certificate.toml"
        text = (HERE / "certificate.toml").read_text(encoding="utf-8")
        self.config.write_text(text.replace("store.db", str(scratch / "store.db")), encoding="utf-8")
        self.log = open(scratch / "daemon.log", "w", encoding="utf-8")
        self.process = subprocess.Popen([taxeld, "run", "--config", str(self.config)], stderr=self.log, cwd=scratch)
        end = time.monotonic() + PATIENCE_S
        while self.call("models", "list", allowed=(0, 1)).returncode != 0:
            if self.process.poll() is not None or time.monotonic() > end:
                sys.exit(f"the daemon does not answer: {(scratch / 'daemon.log').read_text()}")
            time.sleep(0.2)

    def call(self, *words, allowed=(0,)):
        return run(self.taxeld, *words, "--server", self.server, allowed=allowed)

    def calibrate(self):
        """The daemon answers before its boards are configured."""
        words = ("calibrate", "--both", "--ramps", "2", "--target", "20", "--confirmed-by", "test")
        end = time.monotonic() + PATIENCE_S
        while (done := self.call(*words, allowed=(0, 3))).returncode != 0:
            if "not configured yet" not in done.stderr or time.monotonic() > end:
                sys.exit(f"no calibration: {done.stderr}")
            time.sleep(0.5)
        self.call("models", "use", "newest", "--yes")  # of so low a target it may be not good

    def lay(self, kilogram):
        """The simulated hand lays half a kilogram on for five seconds out of ten: what comes between is refused."""
        end = time.monotonic() + PATIENCE_S
        while (done := self.call("load", kilogram, allowed=(0, 3))).returncode != 0:
            if time.monotonic() > end:
                sys.exit(f"no known load was taken: {done.stderr}")
            if "zero" in done.stderr:  # taken while the bag still let go, and found out
                self.call("tare", allowed=(0, 3))
            time.sleep(0.5)

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        if self.process.wait(timeout=60) != 0:
            sys.exit(f"the daemon ended with {self.process.returncode}")


def judge(files, agrees, *words):
    done = run(sys.executable, SCRIPT, *files, allowed=(0,) if agrees else (1,))
    said = done.stdout + done.stderr
    for word in words:
        if word not in said:
            sys.exit(f"{word} is not in what the script says:\n{said}")
    print(said.strip().splitlines()[-1])


def altered(path, name, change):
    copy = path.with_name(name)
    text = path.read_bytes().decode()
    changed = change(text)
    if changed == text:
        sys.exit(f"{name}: nothing was changed")
    copy.write_bytes(changed.encode())
    return copy


def zeros_for_counts(row):
    return f"\n{row[1]}" + ",0" * (row[2].count(",") + 1) + f"{row[3]}\n"


def main():
    taxeld, scratch = str(pathlib.Path(sys.argv[1]).resolve()), pathlib.Path(sys.argv[2]).resolve()
    lab = pathlib.Path(taxeld).with_name("taxel-lab")
    scratch.mkdir(parents=True, exist_ok=True)
    daemon = Daemon(taxeld, scratch)
    try:
        daemon.calibrate()
        for _ in range(LOADS):
            daemon.lay("0.5")
        names = ("c.json", "c.html", "samples.csv", "models.json")
        page, files = scratch / "c.html", [scratch / name for name in names if name != "c.html"]
        certificate, samples, models = files
        of_daemon = (lab, "certificate", "--stated", HERE / "stated.toml", "--server", daemon.server)
        run(*of_daemon, "--out", certificate, "--out", page)
        first = certificate.read_bytes()
        again = scratch / "again.json"
        run(*of_daemon, "newest", "--out", again)
        if again.read_bytes() != first:
            sys.exit("two certificates of one set differ")
        stated = json.loads(first)
        daemon.call("sessions", "export", stated["session"]["number"], "--out", samples)
        daemon.call("models", "export", "--out", models)
        compared = run(lab, "compare", "active", models, "--server", daemon.server).stdout
        if "median +0.0 %" not in compared:
            sys.exit(f"a set differs from its own export: {compared}")
    finally:
        daemon.stop()
    of_files = scratch / "files.json"
    run(lab, "certificate", "--models", models, "--session", samples, "--stated", HERE / "stated.toml", "--out", of_files)
    measured = ("set", "ramps", "levels", "mean", "budget", "expanded", "excluded", "taxels", "hashes", "simulated", "stated")
    if any(json.loads(of_files.read_text())[key] != stated[key] for key in measured):
        sys.exit("the certificate of the files has other figures than that of the daemon")
    refit = scratch / "refit.json"
    run(lab, "fit", samples, "--plays", "auto", "--out", refit)
    of = lambda path: [(taxel["status"], taxel["curve"]) for taxel in json.loads(path.read_text())["taxels"]]
    if of(refit) != of(models):
        sys.exit("a fit of the exported session differs from the session's own")
    if not stated["simulated"] or "signature" in page.read_text() or not stated["set"]["fitted_by"].startswith("taxeld "):
        sys.exit("a certificate of the simulator does not say so, may be signed, or does not say what fitted the models")
    if len(stated["loads"]) != LOADS or len(stated["ramps"]) != 2 or stated["stated"]["robot"] != "simulated, no. 1":
        sys.exit(f"{stated['loads']}, {stated['ramps']}, {stated['stated']}")
    judge(files, True, "all agree")
    # A coefficient, a count, a zero and a load that are other than those that were measured.
    coefficient = altered(certificate, "coefficient.json", lambda text: re.sub(r'("centre": )(\d+)', r"\g<1>1\2", text, count=1))
    judge([coefficient, samples, models], False, "centre", "rmse_kpa", "number")
    load = altered(certificate, "load.json", lambda text: re.sub(r'("read_n": )(\d)', r"\g<1>1\2", text, count=1))
    judge([load, samples, models], False, "error_percent", "normalised_error")
    count = altered(samples, "count.csv", lambda text: re.sub(r"\n([^\n,]+,[^\n,]+),([^\n]+)(,\d+,)\n", zeros_for_counts, text, count=1))
    judge([certificate, count, models], False, "hashes.samples_csv", "taxels.0.max_error_kpa")
    zero = altered(samples, "zero.csv", lambda text: re.sub(r"\n,([^,]*),2(\d+\.[^\n]*,1,zero)\n", r"\n,\1,1\2\n", text, count=1))
    judge([certificate, zero, models], False, "hashes.samples_csv")
    shot = scratch / "certificate.png"
    run("chromium", "--headless", "--no-sandbox", "--disable-gpu", f"--screenshot={shot}", "--window-size=900,3200", page.as_uri())
    print(f"the page as a picture: {shot}")


if __name__ == "__main__":
    main()
