#!/usr/bin/env python3
"""YARP's own name server and programs beside the daemon and the bridge.

    tests/yarp/run.py TAXELD BRIDGE SCRATCH PROGRAMS      (PROGRAMS: what tests/yarp/build prints)
"""

import math
import pathlib
import re
import signal
import socket
import sys
import time

HERE = pathlib.Path(__file__).parent
sys.path[:0] = [str(HERE.parent / "bridge"), str(HERE.parent / "e2e")]
from foreign import Client, enum_name  # noqa: E402
from stage import Stage, free_port, until  # noqa: E402
from yarp import Robot, Yarp, messages  # noqa: E402

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


DAEMON = """
listen = ["tcp:127.0.0.1:{grpc}"]
[store]
path = "{store}"
[[bus]]
name = "robot"
source = "yarp"
server = "127.0.0.1:{yarp}"
[[patch]]
name = "left_forearm"
bus = "robot"
period_ms = 60
port = "/icub/skin/left_forearm"
boards = [{{ address = 13, modules = "0-15" }}, {{ address = 12, modules = "0, 1, 3, 6, 8, 9, 12, 13" }}]
gauge = {{ port = "/bag/pressure:o", index = 1, unit = "kPa" }}
[[patch]]
name = "one_triangle"
bus = "robot"
period_ms = 60
port = "/icub/skin/left_forearm"
boards = [{{ address = 13, modules = "" }}, {{ address = 12, modules = "14" }}]
"""


def numbers(text):
    return [float(word) for word in text.replace("(", " ").replace(")", " ").split()]


def lists(line):
    """The lists in a line, as Python has them."""
    return eval("[" + re.sub(r"(?<=[\w)]) +(?=[-\w(])", ", ", line).replace("(", "[").replace(")", "]") + "]", {"nan": math.nan, "inf": math.inf})


def rows_of(skin):
    """Where the taxels stand in the vector of a port: 192 values a board, in the order of the boards."""
    boards = list(dict.fromkeys(taxel.board for taxel in skin.taxels))
    return {192 * boards.index(t.board) + 12 * t.module + t.slot for t in skin.taxels}


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
        self.strangers()
        self.name_server_restarts(ports, bridge)
        self.names_that_are_taken(ports)
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
        rows = rows_of(skin)
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
        taxels = rows_of(skin)
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

    def strangers(self):
        """More connections than a port takes, of programs that say nothing, shut out others for five seconds."""
        port = "/taxeld/left_forearm/force:o"
        host, number = re.search(r"ip (\S+) port (\d+)", self.yarp.run("name", "query", port)).groups()
        silent = [socket.create_connection((host, int(number))) for _ in range(40)]
        until("a command is answered", lambda: "1 2 3" in self.yarp.run("admin", "rpc", port, text="[ver]\n"))
        for connection in silent:
            connection.close()

    def name_server_restarts(self, ports, bridge):
        self.stage.end(self.yarp.server)
        until("it is said once", lambda: bridge.log.read_text().count("not registered any more") == len(ports))
        self.yarp.serve()
        until("the ports are registered anew", lambda: ports <= self.yarp.names())
        until("that is said, too", lambda: bridge.log.read_text().count("registered again") == len(ports))

    def names_that_are_taken(self, ports):
        second = self.stage.start("second", self.bridge_program, "run", "--config", self.config)
        until("it says so", lambda: "is another program's" in second.log.read_text())
        second.send_signal(signal.SIGTERM)
        second.wait(30)
        assert ports <= self.yarp.names(), "it gives back what it has not"

    def after_a_crash(self, ports):
        bridge = self.stage.start("bridge", self.bridge_program, "run", "--config", self.config)
        until("the ports are registered", lambda: ports <= self.yarp.names())
        bridge.kill()
        bridge.wait(30)
        assert ports <= self.yarp.names(), "a registration outlives its process"
        again = self.stage.start("bridge", self.bridge_program, "run", "--config", self.config)
        reader = self.yarp.read("/test/again", "/taxeld/left_forearm/force:o")
        pressures = self.yarp.read("/test/kpa", "/taxeld/left_forearm/pressure:o")
        until("it is read", lambda: messages(reader) and messages(pressures))
        self.stage.end(self.demo)
        count = len(messages(reader))
        lost = until("the daemon's end is told", lambda: [line for line in messages(reader)[count:] if line.startswith("() () STALE")])
        until("no pressure is left", lambda: set(messages(pressures)[-1].split()) == {"nan"})
        print(f"without the daemon: {lost[-1]}")
        for process in (again, reader, pressures):
            self.stage.end(process)


