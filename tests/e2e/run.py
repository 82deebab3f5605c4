#!/usr/bin/env python3
"""The whole procedure over a real SocketCAN interface, with a client and a bus player that are not ours.

usage: run.py TAXELD SCRATCH [INSOLE.candump.gz]      (inside tests/vcan/lab: needs vcan0 and canplayer)
"""

import os
import select
import signal
import subprocess
import sys
import tempfile
import time

from foreign import Client, enum_name
from logs import Insole, synthetic

AREA_MM2 = 32.4
ADDRESS = "127.0.0.1:50051"

CONFIG = """
[store]
path = "{scratch}/{name}.db"
[[bus]]
name = "skin"
interface = "vcan0"
[[patch]]
name = "{name}"
bus = "skin"
listen_only = true
period_ms = {period_ms}
area = "equal"
area_mm2 = 32.4
boards = [{boards}]
gauge = {{ id = 0x3A1, signal = "0|32@1-", unit = "Pa", noise_kpa = {noise_kpa} }}
stale_periods = {stale_periods}
[patch.session]
target_kpa = {target_kpa}
pressurised_chamber = true
noise_band_kpa = {noise_band_kpa}
rise_max_kpa_per_s = 50.0
"""


class Daemon:
    """taxeld as a process, killed at the end whatever happens."""

    def __init__(self, taxeld, config):
        self.command = [taxeld, "run", "--config", config]
        self.process = None

    def __enter__(self):
        self.process = subprocess.Popen(self.command)
        return Client(ADDRESS)

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGKILL)  # no farewell: what was acknowledged is on disk all the same
        self.process.wait()


class Player:
    """The log on vcan0 again and again, by a program that is not ours. It catches up when it is held up: see boards.py."""

    def __init__(self, log):
        self.command = ["canplayer", "-I", log, "vcan0=can0", "-l", "i"]

    def __enter__(self):
        self.process = subprocess.Popen(self.command, stdout=subprocess.DEVNULL)
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()


