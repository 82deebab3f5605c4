#!/usr/bin/env python3
"""The bridge between the demo's skin and a router of Zenoh, read by foreign hands: rmw_zenoh's topics, and the fleet.

    tests/bridge/run.py TAXELD BRIDGE SCRATCH

Needs the Python packages eclipse-zenoh, rosbags, xxhash, grpcio and grpcio-reflection. A payload of each topic goes to
SCRATCH/payloads, for a real ROS to decode (dds.py).
"""

import json
import pathlib
import subprocess
import sys
import threading

from google.protobuf.message_factory import GetMessageClass

import rmw_zenoh
import scene as shared
from acl import acl
from stage import PATIENCE_S, free_port, until

SECTIONS = """
[zenoh]
router = "{router}"
[ros]
middleware = "zenoh"
domain = 7
tare = true
[fleet]
rate_hz = 20.0
"""


def hashes(scene):
    """The library of others works them out from the definitions."""
    graph = scene.ros.graph
    for endpoint in graph.all("MP") + graph.all("SS"):
        assert endpoint.hash == rmw_zenoh.type_hash(endpoint.type), f"{endpoint.name}: {endpoint.hash}"
    print("the hashes of all types are those of rosbags", flush=True)


def payloads(scene):
    folder = scene.stage.scratch / "payloads"
    folder.mkdir()
    for name, topic in scene.topics.items():
        kind = rmw_zenoh.ros_type(topic.endpoint.type).replace("/msg/", ".")
        (folder / f"{name}.{kind}").write_bytes(topic.payload)


def killed_router(scene):
    scene.stage.end(scene.router)
    until("nobody is there", lambda: not scene.ros.nodes())
    scene.router = scene.stage.router(scene.router_endpoint)
    until("the node is back", lambda: set(shared.TOPICS) == set(scene.ros.topics()))
    scene.until_wrench("through the router that came back")
    print("after the router was killed: all topics are back by themselves", flush=True)


class FleetView:
    def __init__(self, scene):
        self.lines = []
        self.process = scene.stage.start(
            "fleet", scene.bridge, "fleet", "--router", scene.router_endpoint, "--json", stdout=subprocess.PIPE)
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.append(json.loads(line))

    def row(self):
        return self.lines[-1]["rows"][0] if self.lines and self.lines[-1]["rows"] else {}


def fleet(scene):
    """One robot of a fleet, by our own view and by foreign hands."""
    view, raw = FleetView(scene), []
    reader = scene.ros.session.declare_subscriber("taxel/icub01/force/*", lambda sample: raw.append(bytes(sample.payload)))
    health = []
    other = scene.ros.session.declare_subscriber("taxel/icub01/health", lambda sample: health.append(bytes(sample.payload)))
    until("the robot with its force", lambda: view.row().get("state") in ("OK", "DEGRADED"))
    row = view.row()
    until("a force of the daemon's", lambda: view.row()["force_n"] in scene.truth.totals())
    until("forces and the health by foreign hands", lambda: len(raw) > 20 and health)
    pool = scene.truth.client.pool
    decode = GetMessageClass(pool.FindMessageTypeByName("taxel.v1.ForceSample")).FromString
    told = GetMessageClass(pool.FindMessageTypeByName("taxel.v1.Health")).FromString(health[-1])
    assert told.patches[0].tare.valid and told.patches[0].patch == "left_forearm", told
    known = {one.sequence: one.total_n for samples in list(scene.truth.forces.values()) for one in list(samples)}
    compared = [sample for sample in map(decode, raw) if sample.HasField("total_n") and sample.sequence in known]
    assert len(compared) > 5 and all(sample.total_n == known[sample.sequence] for sample in compared)
    assert row["model_set"] in {sample.model_set for sample in compared}, row
    reader.undeclare()
    other.undeclare()
    print(f"fleet: {row['state']}, {row['force_n']} N, {row['excluded']} excluded, models {row['model_set']}", flush=True)
    return view


def killed_bridge(scene, view):
    """The daemon does not notice, the fleet does, and ROS sees no node any more."""
    count = len(scene.truth.forces)
    scene.process.kill()
    until("the fleet says so", lambda: view.row()["state"] == "SILENT")
    row = view.row()
    assert row["force_n"] is None, row
    until("no node", lambda: not scene.ros.nodes() and not scene.ros.topics())
    until("the daemon goes on", lambda: len(scene.truth.forces) > count + 20)
    until("the daemon has let go of its streams",
          lambda: scene.truth.client.call("SkinService/GetHealth").streams == 2)
    scene.start_bridge()
    until("it is back", lambda: view.row().get("state") in ("OK", "DEGRADED"))
    print("the bridge was killed: the fleet saw it, the daemon did not", flush=True)


def fleet_table(scene):
    """What an operator sees who does not ask for JSON."""
    command = [scene.bridge, "fleet", "--router", scene.router_endpoint, "--once"]
    seen = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    assert seen.returncode == 0 and "left_forearm" in seen.stdout and "icub01" in seen.stdout, seen
    print(seen.stdout.rstrip(), flush=True)


def play(scene):
    # The bridge comes first: neither router nor daemon is there yet.
    scene.start_bridge()
    scene.router = scene.stage.router(scene.router_endpoint)
    scene.start_daemon()
    scene.read(rmw_zenoh.Ros(scene.router_endpoint, 7))
    shared.graph(scene)
    hashes(scene)
    shared.values(scene)
    shared.clouds(scene)
    shared.tare(scene)
    payloads(scene)
    view = fleet(scene)
    shared.stopped_daemon(scene)
    shared.killed_daemon(scene)
    killed_router(scene)
    for topic in scene.topics.values():
        topic.subscriber.undeclare()
    shared.nothing_else(scene)
    killed_bridge(scene, view)
    fleet_table(scene)
    view.process.terminate()
    assert view.process.wait(20) == 0, view.process.log.read_text()
    shared.ended(scene)
    acl(scene.stage, scene.stage.scratch)
    print("the bridge holds over Zenoh", flush=True)


def main():
    router = f"tcp/127.0.0.1:{free_port()}"
    scene = shared.Scene(sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3]), SECTIONS.format(router=router))
    scene.router_endpoint = router
    scene.stage.play(lambda: play(scene))


if __name__ == "__main__":
    main()
