#!/usr/bin/env python3
"""The lines of your-skin.md for a robot whose skin is on ports of YARP, as they stand there, with a real YARP.

    tests/yarp/walk.py TAXELD BRIDGE SCRATCH PROGRAMS      (PROGRAMS: what tests/yarp/build prints)

The robot is a simulated forearm in a bag (yarp.py). Beside the lines the test says where the daemon listens and keeps its store,
answers the question of `taxeld calibrate`, and pumps.
"""

import os
import pathlib
import re
import signal
import subprocess
import sys

HERE = pathlib.Path(__file__).parent
sys.path[:0] = [str(HERE.parent / "bridge"), str(HERE.parent / "e2e")]
from foreign import Client  # noqa: E402
from stage import Stage, free_port, until  # noqa: E402
from yarp import Robot, Yarp  # noqa: E402

ROBOT = {
    "icub_all.xml": """<robot name="icub" portprefix="icub" xmlns:xi="http://www.w3.org/2001/XInclude">
        <xi:include href="left_arm-skin_wrapper.xml"/><xi:include href="left_arm-eb24-skin.xml"/></robot>""",
    "left_arm-skin_wrapper.xml": """<device name="left_arm_skin_wrapper" type="skinWrapper">
        <paramlist name="ports"><elem name="left_forearm"> 0 383 0 383 </elem></paramlist>
        <action phase="startup"><paramlist name="networks"><elem name="Set"> left_arm-eb24-skin </elem></paramlist></action></device>""",
    "left_arm-eb24-skin.xml": """<device name="left_arm-eb24-skin" type="embObjSkin">
        <group name="patches"><param name="skinCanAddrsPatch1"> 13 12 </param></group>
        <group name="defaultCfgBoard"><param name="period"> 60 </param></group></device>""",
}
BRIDGE = 'robot = "icub01"\n[daemon]\nserver = "http://127.0.0.1:{port}"\n[yarp]\n[[patch]]\nname = "left_forearm"\n'
LOADED, LOAD_KPA = (2, 3), 12.0


def readme_lines():
    """The commands of the block that begins with `taxeld scan --yarp`, without their comments."""
    text = (HERE.parent.parent / "crates/taxeld/doc/your-skin.md").read_text()
    block = text[text.index("    taxeld scan --yarp") :].split("\n\n")[0]
    lines = [re.sub(r"\s+# .*$", "", line[4:]) for line in block.splitlines()]
    assert len(lines) == 6, lines
    return lines


def positions():
    """A position file of a forearm: where iCub's own is not here, one of the same triangles."""
    own = pathlib.Path(os.environ.get("TAXELD_DATA", "")) / "icub_positions/left_forearm_V2.txt"
    if own.is_file():
        return own.read_text()
    there = {*range(16), *(16 + module for module in (0, 1, 3, 6, 8, 9, 12, 13))}
    place = lambda row: f"{0.018 * (row // 12):.4f} {0.003 * (row % 12) + 0.001:.4f} 0.02 0 0 1"
    rows = [place(row) if row // 12 in there else "0 0 0 0 0 0" for row in range(384)]
    return "name left_forearm\nspatial_sampling taxel\n[calibration]\n" + "\n".join(rows) + "\n"


class Walk:
    def __init__(self, stage, taxeld, bridge, programs):
        self.stage, self.folder, self.port = stage, stage.scratch / "robot", free_port()
        self.folder.mkdir()
        for name, text in {**ROBOT, "left_forearm_V2.txt": positions(), "taxel-bridge.toml": BRIDGE.format(port=self.port)}.items():
            (self.folder / name).write_text(text)
        folders = [str(pathlib.Path(program).resolve().parent) for program in (taxeld, bridge)] + [programs]
        os.environ["PATH"] = ":".join([*folders, os.environ["PATH"]])
        os.environ.setdefault("USER", "ann")
        os.environ["TAXELD_SERVER"] = f"http://127.0.0.1:{self.port}"
        self.robot = Robot(Yarp(stage, programs))

    def begin(self, line):
        log = open(self.stage.scratch / f"line{len(self.stage.processes)}.log", "w")
        process = subprocess.Popen(["bash", "-c", line], cwd=self.folder, stdout=log, stderr=log, start_new_session=True)
        process.log = pathlib.Path(log.name)
        self.stage.processes.append(process)
        return process

    def done(self, line):
        process = self.begin(line)
        until(f"{line} ends", lambda: process.poll() is not None)
        assert process.returncode == 0, process.log.read_text()
        return process.log.read_text()

    def play(self):
        scan, setup, gauge, run, calibrate, read = readme_lines()
        seen = self.done(scan)
        assert re.search(r"/icub/skin/left_forearm: 384 values, [\d.]+ messages/s; triangles alive: board 1: 0-15; board 2: 0-15", seen), seen
        print(seen.splitlines()[0])
        print(self.done(setup).strip())
        self.done(gauge)
        config = self.folder / "taxeld.toml"
        text = config.read_text().replace("/var/lib/taxeld/taxeld.db", str(self.folder / "taxeld.db"))
        config.write_text(f'listen = ["tcp:127.0.0.1:{self.port}"]\n{text}')
        daemon = self.begin(run)
        client = Client(f"127.0.0.1:{self.port}")
        heard = lambda: [bus.up for bus in client.call("SkinService/GetHealth").buses]
        until("skin and gauge are heard", lambda: heard() == [True, True])
        self.calibrate(calibrate.replace("taxeld calibrate", "taxeld calibrate --yes"))
        reader = self.begin(read)
        self.weigh(client, reader)
        for process in (reader, daemon):
            os.killpg(process.pid, signal.SIGTERM)
        self.robot.end()

    def calibrate(self, line):
        line, tare = line.split("; ")
        process = self.begin(line)
        said = lambda words: process.poll() is not None or words in process.log.read_text()
        until("it says to pump", lambda: said("pump:"))
        self.robot.rise_kpa_per_s = 3.0
        until("it says to vent", lambda: said("vent the bag"))
        self.robot.rise_kpa_per_s = -20.0
        until("calibrate ends", lambda: process.poll() is not None)
        assert process.returncode == 0, process.log.read_text()
        # Whoever takes the bag off needs a moment; a busy machine, too.
        until("the skin is tared", lambda: subprocess.run(["bash", "-c", tare], capture_output=True).returncode == 0)
        print(next(line for line in process.log.read_text().splitlines() if "taxels usable" in line).strip())

    def weigh(self, client, reader):
        taxels = client.call("SkinService/GetSkin").taxels
        loaded = [t for t in taxels if t.board == taxels[0].board and t.module in LOADED]
        truth = sum(LOAD_KPA * t.area_mm2 * 1e-3 for t in loaded)
        self.robot.loads = dict.fromkeys(LOADED, LOAD_KPA)

        def totals():
            return [float(found[1]) for found in re.finditer(r"^\((\S+) \S+ \S+\) ", reader.log.read_text(), re.M)]

        until("the load is read", lambda: len([total for total in totals()[-20:] if total > 0.7 * truth]) == 20)
        force = sum(totals()[-20:]) / 20
        print(f"yarp read: {force:.2f} N of {truth:.2f} N ({100 * (force / truth - 1):+.1f} %)")
        assert abs(force / truth - 1) < 0.15, (force, truth)


def main():
    taxeld, bridge, scratch, programs = sys.argv[1:]
    stage = Stage(pathlib.Path(scratch).resolve())
    stage.play(lambda: Walk(stage, taxeld, bridge, programs).play())


main()
