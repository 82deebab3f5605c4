#!/usr/bin/env python3
"""The bridge between the demo's skin and a router of Zenoh, read by foreign hands.

    tests/bridge/run.py TAXELD BRIDGE SCRATCH

Needs the Python packages eclipse-zenoh, rosbags, xxhash, grpcio and grpcio-reflection.
"""

import json
import math
import pathlib
import signal
import struct
import subprocess
import sys
import threading

import grpc
from google.protobuf.message_factory import GetMessageClass

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "e2e"))
from foreign import Client, enum_name  # noqa: E402

import ros  # noqa: E402
from acl import acl  # noqa: E402
from stage import PATIENCE_S, Stage, client, free_port, until  # noqa: E402

# A busy machine may hold up a scan; that is not what is tested here.
AGE_MAX_MS = 150
PATCH = "/skin/left_forearm"

CONFIG = """
robot = "icub01"
[daemon]
server = "http://127.0.0.1:{grpc}"
[zenoh]
router = "{router}"
[ros]
domain = 7
tare = true
[fleet]
rate_hz = 20.0
[[patch]]
name = "left_forearm"
frame = "l_forearm_skin"
taxels_hz = 10.0
"""


def stamp(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


class Truth:
    """What the daemon itself says, by the stamp of the sample's newest frame."""

    def __init__(self, address):
        self.client, self.forces, self.taxels = Client(address), {}, {}
        for name, kept in [("ForceService/StreamForce", self.forces), ("SkinService/StreamTaxels", self.taxels)]:
            stream = self.client.stream(name, timeout=3600)
            threading.Thread(target=self._read, args=(stream, kept), daemon=True).start()

    def _read(self, stream, kept):
        try:
            for sample in stream:
                if sample.HasField("time"):
                    # A sample without a new frame has the stamp of the one before.
                    kept.setdefault(sample.time.ToNanoseconds(), []).append(sample)
        except grpc.RpcError:
            pass  # the daemon is killed on purpose

    def good(self, stamp):
        """Its forces of that stamp; none if it was not heard then."""
        states = ("FORCE_STATE_OK", "FORCE_STATE_DEGRADED")
        return [sample for sample in list(self.forces.get(stamp, [])) if enum_name(sample, "state") in states]

    def totals(self):
        return {sample.total_n for samples in list(self.forces.values()) for sample in list(samples)}


class Scene:
    def __init__(self, taxeld, bridge, scratch):
        self.stage, self.taxeld, self.bridge = Stage(scratch), taxeld, bridge
        self.grpc, self.endpoint = free_port(), f"tcp/127.0.0.1:{free_port()}"
        self.config = scratch / "taxel-bridge.toml"
        self.config.write_text(CONFIG.format(grpc=self.grpc, router=self.endpoint))

    def start_daemon(self):
        self.daemon = self.stage.start("taxeld", self.taxeld, "demo", "--listen", f"127.0.0.1:{self.grpc}")
        until("the demo serves", lambda: "live on" in self.daemon.log.read_text() or self.daemon.poll())
        assert self.daemon.poll() is None, self.daemon.log.read_text()
        self.truth = Truth(f"127.0.0.1:{self.grpc}")

    def start_router(self):
        self.router = self.stage.router(self.endpoint)

    def start_bridge(self):
        self.process = self.stage.start("bridge", self.bridge, "run", "--config", self.config)

    def read(self):
        self.session = client(self.endpoint)
        self.graph = ros.Graph(self.session, 7)
        names = ["wrench", "force", "centre_of_pressure", "taxels"]
        wanted = [f"{PATCH}/{name}" for name in names] + ["/diagnostics"]
        until("the topics", lambda: set(wanted) <= set(self.graph.topics()))
        topics = self.graph.topics()
        self.topics = {name.split("/")[-1]: ros.Topic(self.session, 7, topics[name]) for name in wanted}

    def status(self, name):
        """The newest diagnostic of that name."""
        for _, _, message in reversed(self.topics["diagnostics"].since(0)):
            for status in message.status:
                if status.name == name:
                    return status
        return None

    def force_status(self):
        return self.status("taxel: force of left_forearm")

    def until_wrench(self, what):
        count = self.topics["wrench"].count()
        until(f"wrenches {what}", lambda: self.topics["wrench"].count() > count + 10)


def types_and_tokens(scene):
    """What `ros2 node list`, `ros2 topic list -t` and `ros2 service list -t` would show."""
    [node] = scene.graph.all("NN")
    assert (node.namespace, node.node) == ("/skin", "taxel_bridge"), node.token
    shown = {name: ros.ros_type(endpoint.type) for name, endpoint in scene.graph.topics().items()}
    assert shown == {
        f"{PATCH}/wrench": "geometry_msgs/msg/WrenchStamped",
        f"{PATCH}/force": "sensor_msgs/msg/JointState",
        f"{PATCH}/centre_of_pressure": "geometry_msgs/msg/PointStamped",
        f"{PATCH}/taxels": "sensor_msgs/msg/PointCloud2",
        "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    }, shown
    until("the services", lambda: set(scene.graph.services()) == {"/skin/tare", f"{PATCH}/tare"})
    for endpoint in scene.graph.all("MP") + scene.graph.all("SS"):
        assert endpoint.hash == ros.type_hash(endpoint.type), f"{endpoint.name}: {endpoint.hash}"
    print(f"{len(shown)} topics and 2 services, as ROS lists them, with the hashes of rosbags", flush=True)


def values(scene):
    """Every value is the daemon's own, bit for bit, of the same stamp."""
    def both():
        wrenches = scene.topics["wrench"].since(0)
        return sum(stamp(message) in scene.truth.forces for _, _, message in wrenches) > 60

    scene.until_wrench("at the beginning")
    until("wrenches beside the daemon's own samples", both)
    until("clouds", lambda: scene.topics["taxels"].count() > 10)
    compared, xyz = 0, lambda vector: (vector.x, vector.y, vector.z)
    for _, _, message in scene.topics["wrench"].since(0):
        assert message.header.frame_id == "l_forearm_skin"
        if stamp(message) in scene.truth.forces:
            mine = xyz(message.wrench.force), xyz(message.wrench.torque)
            its = [(xyz(sample.resultant_n), xyz(sample.moment_nm)) for sample in scene.truth.good(stamp(message))]
            assert mine in its, f"{mine} {its}"
            compared += 1
    for _, _, message in scene.topics["force"].since(0):
        if stamp(message) in scene.truth.forces:
            named = dict(zip(message.name, message.effort))
            assert any(
                (named["force_N"], named["lower_bound"]) == (sample.total_n, float(sample.lower_bound))
                and math.isclose(named["variance_N2"], sample.total_sigma_n**2, rel_tol=1e-12)
                for sample in scene.truth.good(stamp(message))), named
    for _, _, message in scene.topics["centre_of_pressure"].since(0):
        if stamp(message) in scene.truth.forces:
            its = [xyz(sample.centre_of_pressure_m) for sample in scene.truth.good(stamp(message))]
            assert xyz(message.point) in its
    print(f"{compared} wrenches are the daemon's own, and so are forces and centres of pressure", flush=True)


def clouds(scene):
    layout, compared = scene.truth.client.call("SkinService/GetSkin").taxels, 0
    for _, _, cloud in scene.topics["taxels"].since(0):
        assert [field.name for field in cloud.fields] == ["x", "y", "z", "pressure", "taxel", "sigma", "range"]
        assert len(cloud.data) == cloud.width * cloud.point_step == cloud.row_step
        samples = scene.truth.taxels.get(stamp(cloud), [])
        points = list(struct.iter_unpack("<4fIfI", bytes(cloud.data)))
        assert all(math.isfinite(number) for point in points for number in point)
        for x, y, z, pressure, taxel, sigma, in_range in points:
            at = layout[taxel].position_m
            assert (x, y, z) == tuple(struct.unpack("<3f", struct.pack("<3f", at.x, at.y, at.z)))
            if samples:
                assert any(math.isclose(pressure, sample.taxels[taxel].pressure_kpa * 1000, rel_tol=1e-6, abs_tol=1e-6)
                           and math.isclose(sigma, sample.taxels[taxel].sigma_kpa * 1000, rel_tol=1e-6)
                           and in_range == sample.taxels[taxel].range
                           for sample in samples), (taxel, pressure, sigma, in_range)
                compared += 1
    assert compared > 500, f"{compared} taxels compared"
    print(f"{compared} taxels of the clouds are the daemon's own", flush=True)


def tare(scene):
    """Refused while something lies there, and with the daemon's reason; else the zero is new."""
    services = scene.graph.services()
    for name in ["/skin/tare", f"{PATCH}/tare"]:
        service = ros.TriggerClient(scene.session, 7, services[name])
        epoch = lambda: scene.truth.client.call("SkinService/GetHealth").patches[0].tare.epoch
        before = epoch()

        def taken():
            success, message = service.call(PATIENCE_S)
            assert message.startswith("left_forearm: "), message
            assert success or "refused: " in message, message
            return success and message

        print(f"{name}: {until('a zero', taken)}", flush=True)
        # The answer comes with the zero, the health with the next scan.
        until("the new zero in the health", lambda: epoch() > before)


def stopped_daemon(scene):
    """A daemon that hangs: no wrench, and the diagnostics say why; afterwards all is well again."""
    scene.daemon.send_signal(signal.SIGSTOP)
    try:
        until("the diagnostics say so", lambda: scene.force_status().level != 0 and (
            "ms old, more than" in scene.force_status().message or "stream was lost" in scene.force_status().message))
        print(f"while the daemon hangs: {scene.force_status().message}", flush=True)
        nothing_comes(scene)
    finally:
        scene.daemon.send_signal(signal.SIGCONT)
    service, count = ros.TriggerClient(scene.session, 7, scene.graph.services()["/skin/tare"]), scene.topics["wrench"].count()

    def good():
        """Boards that were not heard for so long may have taken a new zero: the daemon may want another one first. If the mass
        was lifted meanwhile, it also wants somebody's word for it."""
        if "TARE_INVALID" in scene.force_status().message:
            success, message = service.call(PATIENCE_S)
            if not success and "ask for BringUp" in message:
                scene.truth.client.call("SkinService/BringUp", confirmed_by="the test")
        return scene.topics["wrench"].count() > count + 10

    until("wrenches after the daemon hung", good)


def nothing_comes(scene):
    """Two rounds of diagnostics go by without a force."""
    counts = {name: scene.topics[name].count() for name in ["wrench", "force", "centre_of_pressure", "diagnostics"]}
    until("two more diagnostics", lambda: scene.topics["diagnostics"].count() > counts["diagnostics"] + 1)
    for name in ["wrench", "force", "centre_of_pressure"]:
        assert scene.topics[name].count() == counts[name], f"{name} goes on"


def killed_daemon(scene):
    scene.daemon.kill()
    until("the diagnostics say so", lambda: "stream was lost" in scene.force_status().message)
    status = scene.force_status()
    assert status.level == 2 and "no force is published" in status.message, status
    until("the daemon itself is missed", lambda: scene.status("taxel: daemon").level == 2)
    print(f"after the daemon was killed: {status.message}", flush=True)
    nothing_comes(scene)
    scene.start_daemon()
    scene.until_wrench("of the daemon that came back")
    until("the diagnostics are content", lambda: "no force" not in scene.force_status().message)


def killed_router(scene):
    scene.stage.end(scene.router)
    until("nobody is there", lambda: not scene.graph.all("NN"))
    scene.start_router()
    until("the node is back", lambda: len(scene.graph.topics()) == 5)
    scene.until_wrench("through the router that came back")
    print("after the router was killed: all topics are back by themselves", flush=True)


def nothing_else(scene):
    """Over the whole run: no number that is none, numbers that go up by one, no stamp twice, nothing old as new."""
    for name, topic in scene.topics.items():
        topic.subscriber.undeclare()
        messages = topic.since(0)
        assert not topic.faults, f"{name}: {topic.faults[:3]}"
        for _, _, message in messages:
            assert all(math.isfinite(number) for number in ros.numbers(message)), message
        sequences = [attachment.sequence for _, attachment, _ in messages]
        assert all(a < b for a, b in zip(sequences, sequences[1:])), name
        if name in ("wrench", "force", "centre_of_pressure"):
            stamps = [stamp(message) for _, _, message in messages]
            assert stamps == sorted(stamps), f"{name}: an old value came after a newer one"
            # The daemon itself may send a frame's force more than once, each to this client and to that one as often as
            # it gets round to it: so no count is compared, and the stamps above say that none comes back later.
            # What the bridge judged is at most AGE_MAX_MS old; it may itself be held up between judging and sending.
            late = max(attachment.time_ns - stamp(message) for _, attachment, message in messages)
            assert late < (AGE_MAX_MS / 1000 + 5) * 1e9, f"{name}: sent {late / 1e9} s after its stamp"
    counts = {name: topic.count() for name, topic in scene.topics.items()}
    print(f"no number that is none and nothing old as new in {counts}", flush=True)


class FleetView:
    def __init__(self, scene):
        self.lines = []
        self.process = scene.stage.start(
            "fleet", scene.bridge, "fleet", "--router", scene.endpoint, "--json", stdout=subprocess.PIPE)
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.append(json.loads(line))

    def row(self):
        return self.lines[-1]["rows"][0] if self.lines and self.lines[-1]["rows"] else {}


def fleet(scene):
    """One robot of a fleet, by our own view and by foreign hands."""
    view, raw = FleetView(scene), []
    reader = scene.session.declare_subscriber("taxel/icub01/force/*", lambda sample: raw.append(bytes(sample.payload)))
    whole = lambda row: row.get("state") in ("OK", "DEGRADED") and row["calibrated"] and row["zero_valid"]
    until("the robot with its model set and its zero", lambda: whole(view.row()))
    row = view.row()
    assert row["zero_taken"] > 1.6e9, row
    until("a force of the daemon's", lambda: view.row()["force_n"] in scene.truth.totals())
    until("forces by foreign hands", lambda: len(raw) > 20)
    pool = scene.truth.client.pool
    decode = GetMessageClass(pool.FindMessageTypeByName("taxel.v1.ForceSample")).FromString
    known = {one.sequence: one.total_n for samples in list(scene.truth.forces.values()) for one in list(samples)}
    compared = [sample for sample in map(decode, raw) if sample.HasField("total_n") and sample.sequence in known]
    assert len(compared) > 5 and all(sample.total_n == known[sample.sequence] for sample in compared)
    assert row["model_set"] in {sample.model_set for sample in compared}, row
    reader.undeclare()
    print(f"fleet: {row['state']}, {row['force_n']} N, {row['excluded']} excluded, models {row['model_set']}", flush=True)
    return view


def killed_bridge(scene, view):
    """The daemon does not notice, the fleet does, and ROS sees no node any more."""
    count = len(scene.truth.forces)
    scene.process.kill()
    until("the fleet says so", lambda: view.row()["state"] == "SILENT")
    row = view.row()
    assert row["force_n"] is None, row
    until("no node", lambda: not scene.graph.all("NN") and not scene.graph.topics())
    until("the daemon goes on", lambda: len(scene.truth.forces) > count + 20)
    until("the daemon has let go of its streams",
          lambda: scene.truth.client.call("SkinService/GetHealth").streams == 2)
    scene.start_bridge()
    until("it is back", lambda: view.row().get("state") in ("OK", "DEGRADED"))
    print("the bridge was killed: the fleet saw it, the daemon did not", flush=True)


def fleet_table(scene):
    """What an operator sees who does not ask for JSON."""
    command = [scene.bridge, "fleet", "--router", scene.endpoint, "--once"]
    seen = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    assert seen.returncode == 0 and "left_forearm" in seen.stdout and "icub01" in seen.stdout, seen
    print(seen.stdout.rstrip(), flush=True)


def ended(scene, view):
    """A service manager asks bridge and view to end, and they do, without a word of an error."""
    view.process.terminate()
    assert view.process.wait(20) == 0, view.process.log.read_text()
    scene.process.terminate()
    assert scene.process.wait(20) == 0, scene.process.log.read_text()
    assert "as it was asked to" in scene.process.log.read_text()
    scene.start_bridge()


def play(scene, scratch):
    # The bridge comes first: neither router nor daemon is there yet.
    scene.start_bridge()
    scene.start_router()
    scene.start_daemon()
    scene.read()
    types_and_tokens(scene)
    values(scene)
    clouds(scene)
    tare(scene)
    view = fleet(scene)
    stopped_daemon(scene)
    killed_daemon(scene)
    killed_router(scene)
    nothing_else(scene)
    killed_bridge(scene, view)
    fleet_table(scene)
    ended(scene, view)
    acl(scene.stage, scratch)
    print("the bridge holds", flush=True)


def main():
    scene = Scene(sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3]))
    scene.stage.play(lambda: play(scene, scene.stage.scratch))


if __name__ == "__main__":
    main()
