#!/usr/bin/env python3
"""A calibration by a drive that is disturbed: killed, stopped, ended, unplugged, aborted; the bag has to be vented each time.

usage: run.py TAXELD SCRATCH [--repeats N] [--states STATE,...]      (with either: each disturbance in each of these states, N times)

The drive is the simulated micro board of `taxeld demo --device`, which vents two seconds after its last command as the profile
says. What the gauge reads is asked at the daemon. Every second trial goes over a pseudo terminal, the others over TCP.

Of the machine's eleven states eight are tried. Idle is no program, Done and SafeVent have vented already: the drive was told so.
"""

import argparse
import collections
import json
import os
import pathlib
import pty
import re
import select
import signal
import socket
import threading
import time
import tty
import urllib.request

from bench import OWN_LIMIT_S, PATIENCE_S, Bench, Calibration, Works, ended_early, tried

HELD_S = 3.0
# The simulated bag vents by a time constant of 0.8 s: from 20 kPa to 1 kPa in 2.4 s, from 70 in 3.4.
VENTED_KPA, VENTED_WITHIN_S = 1.0, 4.0
# A busy machine is late.
LATE_S = 2.0
STATES = {"armed": "hands off", "self-test": "drive: self-test", "leak test": "drive: leak test", "tare": "being taken",
          "ramp": "drive: rising", "hold": "drive: holding", "fall": "drive: falling", "vent": "drive: venting"}
VENTED = ("armed", "tare", "vent")
DISTURBANCES = ("killed", "stopped", "unplugged", "ended")


class Connection:
    """Passes bytes on between the program, over TCP, and the drive, until it is cut."""

    def __init__(self, port):
        self.drive, self.sockets = port, []
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.at = "tcp:127.0.0.1:%d" % self.listener.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self):
        while True:
            near, _ = self.listener.accept()
            far = socket.create_connection(("127.0.0.1", self.drive))
            self.sockets += [near, far]
            for one, other in [(near, far), (far, near)]:
                threading.Thread(target=self._pass, args=(one, other), daemon=True).start()

    def _pass(self, one, other):
        try:
            while data := one.recv(4096):
                other.sendall(data)
        except OSError:
            pass
        for end in (one, other):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def cut(self):
        for one in self.sockets:
            try:
                one.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass
        self.sockets = []

    close = cut


class Terminal:
    """The same over a pseudo terminal. The board does not see that it was cut, or that the program is gone: it hears nothing."""

    def __init__(self, port):
        self.drive, self.is_cut, self.is_closed = socket.create_connection(("127.0.0.1", port)), False, False
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        self.at = os.ttyname(self.slave)
        self.thread = threading.Thread(target=self._pass, daemon=True)
        self.thread.start()

    def _pass(self):
        while not self.is_closed:
            for end in select.select([self.drive] if self.is_cut else [self.drive, self.master], [], [], 0.02)[0]:
                data = os.read(end if end is self.master else end.fileno(), 4096)
                if end is self.master:
                    self.drive.sendall(data)
                elif not self.is_cut:
                    os.write(self.master, data)
            if self.is_cut and self.master is not None:
                os.close(self.slave)
                os.close(self.master)
                self.master = None
        self.drive.close()

    def cut(self):
        self.is_cut = True

    def close(self):
        self.cut()
        self.is_closed = True
        self.thread.join()


def disturbed(bench, profiles, state, how, line):
    link = line(bench.drive_port)
    try:
        one = Calibration(bench, profiles["leak" if state == "leak test" else "quick"], link.at, *(["--both"] if state == "fall" else []))
        bench.until(state, lambda: STATES[state] in one.said() or one.process.poll() is not None and ended_early(one.said()))
        if state not in VENTED:
            bench.until("pressure", lambda: bench.gauge_kpa() > 3.0 or one.process.poll() is not None and ended_early(one.said()))
        at = time.monotonic()
        {
            "killed": one.process.kill,
            "stopped": lambda: one.process.send_signal(signal.SIGSTOP),
            "ended": one.process.terminate,
            "unplugged": link.cut,
            "aborted": lambda: bench.command("sessions", "end", str(bench.sessions()[0]["session"])),
            "aborted on the page": lambda: abort_on_the_page(bench),
        }[how]()
        own = OWN_LIMIT_S if how in ("killed", "stopped", "unplugged") else 0.5
        within = own + VENTED_WITHIN_S + LATE_S
        bench.until(f"{how} in {state}: a vented bag", lambda: bench.gauge_kpa() < VENTED_KPA, within + 20)
        took = time.monotonic() - at
        assert took < within, f"{how} in {state}: vented after {took:.1f} s\n{one.said()}"
        if how == "stopped":
            time.sleep(max(0.0, at + HELD_S - time.monotonic()))  # as long as it is stopped at least
            one.process.send_signal(signal.SIGCONT)
        code = one.process.wait(PATIENCE_S)
        if how != "killed":
            assert code == 3 and "the bag is vented" in one.said(), (code, one.said())
        if state in ("ramp", "hold", "fall") and how not in ("killed", "stopped", "unplugged"):
            reason, expected = bench.sessions()[0]["reason"], "a signal ended it" if how == "ended" else "an operator aborted it"
            assert expected in reason, reason
    finally:
        link.close()
    print(f"{how} in {state}: vented after {took:.1f} s; {(one.said().splitlines() or [''])[-1][:160]}", flush=True)
    return took


