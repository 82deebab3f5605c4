#!/usr/bin/env python3
"""An array on a serial line, pushed by deploy/push_serial.py: calibrated through the service, weighed, unplugged.

The array is a program at the other end of a pseudo terminal; it knows nothing of taxeld. No CAN is needed.

usage: push.py TAXELD SCRATCH
"""

import os
import pathlib
import pty
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import tty

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "arrays"))

import arrays
import run
from run import calibrate, force_until, health_until, mean_force, served, state_of, zero_for_all

TAXELS = 64
RISE_KPA_PER_S, FALL_KPA_PER_S = 4.0, 24.0

CONFIG = """
store.path = "{scratch}/glove.db"
listen = ["tcp:{address}"]

[[bus]]
name = "serial"
source = "push"

[[patch]]
name = "glove"
bus = "serial"
period_ms = 20
push = {{ taxels = 64, count_max = 4095 }}
grid = {{ rows = 8, columns = 8, pitch_mm = 4.0 }}
gauge = {{}}
stale_periods = 40
"""


class SerialArray:
    """The array, its bag and what lies on it; a thread of its own sends a scan every period, and none twice as fast."""

    def __init__(self):
        self.skin = arrays.Skin(TAXELS, 12, 240.0, -1, 5)
        self.end, far = pty.openpty()
        tty.setraw(far)
        self.device, self.far = os.ttyname(far), far
        self.began_s, self.load_kpa, self.lines = None, 0.0, 0
        threading.Thread(target=self._send, daemon=True).start()

    def bag_kpa(self):
        if self.began_s is None:
            return 0.0
        t, top_s = time.monotonic() - self.began_s, arrays.TOP_KPA / RISE_KPA_PER_S
        if t < top_s:
            return RISE_KPA_PER_S * t
        return max(0.0, arrays.TOP_KPA - FALL_KPA_PER_S * (t - top_s))

    def play(self, _ramp):
        """Pumps the bag empty and vents it; as long as that takes."""
        self.began_s = time.monotonic()
        while self.bag_kpa() > 0.0 or time.monotonic() - self.began_s < 1.0:
            time.sleep(0.05)

    def _send(self):
        due = time.monotonic()
        while True:
            kpa = self.bag_kpa()
            loaded = lambda taxel: kpa + (self.load_kpa if taxel < arrays.LOADED else 0.0)
            numbers = [*self.skin.scan(loaded), round(kpa * 1000)]
            body = ",".join(str(number) for number in numbers).encode()
            parity = 0
            for byte in body:
                parity ^= byte
            line = body + b"*%02X\n" % parity
            self.lines += 1
            if self.lines % 50 == 7:
                line = line.replace(b"1", b"", 1)  # a byte is lost on the line now and then
            os.write(self.end, line)
            due = max(due + arrays.PERIOD_S, time.monotonic())
            time.sleep(max(0.0, due - time.monotonic()))


class Pusher:
    """deploy/push_serial.py as a process."""

    def __init__(self, array, address):
        program = HERE.parent.parent / "deploy" / "push_serial.py"
        self.command = [sys.executable, program, array.device, "--patch", "glove", "--pressure", "--address", address]

    def __enter__(self):
        self.process = subprocess.Popen(self.command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()

    def pushes(self):
        """Waits until it does."""
        line = self.process.stdout.readline()
        assert line == "pushing\n", line or self.process.stderr.read()


def weigh(client, array):
    array.load_kpa = arrays.LOAD_KPA
    truth = arrays.LOADED * arrays.LOAD_KPA * arrays.AREA_MM2 * 1e-3
    force, active = mean_force(client, 60, 0.9 * truth)
    array.load_kpa = 0.0
    # Seen to go: a load that goes while nobody pushes is one that the daemon rightly asks about.
    force_until(client, "the load lifted", lambda s: served(s) and s.total_n < 0.1 * truth)
    print(f"pushed: {truth:.2f} N read {force:.3f} N ({100 * (force / truth - 1):+.2f} %), {active:.1f} active", flush=True)
    assert abs(force / truth - 1) < 0.01, (force, truth)


def check(client, array, address):
    health = health_until(client, lambda h: "nobody has pushed" in h.buses[0].problem)
    assert not health.buses[0].up, health
    with Pusher(array, address) as pusher:
        pusher.pushes()
        health_until(client, lambda h: h.buses[0].up)
        force_until(client, "scans", lambda s: s.HasField("age_s"))
        models = calibrate(client, array, None).model_set
        with Pusher(array, address) as second:
            said = second.process.stderr.readline()
        assert "ALREADY_EXISTS" in said and "glove" in said, said
        weigh(client, array)
    force_until(client, "no force", lambda s: state_of(s) == "STALE" and not s.HasField("total_n"))
    health_until(client, lambda h: not h.buses[0].up and any(word in h.buses[0].problem for word in ("ended", "gone")))
    with Pusher(array, address) as pusher:
        pusher.pushes()
        force_until(client, "scans without a zero", lambda s: state_of(s) == "TARE_INVALID")
        zero_for_all(client, models)
        force_until(client, "a force again", served)
        weigh(client, array)
        bus = client.call("SkinService/GetHealth").buses[0]
        assert bus.frames > 500 and bus.malformed == 0, str(bus)
    print("1 passed, 0 failed")


def main():
    taxeld = sys.argv[1]
    pathlib.Path(sys.argv[2]).mkdir(parents=True, exist_ok=True)
    scratch = pathlib.Path(tempfile.mkdtemp(dir=sys.argv[2]))
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    config = scratch / "glove.toml"
    config.write_text(CONFIG.format(scratch=scratch, address=address), encoding="ascii")
    daemon = subprocess.Popen([taxeld, "run", "--config", str(config)])
    try:
        check(run.Client(address), SerialArray(), address)
    finally:
        daemon.send_signal(signal.SIGKILL)
        daemon.wait()


if __name__ == "__main__":
    main()