class Boards:
    """Boards on a bus that are never silent: they send the first log again and again, another one when told to."""

    def __init__(self, *logs, interface="vcan0"):
        program = os.path.join(os.path.dirname(os.path.abspath(__file__)), "boards.py")
        self.command = [sys.executable, program, interface, *logs]
        self.logs = logs

    def __enter__(self):
        self.process = subprocess.Popen(self.command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()

    def begin(self, log):
        """Plays this log once, from the next scan on."""
        self.process.stdin.write(f"{self.logs.index(log)}\n")
        self.process.stdin.flush()

    def stay_at(self, log):
        """Plays this log again and again, from the next scan on."""
        self.process.stdin.write(f"loop {self.logs.index(log)}\n")
        self.process.stdin.flush()

    def have_played(self):
        """Whether the log that was begun has come to its end."""
        return bool(select.select([self.process.stdout], [], [], 0)[0])

    def play(self, log):
        self.begin(log)
        assert self.process.stdout.readline().startswith("played"), "the boards have ended"


def session_until(client, number, states):
    for session in client.stream("CalibrationService/WatchSession", session=number):
        state = enum_name(session, "state").removeprefix("SESSION_STATE_")
        if state in states:
            return session
        assert state not in ("FAILED", "ABORTED", "DISCARDED"), f"session {number} is {state}: {session.reason}"
    raise AssertionError(f"the stream ended before session {number} was in {states}")


def force_until(client, what, wanted, **of):
    for sample in client.stream("ForceService/StreamForce", **of):
        if wanted(sample):
            return sample
    raise AssertionError(f"no force sample with {what}")


def state_of(sample):
    return enum_name(sample, "state").removeprefix("FORCE_STATE_")


def served(sample):
    return state_of(sample) in ("OK", "DEGRADED")


def mean_force(client, scans, at_least_n, **of):
    """Mean over scans in which the load lies on the skin."""
    total, active, count = 0.0, 0, 0
    for sample in client.stream("ForceService/StreamForce", **of):
        if served(sample) and sample.total_n >= at_least_n:
            total, active, count = total + sample.total_n, active + sample.active, count + 1
        if count == scans:
            return total / count, active / count
    raise AssertionError("the stream ended")


def tare_at_rest(client, **of):
    """A zero. A busy machine holds frames back and plays them at once, which is refused, as is a watch of such scans."""
    for _ in range(20):
        code, text = client.outcome("SkinService/Tare", **of)
        if code == "OK":
            return
        assert code == "FAILED_PRECONDITION" and "rest is not proven" in text, (code, text)
    raise AssertionError(f"no zero in 20 watches: {text}")


def zero_for_all(client, model_set, **of):
    """A zero for every taxel with a model. One that happened to be restless has none and is left out of the force, which
    says so; another zero at rest brings it back."""
    used = client.call("ModelService/GetModelSet", modelSet=model_set).summary
    for _ in range(10):
        tare_at_rest(client, **of)
        seen = []

        def new(sample):
            """The answer comes with the zero, the force with the next scans."""
            seen.append(sample.sequence)
            return served(sample) and sample.sequence > seen[0] + 2

        sample = force_until(client, "a proven zero", new, **of)
        if sample.excluded <= used.taxels - used.calibrated:
            return


def calibrate(client, boards, ramp_log, **of):
    """From rest through the ramp and back; the boards go on with rest. `of` says which patch, if there are several."""
    session = client.call("CalibrationService/StartSession", **of).session
    session_until(client, session, ("RAMPING",))
    boards.play(ramp_log)
    view = session_until(client, session, ("RAMPING", "FITTING", "REVIEW"))
    if enum_name(view, "state") == "SESSION_STATE_RAMPING":
        client.call("CalibrationService/AdvanceSession", session=session, action="SESSION_ACTION_FINISH_RAMP")
    view = session_until(client, session, ("REVIEW",))
    code, text = client.refused("CalibrationService/AdvanceSession", session=session, action="SESSION_ACTION_FINISH_RAMP")
    assert code == "FAILED_PRECONDITION" and "REVIEW" in text, (code, text)
    client.call("ModelService/ActivateModelSet", modelSet=view.model_set, **of)
    zero_for_all(client, view.model_set, **of)
    print(f"calibrated: {view.accepted} scans entered, {view.durable} on disk, model set {view.model_set}", flush=True)
    return view


def check_synthetic(taxeld, scratch):
    """Ten taxels under 30 kPa press with 9.72 N, and that is what must come out."""
    modules, load_kpa = 4, 30.0
    config = write_config(scratch, "synthetic", {
        "boards": '{ address = 13, modules = "0-3" }', "period_ms": 50, "noise_kpa": 0.01,
        "stale_periods": 10, "target_kpa": 70.0, "noise_band_kpa": 0.5,
    })
    at_rest = lambda taxel, t: 0.0
    rest = synthetic(f"{scratch}/rest.log", modules, 5, at_rest, lambda t: 0.0, noise=1)
    # Up at 4 kPa/s, down at 30: a step of the whole board within one scan would be taken for a silent re-tare.
    bag = lambda t: 4 * t if t < 18.5 else max(0.0, 74 - 30 * (t - 18.5))
    ramp = synthetic(f"{scratch}/ramp.log", modules, 22, lambda taxel, t: bag(t), bag, noise=1)
    on_one_module = lambda taxel, t: load_kpa if 10 <= taxel < 20 else 0.0
    load = synthetic(f"{scratch}/load.log", modules, 5, on_one_module, lambda t: 0.0, noise=1)
    with Daemon(taxeld, config) as client:
        assert state_of(client.call("ForceService/GetForce")) == "UNCALIBRATED"
        with Boards(rest, ramp) as boards:
            view = calibrate(client, boards, ramp)
        taxel = client.call("ModelService/GetModelSet", modelSet=view.model_set, curves=[13]).curves[0]
        print(f"taxel 13: {str(taxel)[:200]!r}", flush=True)
        with Player(load):
            force, active = mean_force(client, 40, 5.0)
        expected = 10 * load_kpa * AREA_MM2 * 1e-3
        print(f"ten taxels under {load_kpa} kPa: {force:.3f} N, expected {expected:.3f} N, {active:.1f} active", flush=True)
        assert abs(force / expected - 1) < 0.03, (force, expected)
        check_bad_requests(client)
        check_link(client, rest)
    # killed: what was acknowledged is found again
    with Daemon(taxeld, config) as client, Player(rest):
        sets = client.call("ModelService/ListModelSets").model_sets
        assert [s.model_set for s in sets] == [view.model_set], sets
        sessions = client.call("CalibrationService/ListSessions").sessions
        assert enum_name(sessions[-1], "state") == "SESSION_STATE_ACTIVE", sessions
        sample = force_until(client, "the stored models and a zero of its own", served)
        assert sample.model_set == view.model_set
        print("killed and started again: the models are there, and rest was proven by itself", flush=True)


def check_bad_requests(client):
    for call, fields, code, says in [
        ("ForceService/GetForce", {"patch": "elbow"}, "NOT_FOUND", "elbow"),
        ("ForceService/StreamForce", {"rateHz": 5000}, "INVALID_ARGUMENT", "rate_hz"),
        ("CalibrationService/StartSession", {"targetKpa": -3}, "INVALID_ARGUMENT", "target_kpa"),
        ("CalibrationService/GetSession", {"session": 99}, "NOT_FOUND", "99"),
        ("ModelService/ActivateModelSet", {"modelSet": "m-none"}, "NOT_FOUND", "m-none"),
        ("ModelService/ImportModelSet", {"json": "{"}, "INVALID_ARGUMENT", ""),
    ]:
        if call.endswith("StreamForce"):
            got = refused_stream(client, call, fields)
        else:
            got = client.refused(call, **fields)
        assert got[0] == code and says in got[1], (call, got)
    print("bad requests are refused with field, state or name", flush=True)


def refused_stream(client, call, fields):
    import grpc
    try:
        for _ in client.stream(call, **fields):
            pass
    except grpc.RpcError as error:
        return error.code().name, error.details()
    raise AssertionError(f"{call} {fields} was not refused")


def check_link(client, rest):
    """A bus that goes down is told within a second, and its force is not served; it comes back by itself."""
    with Player(rest):
        force_until(client, "a force", served)
        begun = time.monotonic()
        subprocess.run(["ip", "link", "set", "vcan0", "down"], check=True)
        force_until(client, "no force", lambda s: state_of(s) == "STALE" and not s.HasField("total_n"))
        health_until(client, lambda h: not h.buses[0].up)
        print(f"link down: told after {time.monotonic() - begun:.2f} s", flush=True)
        subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
    with Boards(rest):
        health_until(client, lambda h: h.buses[0].up)
        # The boards were silent, as after a loss of power: their zero has to be taken anew, once they are heard again.
        force_until(client, "boards that are heard", lambda s: state_of(s) == "TARE_INVALID")
        tare_at_rest(client)
        force_until(client, "a force again", served)
    print("link up: reading went on by itself", flush=True)


def health_until(client, wanted):
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline:
        health = client.call("SkinService/GetHealth")
        # Before the engine's first turn nothing is known of any bus.
        if health.buses and wanted(health):
            return health
    raise AssertionError(f"health stayed {health}")


def check_insole(taxeld, scratch, log):
    """Real skin in a chamber: the pressure is the same everywhere, so the force is pressure x area of what counts."""
    insole = Insole(log)
    boards = '{ address = 13, modules = "0-15" }, { address = 12, modules = "0-11" }'
    config = write_config(scratch, "insole", {
        "boards": boards, "period_ms": 16, "noise_kpa": 0.2, "stale_periods": 40, "target_kpa": 150.0,
        "noise_band_kpa": 2.0,
    })
    first = list(range(16))
    rest = insole.write(f"{scratch}/insole_rest.log", first * 20)
    top = next(i for i in range(len(insole.scans)) if insole.pressure(i) > 160)
    last = len(insole.scans) - 1
    fall = next(i for i in range(last, 0, -1) if insole.pressure(i) > 160)
    # The way down is played five times as fast: it only has to be no jump.
    ramp = insole.write(f"{scratch}/insole_ramp.log", [*range(top), *range(fall, last, 5)])
    near = [i for i in range(top) if 95 < insole.pressure(i) < 105]
    load = insole.write(f"{scratch}/insole_load.log", [*range(0, near[0], 5), *near * 8])
    true_kpa = sum(insole.pressure(i) for i in near) / len(near)
    with Daemon(taxeld, config) as client, Boards(rest, ramp, load) as boards:
        view = calibrate(client, boards, ramp)
        models = client.call("ModelService/GetModelSet", modelSet=view.model_set)
        usable = sum(1 for taxel in models.taxels if taxel.status == "ok")
        boards.begin(load)
        samples = []
        for sample in client.stream("ForceService/StreamForce"):
            samples.append(sample)
            if boards.have_played():
                break
        # The end of the log holds the pressure; the very last samples may be of boards that are at rest again.
        held = [sample for sample in samples[-150:-30] if served(sample)]
        print(f"insole: {len(samples)} samples, the last: {str(samples[-31])[:400]!r}", flush=True)
        assert len(held) > 50, f"{len(held)} samples"
        force = sum(sample.total_n for sample in held) / len(held)
        active = sum(sample.active for sample in held) / len(held)
        expected = active * true_kpa * AREA_MM2 * 1e-3
        print(f"insole: {usable} usable models; {true_kpa:.1f} kPa on {active:.1f} active taxels: {force:.1f} N, "
              f"expected {expected:.1f} N ({100 * (force / expected - 1):+.1f} %)", flush=True)
        assert usable > 150, usable
        assert abs(force / expected - 1) < 0.06, (force, expected)


def write_config(scratch, name, values):
    path = f"{scratch}/{name}.toml"
    with open(path, "w", encoding="utf-8") as out:
        out.write(CONFIG.format(scratch=scratch, name=name, **values))
    return path


def main():
    taxeld, scratch = sys.argv[1], sys.argv[2]
    os.makedirs(scratch, exist_ok=True)
    scratch = tempfile.mkdtemp(dir=scratch)
    check_synthetic(taxeld, scratch)
    if len(sys.argv) > 3:
        check_insole(taxeld, scratch, sys.argv[3])
    else:
        print("SKIPPED: the insole recording is not here", flush=True)
    print("2 passed, 0 failed" if len(sys.argv) > 3 else "1 passed, 0 failed, 1 skipped")


if __name__ == "__main__":
    main()
