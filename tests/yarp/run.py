#!/usr/bin/env python3
"""YARP's own name server and programs beside the daemon and the bridge.

    tests/yarp/run.py TAXELD BRIDGE SCRATCH PROGRAMS      (PROGRAMS: what tests/yarp/build prints)
"""

import math
import pathlib
import re
import signal
import subprocess
import sys

HERE = pathlib.Path(__file__).parent
sys.path[:0] = [str(HERE.parent / "bridge"), str(HERE.parent / "e2e")]
from foreign import Client, enum_name  # noqa: E402
from stage import Stage, free_port, until  # noqa: E402
from yarp import Yarp, messages  # noqa: E402

BRIDGE = """
robot = "icub01"
[daemon]
server = "http://127.0.0.1:{grpc}"
[yarp]
server = "127.0.0.1:{yarp}"
skin_events = "/skinManager/skin_events:o"
[[patch]]
name = "left_forearm"
"""

FORCE = re.compile(r"^\((.*?)\) \((.*?)\) (\w+) \((.*?)\) (\S+)$")


def numbers(text):
    return [float(word) for word in text.replace("(", " ").replace(")", " ").split()]


def lists(line):
    """The lists in a line, as Python has them."""
    return eval("[" + re.sub(r"(?<=[\w)]) +(?=[-\w(])", ", ", line).replace("(", "[").replace(")", "]") + "]", {"nan": math.nan, "inf": math.inf})


