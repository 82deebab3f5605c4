#!/usr/bin/env python3
"""The skin of a whole iCub over seven real CAN interfaces: 4,448 taxels on 44 boards, calibrated and pressed.

All 13 patches are calibrated at once through the service; then one module of each is pressed and its force read. No frame
may be lost: what the boards have sent is what the daemon has understood, to the frame. Memory and wakes are printed;
processor time is not, since user-mode Linux counts it in whole ticks of 10 ms.

usage: whole_robot.py TAXELD SCRATCH [10]      (inside tests/vcan/lab: makes the interfaces that it needs)

With 10 there are ten interfaces: three more with as many modules as an arm has, each one patch.
"""

import concurrent.futures
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

import run
from foreign_arrays import make_interface
from robot_boards import LOAD_KPA

HERE = pathlib.Path(__file__).resolve().parent
AREA_MM2 = 32.4
GAUGE = 0x5F1
STEADY_S = 10.0
FULL = list(range(16))
SHANK, CALF = [0, 3, 4, 5, 6, 9, 10, 11, 14, 15], [1, 2, 3, 4, 5, 6, 7, 8, 12, 13]
ARM = {
    "hand": {14: [0, 1, 2, 3, 4, 8, 9, 10, 11]},
    "forearm": {13: FULL, 12: [0, 1, 3, 6, 8, 9, 12, 13]},
    "arm": {
        11: [2, 3, 4, 5, 6],
        10: [0, 1, 6, 8, 9, 10, 11, 12, 13, 14, 15],
        9: [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 13],
        8: [0, 5, 8, 9, 10, 11, 13, 15],
    },
}
THIGH = {
    "leg_upper": {
        1: FULL, 2: SHANK, 3: CALF, 4: [5, 6, 8, 9, 10], 5: [0, 1, 2, 12, 14, 15],
        6: [1, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13], 7: [0, 1, 8, 10, 11, 12, 13, 14, 15],
    },
}
FOOT = {
    "foot": {13: [0, 1, 2, 3, 4, 8, 9, 10, 11, 12, 13, 14, 15], 12: [1, 2, 3, 4, 5, 6, 8, 9, 10, 11, 12, 13]},
    "leg_lower": {8: SHANK, 9: [0, 1, 3, 4, 5, 6, 7, 12], 10: SHANK, 11: CALF},
}
TORSO = {"torso": {7: [5, 6, 7, 8, 9, 10, 11], 8: [1, 2, 3, 6, 7, 8, 9, 10, 11, 12, 13], 9: FULL, 10: [1, 2, 4, *range(8, 15)]}}
ROBOT = [("left", ARM), ("right", ARM), ("left", THIGH), ("left", FOOT), ("right", THIGH), ("right", FOOT), ("middle", TORSO)]
MORE_SKIN = {"skin": {**ARM["hand"], **ARM["forearm"], **ARM["arm"]}}
MORE = [("eighth", MORE_SKIN), ("ninth", MORE_SKIN), ("tenth", MORE_SKIN)]
TAXELS = {"triangle": 10, "fingertip": 12, "palm-pad11": 11, "palm-pad7": 11}


def kind_of(part, module):
    if part != "hand":
        return "triangle"
    return "fingertip" if module <= 4 else "palm-pad7" if module == 11 else "palm-pad11"


def modules_of(part, boards):
    """Address, number and kind of each module, in the order of the taxels."""
    return [(address, module, kind_of(part, module)) for address, modules in boards.items() for module in modules]


def patches():
    """Name, bus, boards and modules of every patch."""
    for bus, (side, parts) in enumerate(ROBOT):
        for part, boards in parts.items():
            yield f"{side}_{part}", bus, boards, modules_of(part, boards)


def config(scratch):
    text = f'store.path = "{scratch}/robot.db"\n'
    for bus in range(len(ROBOT)):
        text += f'[[bus]]\nname = "can{bus}"\ninterface = "vcan{bus}"\n'
    for name, bus, boards, modules in patches():
        text += f'[[patch]]\nname = "{name}"\nbus = "can{bus}"\nlisten_only = true\narea = "equal"\narea_mm2 = {AREA_MM2}\n'
        text += "boards = [\n"
        for address in boards:
            listed = ", ".join(f"{module} {kind}" for at, module, kind in modules if at == address)
            text += f'    {{ address = {address}, modules = "{listed}" }},\n'
        text += f']\ngauge = {{ id = {GAUGE}, signal = "0|32@1-", unit = "Pa" }}\n'
        text += "stale_periods = 20\nsession = { noise_band_kpa = 0.5 }\n"
    path = scratch / "robot.toml"
    path.write_text(text, encoding="ascii")
    return str(path)


class Robot:
    """Its boards, a process for each bus."""

    def __init__(self):
        self.buses = []

    def __enter__(self):
        for bus in range(len(ROBOT)):
            sent = []
            for _, _, _, modules in (patch for patch in patches() if patch[1] == bus):
                sent += [(0x400 | at << 4 | module, kind, n == 0) for n, (at, module, kind) in enumerate(modules)]
            command = [sys.executable, HERE / "robot_boards.py", f"vcan{bus}", str(GAUGE), json.dumps(sent)]
            self.buses.append(subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True))
        return self

    def __exit__(self, *_):
        for bus in self.buses:
            bus.kill()
            bus.wait()

    def say(self, word):
        for bus in self.buses:
            bus.stdin.write(f"{word}\n")
            bus.stdin.flush()

    def answers(self):
        return [bus.stdout.readline().strip() for bus in self.buses]


