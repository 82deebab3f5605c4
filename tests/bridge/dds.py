#!/usr/bin/env python3
"""The bridge between the demo's skin and a real ROS 2: rclpy over Fast DDS.

    tests/bridge/dds.py TAXELD BRIDGE SCRATCH [PAYLOADS]

Runs in an environment that tests/bridge/ros-python makes. PAYLOADS is what tests/bridge/run.py wrote down of the topics over Zenoh.
"""

import os
import pathlib
import signal
import sys

from rclpy.serialization import deserialize_message, serialize_message

import real_ros
import scene as shared
from stage import until

# Other tests of this machine run in others.
DOMAIN = 20 + os.getpid() % 80

SECTIONS = """
[ros]
domain = {domain}
tare = true
{more}
"""


def profiles(scene):
    """A subscriber that wants each message, and one that takes what comes."""
    for name, profile in real_ros.PROFILES.items():
        topic = scene.ros.subscribe(f"{shared.PATCH}/wrench", profile)
        until(f"wrenches for a subscriber with the profile {name}", lambda: topic.count() > 20)
    print("both profiles are served: reliable, sensor data", flush=True)


def stopped_subscriber(scene):
    """A subscriber that hangs costs the others nothing."""
    other = scene.stage.start("hanging", sys.executable, __file__, "--hang", str(DOMAIN))
    until("the other subscriber", lambda: "hears" in other.log.read_text() or other.poll())
    assert other.poll() is None, other.log.read_text()
    other.send_signal(signal.SIGSTOP)
    begun, known = scene.topics["wrench"].count(), set(scene.truth.forces)
    until("two hundred wrenches", lambda: scene.topics["wrench"].count() > begun + 200)
    got = {shared.stamp(message) for _, _, message in scene.topics["wrench"].since(begun)}
    first, last = min(got), max(got)
    sent = {at for at in set(scene.truth.forces) - known if first < at < last and scene.truth.good(at)}
    lost = sent - got
    scene.stage.end(other)
    # A busy machine may make taxel-client skip to the newest.
    assert len(lost) <= len(sent) / 50, f"{len(lost)} of {len(sent)} lost"
    print(f"beside a subscriber that hangs {len(sent)} forces came, {len(lost)} did not", flush=True)


def other_domain(scene):
    """Who hears a bridge of another domain does not hear this one, and the other way round."""
    stranger, wrench = real_ros.Ros(DOMAIN + 100, "stranger"), f"{shared.PATCH}/wrench"
    bridge = scene.start_bridge(scene.configuration("other.toml", SECTIONS.format(domain=DOMAIN + 100, more="")))
    until("the topics in the other domain", lambda: set(shared.TOPICS) <= set(stranger.topics()))
    topic = stranger.subscribe(wrench)
    until("wrenches in the other domain", lambda: topic.count() > 10)
    assert [ros.node.count_publishers(wrench) for ros in (scene.ros, stranger)] == [1, 1]
    scene.stage.end(bridge)
    print(f"domains {DOMAIN} and {DOMAIN + 100} do not hear each other", flush=True)


def second_bridge(scene):
    """Two robots in one domain: each with names of its own, and both on /diagnostics."""
    more = 'namespace = "/second"'
    bridge = scene.start_bridge(scene.configuration("second.toml", SECTIONS.format(domain=DOMAIN, more=more)))
    until("its node", lambda: {("/second", "taxel_bridge"), ("/skin", "taxel_bridge")} <= scene.ros.nodes())
    until("its topics", lambda: "/second/left_forearm/wrench" in scene.ros.topics())
    topic = scene.ros.subscribe("/second/left_forearm/wrench")
    until("its wrenches", lambda: topic.count() > 10)
    scene.until_wrench("of the first bridge")
    bridge.terminate()
    assert bridge.wait(20) == 0, bridge.log.read_text()
    until("its node is gone", lambda: ("/second", "taxel_bridge") not in scene.ros.nodes())
    print("a second bridge came, was heard and left the graph", flush=True)


def killed_bridge(scene):
    """The daemon does not notice; the bridge that comes after it is heard by those who listened before."""
    count = len(scene.truth.forces)
    scene.process.kill()
    until("the daemon goes on", lambda: len(scene.truth.forces) > count + 20)
    scene.start_bridge()
    scene.until_wrench("of the bridge that came back")
    print("the bridge was killed and is heard again by the same subscribers", flush=True)


def of_zenoh(folder):
    """What went out over Zenoh is read by ROS itself; padding may differ."""
    files = sorted(folder.iterdir())
    for file in files:
        _, package, name = file.name.split(".")
        payload = file.read_bytes()
        kind = real_ros.TYPES[f"{package}/msg/{name}"]
        message = deserialize_message(payload, kind)
        assert str(deserialize_message(bytes(serialize_message(message)), kind)) == str(message), file
    assert len(files) == len(shared.TOPICS), files
    print(f"{len(files)} types of payloads over Zenoh are read by ROS itself", flush=True)


def hang(domain):
    """A subscriber that is stopped by its caller."""
    ros = real_ros.Ros(domain, "hanging")
    until("the wrench", lambda: f"{shared.PATCH}/wrench" in ros.topics())
    topics = [ros.subscribe(name) for name in shared.TOPICS]
    until("messages", lambda: all(topic.count() for topic in topics[:2]))
    print("it hears", flush=True)
    signal.pause()


def play(scene, payloads):
    if payloads:
        of_zenoh(pathlib.Path(payloads))
    # The bridge comes first: the daemon is not there yet.
    scene.start_bridge()
    scene.start_daemon()
    scene.read(real_ros.Ros(DOMAIN))
    shared.graph(scene)
    shared.values(scene)
    shared.clouds(scene)
    shared.tare(scene)
    profiles(scene)
    stopped_subscriber(scene)
    other_domain(scene)
    second_bridge(scene)
    shared.stopped_daemon(scene)
    shared.killed_daemon(scene)
    killed_bridge(scene)
    shared.nothing_else(scene)
    shared.ended(scene)
    until("the node is gone", lambda: ("/skin", "taxel_bridge") not in scene.ros.nodes())
    print("the bridge holds over Fast DDS", flush=True)


def main():
    if sys.argv[1] == "--hang":
        hang(int(sys.argv[2]))
    sections = SECTIONS.format(domain=DOMAIN, more="")
    scene = shared.Scene(sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3]), sections)
    scene.stage.play(lambda: play(scene, sys.argv[4] if len(sys.argv) > 4 else None))


if __name__ == "__main__":
    main()