class Out:
    """What programs of YARP read of the bridge."""

    def __init__(self, stage, yarp, taxeld, bridge):
        self.stage, self.yarp, self.bridge_program = stage, yarp, bridge
        self.grpc = free_port()
        self.demo = stage.start("demo", taxeld, "demo", "--listen", f"127.0.0.1:{self.grpc}")
        self.config = stage.scratch / "bridge.toml"
        self.config.write_text(BRIDGE.format(grpc=self.grpc, yarp=yarp.port))

    def play(self):
        bridge = self.stage.start("bridge", self.bridge_program, "run", "--config", self.config)
        ports = {"/taxeld/left_forearm/force:o", "/taxeld/left_forearm/pressure:o", "/skinManager/skin_events:o"}
        until("the ports are registered", lambda: ports <= self.yarp.names())
        self.daemon = Client(f"127.0.0.1:{self.grpc}")
        self.forces()
        self.contacts()
        self.pressures()
        self.hung_and_removed()
        self.name_server_restarts(ports)
        self.names_that_are_taken()
        bridge.send_signal(signal.SIGTERM)
        bridge.wait(30)
        until("the names are given back", lambda: not ports & self.yarp.names())
        self.after_a_crash(ports)

    def samples(self):
        for sample in self.daemon.stream("ForceService/StreamForce"):
            if enum_name(sample, "state") in ("FORCE_STATE_OK", "FORCE_STATE_DEGRADED"):
                yield sample

    def forces(self):
        reader = self.yarp.read("/test/force", "/taxeld/left_forearm/force:o")
        said = set()
        for sample in self.samples():
            said.add(round(sample.total_n, 6))
            if len(said) > 60 and any(total > 4 for total in said):
                break
        read = until("forces are read", lambda: [FORCE.match(line) for line in messages(reader)][-200:])
        assert all(read), messages(reader)[-3:]
        good = [numbers(line[1]) for line in read if line[1]]
        totals = [total for total, *_ in good]
        assert len(good) > 50 and all(low <= total <= high for total, low, high in good), good[-3:]
        same = sum(round(total, 6) in said for total in totals)
        assert same > 0.5 * len(totals), f"{same} of {len(totals)} are forces of the daemon"
        print(f"force:o: {len(good)} forces, {same} of them seen in GetForce's stream too, to 1e-6 N")
        self.yarp.run("disconnect", "/taxeld/left_forearm/force:o", "/test/force")
        self.stage.end(reader)

    def contacts(self):
        reader = self.yarp.read("/test/events", "/skinManager/skin_events:o")
        def pressed():
            found = [lists(line) for line in messages(reader) if line.strip()]
            return [contacts for contacts in found if contacts] if len(found) > 20 else []
        # The demo's mass lies for five seconds out of ten.
        found = until("contacts are read", pressed)
        skin = self.daemon.call("SkinService/GetSkin", patch="left_forearm")
        rows = {192 * t.board + 12 * t.module + t.slot for t in skin.taxels}
        for contacts in found[-20:]:
            for contact in contacts:
                ids, centre, force, moment, place, normal, taxels, pressure = contact
                assert len(ids) == 4 and ids[1:] == [3, 4, 2], contact
                assert [len(part) for part in (centre, force, moment, place, normal)] == [3] * 5, contact
                assert taxels and set(taxels) <= rows and all(isinstance(t, int) for t in ids + taxels), contact
                assert sum(f * n for f, n in zip(force, normal)) < 0, "the force points into the skin"
                assert pressure > 0
        strongest = max(math.hypot(*contact[2]) for contacts in found for contact in contacts)
        assert 3 < strongest < 7, f"{strongest} N of a mass of 0.5 kg"
        numbers_seen = {contact[0][0] for contacts in found[-20:] for contact in contacts}
        print(f"skin_events:o: {len(found)} messages with contacts, the strongest {strongest:.2f} N, ids {sorted(numbers_seen)}")
        self.stage.end(reader)

    def pressures(self):
        reader = self.yarp.read("/test/pressure", "/taxeld/left_forearm/pressure:o")
        lines = until("pressures are read", lambda: messages(reader)[10:])
        rows = numbers(lines[-1])
        skin = self.daemon.call("SkinService/GetSkin", patch="left_forearm")
        taxels = {192 * t.board + 12 * t.module + t.slot for t in skin.taxels}
        there = {row for row, kpa in enumerate(rows) if not math.isnan(kpa)}
        # Excluded and faulty taxels have none.
        assert len(rows) == 384 and there <= taxels and len(there) > 150, (there - taxels, len(there))
        self.stage.end(reader)

    def hung_and_removed(self):
        """A reader that is stopped, and one that dies, cost the others nothing."""
        hung = self.yarp.read("/test/hung", "/taxeld/left_forearm/force:o")
        dead = self.yarp.read("/test/dead", "/taxeld/left_forearm/force:o")
        other = self.yarp.read("/test/other", "/taxeld/left_forearm/force:o")
        for reader in (hung, dead, other):
            until("it reads", lambda reader=reader: messages(reader))
        hung.send_signal(signal.SIGSTOP)
        dead.kill()
        count = len(messages(other))
        until("the other reads on", lambda: len(messages(other)) > count + 200)
        answer = self.yarp.run("admin", "rpc", "/taxeld/left_forearm/force:o", text="[list] [out]\n[list] [out] /test/other\n")
        assert "/test/other" in answer and "/test/dead" not in answer and "carrier" in answer, answer
        assert "/taxeld/left_forearm/force:o" in self.yarp.run("ping", "/taxeld/left_forearm/force:o")
        self.yarp.run("disconnect", "/taxeld/left_forearm/force:o", "/test/other")
        until("it is removed", lambda: "/test/other" not in self.yarp.run("admin", "rpc", "/taxeld/left_forearm/force:o", text="[list] [out]\n"))
        hung.send_signal(signal.SIGCONT)
        for reader in (hung, other):
            self.stage.end(reader)

    def name_server_restarts(self, ports):
        self.stage.end(self.yarp.server)
        self.yarp.serve()
        until("the ports are registered anew", lambda: ports <= self.yarp.names())

    def names_that_are_taken(self):
        second = self.stage.start("second", self.bridge_program, "run", "--config", self.config)
        until("it says so", lambda: "is another program's" in second.log.read_text())
        self.stage.end(second)

    def after_a_crash(self, ports):
        bridge = self.stage.start("bridge", self.bridge_program, "run", "--config", self.config)
        until("the ports are registered", lambda: ports <= self.yarp.names())
        bridge.kill()
        bridge.wait(30)
        assert ports <= self.yarp.names(), "a registration outlives its process"
        again = self.stage.start("bridge", self.bridge_program, "run", "--config", self.config)
        reader = self.yarp.stage.start("read", self.yarp.programs / "yarp", "read", "/test/again")
        until("it has the names", lambda: "Success" in subprocess.run(
            [self.yarp.programs / "yarp", "connect", "/taxeld/left_forearm/force:o", "/test/again"], capture_output=True, text=True).stdout)
        until("it is read", lambda: messages(reader))
        self.stage.end(self.demo)
        count = len(messages(reader))
        lost = until("the daemon's end is told", lambda: [line for line in messages(reader)[count:] if line.startswith("() () STALE")])
        print(f"without the daemon: {lost[-1]}")
        for process in (again, reader):
            self.stage.end(process)


def main():
    taxeld, bridge, scratch, programs = sys.argv[1:]
    stage = Stage(pathlib.Path(scratch).resolve())
    def play():
        yarp = Yarp(stage, programs)
        Out(stage, yarp, taxeld, bridge).play()
    stage.play(play)


main()