class In:
    """A skin port as a bus of the daemon."""

    def __init__(self, stage, yarp, taxeld):
        self.yarp, self.taxeld, self.grpc = yarp, taxeld, free_port()
        config = stage.scratch / "port.toml"
        config.write_text(DAEMON.format(grpc=self.grpc, yarp=yarp.port, store=stage.scratch / "port.db"))
        stage.start("taxeld", taxeld, "run", "--config", config)
        self.daemon = Client(f"127.0.0.1:{self.grpc}")

    def bus(self, number=0):
        return until("there is health", lambda: self.daemon.call("SkinService/GetHealth").buses)[number]

    def told(self, words, number=0):
        until(f"health says: {words}", lambda: words in self.bus(number).problem)
        assert not self.bus(number).up
        print(f"health: {self.bus(number).problem}")

    def taxels(self):
        return next(self.daemon.stream("SkinService/StreamTaxels", patch="left_forearm")).taxels

    def fresh(self, count):
        until(f"{count} taxels are fresh", lambda: sum(not taxel.stale for taxel in self.taxels()) == count)

    def play(self):
        self.told("knows no port /icub/skin/left_forearm")
        self.told("knows no port /bag/pressure:o", 1)
        robot = Robot(self.yarp, bag="7 {:.4f}")
        self.fresh(240)
        until("health says so, too", lambda: self.bus().up)
        assert all(238 <= taxel.count <= 240 for taxel in self.taxels())
        tare = lambda: self.daemon.outcome("SkinService/Tare", patch="left_forearm", confirmed_by="test")
        until("the zero holds", lambda: tare()[0] == "OK")
        other = lambda: self.daemon.outcome("SkinService/Tare", patch="one_triangle", confirmed_by="test")
        until("a patch on the second board alone has a zero, too", lambda: other()[0] == "OK")
        assert {taxel.board for taxel in self.daemon.call("SkinService/GetSkin", patch="one_triangle").taxels} == {12}
        gauge = self.daemon.call("SkinService/GetHealth").patches[0].gauge_kpa
        assert 0 < gauge < 0.3, gauge
        for frozen, fresh in ((1, 230), (16, 80), (32, 0)):  # a triangle, a board, the robot: fresh stamps all the time
            begun = time.monotonic()
            robot.frozen = set(range(frozen))
            self.fresh(fresh)
            print(f"{frozen} triangles that stay the same: silent after {time.monotonic() - begun:.2f} s")
        state = enum_name(self.daemon.call("ForceService/GetForce", patch="left_forearm"), "state")
        assert state not in ("FORCE_STATE_OK", "FORCE_STATE_DEGRADED"), state
        robot.frozen = set()
        self.fresh(240)
        for odd, words in (("1 2 3", "it sends 3 values, expected 384"), ("240.0 x", 'value 1 is "x"')):
            robot.odd = odd
            self.told(words)
            until("the gauge is heard meanwhile", lambda: self.bus(1).up)
        robot.odd = None
        self.fresh(240)
        robot.end()
        self.told("/icub/skin/left_forearm")
        robot.start()
        self.fresh(240)
        refused = self.daemon.refused("SkinService/BringUp", patch="left_forearm", confirmed_by="test")
        print(f"bring-up: {refused[1]}")
        robot.end()


def main():
    taxeld, bridge, scratch, programs = sys.argv[1:]
    stage = Stage(pathlib.Path(scratch).resolve())
    def play():
        yarp = Yarp(stage, programs)
        In(stage, yarp, taxeld).play()
        Out(stage, yarp, taxeld, bridge).play()
    stage.play(play)


main()
