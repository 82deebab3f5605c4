"""The demo's skin, the bridge and what a reader of ROS 2 must see of them, whatever carries it.

A reader (`rmw_zenoh.Ros`, `real_ros.Ros`) has `nodes()`, `topics()` and `services()`, which are name -> type, `subscribe(name)` with
`since(count)` -> [(came, sent_ns, message)], `count()` and `faults`, and `trigger(name)` -> function of seconds -> (success, message).
"""

import math
import pathlib
import signal
import struct
import sys
import threading

import grpc

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "e2e"))
from foreign import Client, enum_name  # noqa: E402

from stage import PATIENCE_S, Stage, free_port, until  # noqa: E402

# A busy machine may hold up a scan; that is not what is tested here.
AGE_MAX_MS = 150
PATCH = "/skin/left_forearm"
FORCES = ["wrench", "force", "centre_of_pressure"]
TOPICS = {
    f"{PATCH}/wrench": "geometry_msgs/msg/WrenchStamped",
    f"{PATCH}/force": "sensor_msgs/msg/JointState",
    f"{PATCH}/centre_of_pressure": "geometry_msgs/msg/PointStamped",
    f"{PATCH}/taxels": "sensor_msgs/msg/PointCloud2",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
SERVICES = ["/skin/tare", f"{PATCH}/tare"]

CONFIG = """
robot = "icub01"
[daemon]
server = "http://127.0.0.1:{grpc}"
{sections}
[[patch]]
name = "left_forearm"
frame = "l_forearm_skin"
taxels_hz = 10.0
"""


def stamp(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def level(status):
    """rclpy has the type `byte` as one byte."""
    return status.level[0] if isinstance(status.level, bytes) else status.level


def xyz(vector):
    return vector.x, vector.y, vector.z


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
    def __init__(self, taxeld, bridge, scratch, sections):
        self.stage, self.taxeld, self.bridge = Stage(scratch), taxeld, bridge
        self.grpc = free_port()
        self.config = self.configuration("taxel-bridge.toml", sections)

    def configuration(self, name, sections):
        config = self.stage.scratch / name
        config.write_text(CONFIG.format(grpc=self.grpc, sections=sections))
        return config

    def start_daemon(self):
        self.daemon = self.stage.start("taxeld", self.taxeld, "demo", "--listen", f"127.0.0.1:{self.grpc}")
        until("the demo serves", lambda: "live on" in self.daemon.log.read_text() or self.daemon.poll())
        assert self.daemon.poll() is None, self.daemon.log.read_text()
        self.truth = Truth(f"127.0.0.1:{self.grpc}")

    def start_bridge(self, config=None):
        process = self.stage.start("bridge", self.bridge, "run", "--config", config or self.config)
        if config is None:
            self.process = process
        return process

    def read(self, ros):
        self.ros = ros
        until("the topics", lambda: set(TOPICS) <= set(ros.topics()))
        self.topics = {name.split("/")[-1]: ros.subscribe(name) for name in TOPICS}

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


def graph(scene):
    """What `ros2 node list`, `ros2 topic list -t` and `ros2 service list` show."""
    until("the node", lambda: ("/skin", "taxel_bridge") in scene.ros.nodes())
    shown = scene.ros.topics()
    assert {name: shown[name] for name in TOPICS} == TOPICS, shown
    until("the services", lambda: set(SERVICES) <= set(scene.ros.services()))
    assert all(scene.ros.services()[name] == "std_srvs/srv/Trigger" for name in SERVICES), scene.ros.services()
    print(f"{len(TOPICS)} topics and {len(SERVICES)} services, as ROS lists them", flush=True)


def values(scene):
    """Every value is the daemon's own, bit for bit, of the same stamp."""
    def both():
        wrenches = scene.topics["wrench"].since(0)
        return sum(stamp(message) in scene.truth.forces for _, _, message in wrenches) > 60

    scene.until_wrench("at the beginning")
    until("wrenches beside the daemon's own samples", both)
    until("clouds", lambda: scene.topics["taxels"].count() > 10)
    compared = 0
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
                (named["force_N"], named["low_N"]) == (sample.total_n, sample.low_n)
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
    for name in SERVICES:
        call = scene.ros.trigger(name)
        epoch = lambda: scene.truth.client.call("SkinService/GetHealth").patches[0].tare.epoch
        before = epoch()

        def taken():
            success, message = call(PATIENCE_S)
            assert message.startswith("left_forearm: "), message
            assert success or "refused: " in message, message
            return success and message

        print(f"{name}: {until('a zero', taken)}", flush=True)
        # The answer comes with the zero, the health with the next scan.
        until("the new zero in the health", lambda: epoch() > before)


def nothing_comes(scene):
    """Two rounds of diagnostics go by without a force."""
    counts = {name: scene.topics[name].count() for name in [*FORCES, "diagnostics"]}
    until("two more diagnostics", lambda: scene.topics["diagnostics"].count() > counts["diagnostics"] + 1)
    for name in FORCES:
        assert scene.topics[name].count() == counts[name], f"{name} goes on"


def stopped_daemon(scene):
    """A daemon that hangs: no wrench, and the diagnostics say why; afterwards all is well again."""
    scene.daemon.send_signal(signal.SIGSTOP)
    try:
        until("the diagnostics say so", lambda: level(scene.force_status()) != 0 and (
            "ms old, more than" in scene.force_status().message or "stream was lost" in scene.force_status().message))
        print(f"while the daemon hangs: {scene.force_status().message}", flush=True)
        nothing_comes(scene)
    finally:
        scene.daemon.send_signal(signal.SIGCONT)
    call, count = scene.ros.trigger("/skin/tare"), scene.topics["wrench"].count()

    def good():
        """Boards that were not heard for so long may have taken a new zero: the daemon may want another one first. If the mass
        was lifted meanwhile, it also wants somebody's word for it."""
        if "TARE_INVALID" in scene.force_status().message:
            success, message = call(PATIENCE_S)
            if not success and "taxeld bring-up" in message:
                scene.truth.client.call("SkinService/BringUp", confirmed_by="the test")
        return scene.topics["wrench"].count() > count + 10

    until("wrenches after the daemon hung", good)


def killed_daemon(scene):
    scene.daemon.kill()
    until("the diagnostics say so", lambda: "stream was lost" in scene.force_status().message)
    status = scene.force_status()
    assert level(status) == 2 and "no force is published" in status.message, status
    until("the daemon itself is missed", lambda: level(scene.status("taxel: daemon")) == 2)
    print(f"after the daemon was killed: {status.message}", flush=True)
    nothing_comes(scene)
    scene.start_daemon()
    scene.until_wrench("of the daemon that came back")
    until("the diagnostics are content", lambda: "no force" not in scene.force_status().message)


def numbers(message):
    """Every floating-point number of a message, however deep."""
    if isinstance(message, float):
        yield message
    elif isinstance(message, (list, tuple)) or getattr(getattr(message, "dtype", None), "kind", "") == "f":
        for item in message:
            yield from numbers(float(item) if hasattr(message, "dtype") else item)
    elif getattr(message, "typecode", "") == "d":
        yield from message
    elif hasattr(message, "get_fields_and_field_types"):  # rclpy
        for field in message.get_fields_and_field_types():
            yield from numbers(getattr(message, field))
    elif hasattr(message, "__dataclass_fields__"):  # rosbags
        for field in message.__dataclass_fields__:
            yield from numbers(getattr(message, field))


def nothing_else(scene):
    """Over the whole run: no number that is none, nothing old as new."""
    for name, topic in scene.topics.items():
        messages = topic.since(0)
        assert not topic.faults, f"{name}: {topic.faults[:3]}"
        for _, _, message in messages:
            assert all(math.isfinite(number) for number in numbers(message)), message
        if name in FORCES:
            stamps = [stamp(message) for _, _, message in messages]
            assert stamps == sorted(stamps), f"{name}: an old value came after a newer one"
            # The daemon itself may send a frame's force more than once, each to this client and to that one as often as
            # it gets round to it: so no count is compared, and the stamps above say that none comes back later.
            # What the bridge judged is at most AGE_MAX_MS old; it may itself be held up between judging and sending.
            late = max(sent_ns - stamp(message) for _, sent_ns, message in messages)
            assert late < (AGE_MAX_MS / 1000 + 5) * 1e9, f"{name}: sent {late / 1e9} s after its stamp"
    counts = {name: topic.count() for name, topic in scene.topics.items()}
    print(f"no number that is none and nothing old as new in {counts}", flush=True)


def ended(scene):
    """A service manager asks the bridge to end, and it does, without a word of an error."""
    scene.process.terminate()
    assert scene.process.wait(20) == 0, scene.process.log.read_text()
    assert "as it was asked to" in scene.process.log.read_text()