def abort_on_the_page(bench):
    """What its button calls."""
    page = re.search(r"Its page, .*: (http://\S+)/", bench.said())[1]
    body = json.dumps({"session": bench.sessions()[0]["session"], "action": "SESSION_ACTION_ABORT"}).encode()
    headers = {"content-type": "application/json", "origin": page}
    urllib.request.urlopen(urllib.request.Request(f"{page}/taxel.v1.CalibrationService/AdvanceSession", body, headers)).read()


class Board:
    """A board of text that is not as deploy/rigs has one: it answers `OK`, or nothing, to what it is told, and has to be asked for
    its set point."""

    PROFILE = """
name = "a board of text"
at = "/dev/ttyUSB0"
fail_safe = "attended"
kpa_per_s = 4.0
[text]
set = "SET {kPa}"
set_answer = "OK"
set_point = "SP?"
set_point_answer = "SP={kPa}"
vent = "VENT"
vent_answer = "OK"
pressure = "P?"
pressure_answer = "p {kPa} kPa"
"""

    def __init__(self, works, is_silent):
        self.works, self.is_silent = works, is_silent
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        self.at = os.ttyname(self.slave)
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        came = b""
        while True:
            *lines, came = (came + os.read(self.master, 256)).split(b"\n")
            for line in lines:
                if answer := self.answer(line.decode()):
                    os.write(self.master, f"{answer}\r\n".encode())

    def answer(self, line):
        if line in ("SP?", "P?"):
            return f"SP={self.works.set_kpa or 0:.2f}" if line == "SP?" else f"p {self.works.kpa:.2f} kPa"
        self.works.set_kpa = float(line.split()[1]) if line.startswith("SET ") else None
        return None if self.is_silent else "OK"


def text_board(bench, scratch, is_silent):
    works = Works(bench.drive_port)
    board, file = Board(works, is_silent), scratch / "board.toml"
    try:
        file.write_text(Board.PROFILE.replace('"OK"', '"DONE"'))
        refused = Calibration(bench, file, board.at, "--attended")
        assert refused.process.wait(PATIENCE_S) == 3, refused.said()
        expected = 'sent "VENT\\n", received ' + ('nothing, expected "DONE"' if is_silent else '"OK", expected "DONE"')
        assert expected in refused.said() and "text.vent_answer" in refused.said(), refused.said()
        file.write_text(re.sub(r'(?m)^\w+ = "OK"$', "", Board.PROFILE) if is_silent else Board.PROFILE)
        one = Calibration(bench, file, board.at, "--attended")
        if one.process.wait(PATIENCE_S):
            ended_early(one.said())
        assert "is in use" in one.said(), one.said()
    finally:
        works.close()
    print(f"a board of text that answers {'nothing' if is_silent else 'OK'}: calibrated", flush=True)


def undisturbed(bench, profile):
    """The next start tidies up what the last one left, and comes to its end."""
    one = Calibration(bench, profile, f"tcp:127.0.0.1:{bench.drive_port}")
    if one.process.wait(PATIENCE_S):
        ended_early(one.said())
    for part in ("drive: self-test", "kPa/min", "drive: rising", "drive: the bag is vented", "is in use"):
        assert part in one.said(), (part, one.said())
    # It ends below a kilopascal by its own zero; the gauge's may be another.
    bench.until("a vented bag", lambda: bench.gauge_kpa() < VENTED_KPA)
    print("undisturbed: " + one.said().splitlines()[-1], flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("taxeld")
    parser.add_argument("scratch", type=pathlib.Path)
    parser.add_argument("--repeats", type=int)
    parser.add_argument("--states", type=lambda text: text.split(","), default=list(STATES))
    args = parser.parse_args()
    args.scratch.mkdir(parents=True, exist_ok=True)
    micro = pathlib.Path(__file__).resolve().parents[2].joinpath("deploy/rigs/micro.toml").read_text()
    quick = micro.replace("kpa_per_s = 1.0", "kpa_per_s = 4.0")
    profiles = {"leak": quick, "quick": re.sub("(?m)^hold.*$", "", quick)}
    for name, text in profiles.items():
        profiles[name] = args.scratch / f"{name}.toml"
        profiles[name].write_text(text)
    trials = [("ramp", "killed"), ("ramp", "stopped"), ("self-test", "unplugged"), ("ramp", "ended"), ("ramp", "aborted"),
              ("ramp", "aborted on the page")]
    if args.repeats or args.states != list(STATES):
        trials = [(state, how) for _ in range(args.repeats or 1) for state in args.states for how in DISTURBANCES]
    bench, slowest = Bench(args.taxeld, args.scratch), collections.defaultdict(list)
    try:
        for number, (state, how) in enumerate(trials):
            line = Terminal if (number + number // len(DISTURBANCES)) % 2 else Connection
            slowest[how].append(tried(disturbed, bench, profiles, state, how, line))
        for how, times in slowest.items():
            print(f"{how}: {len(times)} times, vented after at most {max(times):.1f} s", flush=True)
        for is_silent in (False, True):
            tried(text_board, bench, args.scratch, is_silent)
        tried(undisturbed, bench, profiles["leak"])
    finally:
        bench.demo.terminate()
        bench.demo.wait(PATIENCE_S)


if __name__ == "__main__":
    main()
