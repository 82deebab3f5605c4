"""The demo's simulated skin with its pump, and a calibration by a drive: what the tests of a rig share."""

import json
import os
import re
import signal
import socket
import subprocess
import threading
import time

PATIENCE_S = 120
# As deploy/rigs/micro.toml has it.
OWN_LIMIT_S = 2.0


class Starved(Exception):
    """The machine held the gauge up for 0.2 s, and the program vented as it has to, or so many frames that no good models came of
    so fast a ramp: the trial is begun anew."""


def ended_early(said):
    starved = any(words in said for words in ("gauge has said nothing", "gauge says nothing", "held up", "has not taken a command", "is not good"))
    raise Starved(said) if starved else AssertionError(said)


def tried(trial, *arguments):
    for last in (False, False, True):
        try:
            return trial(*arguments)
        except Starved as why:
            assert not last, why


class Bench:
    def __init__(self, taxeld, scratch):
        self.taxeld, self.log = taxeld, open(scratch / "demo.log", "w+b")
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.server = "http://127.0.0.1:%d" % free.getsockname()[1]
        self.demo = subprocess.Popen([taxeld, "demo", "--device", "--listen", self.server[7:]], stdout=self.log, stderr=self.log)
        command = self.until("the demo calibrates", lambda: re.search(r"\$ taxeld calibrate.* tcp:127\.0\.0\.1:(\d+)", self.said()))
        self.drive_port = int(command[1])
        # The demo's own calibration is not waited for.
        children = lambda: subprocess.run(["pgrep", "-P", str(self.demo.pid)], capture_output=True, text=True).stdout.split()
        os.kill(int(self.until("its program", children)[0]), signal.SIGKILL)
        self.until("the gauge", lambda: self.gauge_kpa() is not None)
        # Boards that are set up take what presses on them for nothing.
        verified = lambda: all(board["bringUp"] == "verified" for board in self.health()["boards"])
        self.until("the boards", verified)

    def said(self):
        self.log.seek(0)
        return self.log.read().decode()

    def until(self, what, done, patience=PATIENCE_S):
        end = time.monotonic() + patience
        while not (result := done()):
            assert time.monotonic() < end and self.demo.poll() is None, f"{what}: not within {patience} s\n{self.said()[-3000:]}"
            time.sleep(0.02)  # between two questions
        return result

    def command(self, *words):
        return subprocess.run([self.taxeld, *words, "--server", self.server], capture_output=True, text=True, timeout=PATIENCE_S)

    def health(self):
        answer = self.command("health", "--json").stdout
        assert answer, self.command("health")
        return json.loads(answer)

    def gauge_kpa(self):
        return self.health()["patches"][0].get("gaugeKpa")

    def sessions(self):
        return [json.loads(line) for line in self.command("sessions", "list", "--json").stdout.splitlines()]


class Calibration:
    def __init__(self, bench, profile, at, *more):
        words = ["calibrate", "--yes", "--device", str(profile), "--at", at, "--target", "40", *more]
        self.process = subprocess.Popen(
            [bench.taxeld, *words, "--server", bench.server], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.lines = []
        threading.Thread(target=lambda: self.lines.extend(self.process.stdout), daemon=True).start()

    def said(self):
        return "".join(list(self.lines))


class Works:
    """The demo's pump as what moves the pressure behind a drive that is spoken to in another way. It holds what it was told, as an
    Alicat, a gripper or an analogue module does."""

    def __init__(self, port):
        self.set_kpa, self.kpa, self.is_open = None, 0.0, True
        self.line = socket.create_connection(("127.0.0.1", port)).makefile("rw", newline="\n")
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _ask(self, text):
        self.line.write(text + "\n")
        self.line.flush()
        return self.line.readline()

    def _run(self):
        while self.is_open:
            set_kpa = self.set_kpa
            self._ask("vent" if not set_kpa else f"set {min(set_kpa, 90.0):.2f} {1000 * OWN_LIMIT_S:.0f}")
            self.kpa = float(self._ask("get").split()[1])
            time.sleep(0.02)
        self._ask("vent")
        self.line.close()

    def close(self):
        self.is_open = False
        self.thread.join()