def wakes(pid):
    """How often a thread of a process went to sleep and was woken again, so far."""
    tasks = pathlib.Path(f"/proc/{pid}/task").glob("*/status")
    lines = (line for task in tasks for line in task.read_text(encoding="ascii").splitlines())
    return sum(int(line.split()[1]) for line in lines if line.startswith("voluntary_ctxt_switches"))


def high_water_kb(pid):
    lines = pathlib.Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
    return int(next(line for line in lines if line.startswith("VmHWM")).split()[1])


def each(of, *lists):
    """Calls it for all patches side by side."""
    with concurrent.futures.ThreadPoolExecutor(16) as pool:
        return list(pool.map(of, *lists))


def calibrate(client, robot, names):
    sessions = [client.call("CalibrationService/StartSession", patch=name).session for name in names]
    for session in sessions:
        run.session_until(client, session, ("RAMPING",))
    robot.say("ramp")
    assert set(robot.answers()) == {"done"}
    for name, session in zip(names, sessions):
        code, text = client.outcome("CalibrationService/AdvanceSession", session=session, action="SESSION_ACTION_FINISH_RAMP")
        assert code == "OK" or " is FITTING" in text or " is REVIEW" in text, (name, text)
        view = run.session_until(client, session, ("REVIEW",))
        client.call("ModelService/ActivateModelSet", modelSet=view.model_set, patch=name)
    each(lambda name: run.tare_at_rest(client, patch=name), names)
    print(f"calibrated: {len(names)} patches side by side", flush=True)


def weigh(client, robot, everything):
    robot.say("load")

    def one(patch):
        name, _, _, modules = patch
        expected = TAXELS[modules[0][2]] * LOAD_KPA * AREA_MM2 * 1e-3
        force, active = run.mean_force(client, 20, 0.8 * expected, patch=name)
        return name, expected, force, active

    total, truth = 0.0, 0.0
    for name, expected, force, active in each(one, everything):
        assert abs(force / expected - 1) < 0.03, (name, expected, force, active)
        total, truth = total + force, truth + expected
    print(f"{len(everything)} modules under {LOAD_KPA} kPa: {total:.1f} N in all, expected {truth:.1f} N", flush=True)
    robot.say("rest")


def measure(client, pid):
    """What the daemon takes while everything streams."""
    frames = lambda: sum(bus.frames for bus in client.call("SkinService/GetHealth").buses)
    begun, woken, before = time.monotonic(), wakes(pid), frames()
    time.sleep(STEADY_S)
    woken, taken, seconds = wakes(pid) - woken, frames() - before, time.monotonic() - begun
    print(f"{taken / seconds:.0f} frames/s, {taken / woken:.0f} of them a wake: {0.05 * woken / seconds:.0f} wakes in the 50 ms "
          f"of a scan; memory: {high_water_kb(pid) / 1000:.1f} MB at most", flush=True)


def check_frames(client, sent):
    """Every frame that was sent was understood."""
    counted = lambda health: [bus.frames for bus in health.buses] == sent
    health = run.health_until(client, lambda h: counted(h) or sum(bus.frames for bus in h.buses) > sum(sent))
    assert counted(health), ([bus.frames for bus in health.buses], sent)
    assert all(bus.up and not (bus.dropped or bus.malformed or bus.foreign) for bus in health.buses), health.buses
    # A program that is held up between the two halves of a module parts them: they are heard, and are no scan.
    halves = sum(board.orphans for board in health.boards)
    print(f"{sum(sent)} frames sent on {len(sent)} interfaces, all of them understood, none dropped; {halves} halves of "
          "modules were sent too far apart", flush=True)


def main():
    taxeld = sys.argv[1]
    pathlib.Path(sys.argv[2]).mkdir(parents=True, exist_ok=True)
    scratch = pathlib.Path(tempfile.mkdtemp(dir=sys.argv[2]))
    if sys.argv[3:] == ["10"]:
        ROBOT.extend(MORE)
    everything = list(patches())
    names = [patch[0] for patch in everything]
    modules = [module for patch in everything for module in patch[3]]
    counts = [sum(TAXELS[kind] for _, _, kind in modules), len(modules), sum(len(patch[2]) for patch in everything)]
    assert counts[:1] == [4_448] or ROBOT[-1] in MORE, counts
    print(f"{counts[0]} taxels on {counts[1]} modules of {counts[2]} boards, {len(ROBOT)} interfaces", flush=True)
    for bus in range(len(ROBOT)):
        make_interface(f"vcan{bus}")
    daemon = run.Daemon(taxeld, config(scratch))
    with daemon as client:
        run.health_until(client, lambda health: all(bus.up for bus in health.buses))
        client.call("ForceService/GetForce", patch=names[0])  # its reflection is read here, and not by threads at once
        with Robot() as robot:
            run.health_until(client, lambda h: all(board.modules_fresh == board.modules_enabled for board in h.boards))
            calibrate(client, robot, names)
            weigh(client, robot, everything)
            measure(client, daemon.process.pid)
            robot.say("end")
            check_frames(client, [int(sent) for sent in robot.answers()])
    print("1 passed, 0 failed")


if __name__ == "__main__":
    main()
