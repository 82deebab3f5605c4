#!/usr/bin/env python3
"""How fast and how regularly forces come to a real node of ROS 2 over Fast DDS, beside a bare publisher of ros2-client.

    target/tests-ros/kilted/bin/python tests/bridge/rate.py TAXELD BRIDGE BARE_PUBLISHER SCRATCH [--seconds 60] [--rate 100]

Times are of one machine and of what else runs on it: the load is printed. TAXELD, BRIDGE: release builds; BARE_PUBLISHER:
cargo build --release -p taxel-bridge --example bare_publisher.
"""

import argparse
import array
import bisect
import os
import pathlib
import sys
import time

import real_ros
from stage import Stage, evenness, free_port, quantiles, until

DOMAIN = 20 + os.getpid() % 80

CONFIG = """
robot = "icub01"
[daemon]
server = "http://127.0.0.1:{grpc}"
[ros]
domain = {domain}
[[patch]]
name = "left_forearm"
rate_hz = {rate}
"""


def usage(pid):
    """Seconds of processor and MB of memory that a process has used so far."""
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    ticks = int(fields[11]) + int(fields[12])
    resident = int(pathlib.Path(f"/proc/{pid}/statm").read_text().split()[1])
    return ticks / os.sysconf("SC_CLK_TCK"), resident * os.sysconf("SC_PAGE_SIZE") / 1e6


class Reader:
    """Takes what it needs of each wrench and does nothing else."""

    def __init__(self, ros, name):
        self.stamp, self.sent, self.came = (array.array("q") for _ in range(3))
        self.subscription = ros.node.create_subscription(real_ros.WrenchStamped, name, self._take, 10)

    def _take(self, message, info):
        self.came.append(time.time_ns())
        self.sent.append(info["source_timestamp"])
        stamp = message.header.stamp
        self.stamp.append(stamp.sec * 10**9 + stamp.nanosec)


def since(times, ticks):
    """How long before each of the times the last tick was; both ascend. The daemon sends all of one rate at one tick."""
    last = lambda time: ticks[bisect.bisect(ticks, time) - 1]
    return [time - last(time) for time in times if ticks[0] < time < ticks[-1]]


def one_robot(arguments, stage):
    taxeld, bridge_program, bare_program, _ = arguments.paths
    grpc = free_port()
    daemon = stage.start("taxeld", taxeld, "demo", "--listen", f"127.0.0.1:{grpc}")
    until("the demo serves", lambda: "live on" in daemon.log.read_text() or daemon.poll())
    config = stage.scratch / "rate.toml"
    config.write_text(CONFIG.format(grpc=grpc, domain=DOMAIN, rate=arguments.rate))
    bridge = stage.start("bridge", bridge_program, "run", "--config", config)
    stage.start("bare", bare_program, DOMAIN, arguments.rate)
    ros = real_ros.Ros(DOMAIN)
    skin, bare = Reader(ros, "/skin/left_forearm/wrench"), Reader(ros, "/bare/wrench")
    until("forces", lambda: len(skin.came) > 100 and len(bare.came) > 100)
    beside, sendings = pathlib.Path(__file__).parent / "beside.py", stage.scratch / "sendings"
    other = stage.start("grpc", sys.executable, beside, f"127.0.0.1:{grpc}", arguments.rate, arguments.seconds, sendings)
    first, before, begun = (len(skin.came), len(bare.came)), usage(bridge.pid), time.monotonic()
    time.sleep(arguments.seconds)
    last, after, span = (len(skin.came), len(bare.came)), usage(bridge.pid), time.monotonic() - begun
    until("the other reader ends", lambda: other.poll() is not None)
    print(other.log.read_text().strip())
    sent, came = skin.sent[first[0]:last[0]], skin.came[first[0]:last[0]]
    print(f"bridge, {arguments.rate:.0f} Hz asked for: {len(came)} wrenches in {span:.1f} s, {evenness(came, arguments.rate)}")
    ticks = array.array("q", sendings.read_bytes())
    print(f"  daemon's sending to the callback: {quantiles(since(came, ticks))}")
    print(f"  bridge's sending to the callback: {quantiles([c - s for c, s in zip(came, sent)])}")
    stamp, came = bare.stamp[first[1]:last[1]], bare.came[first[1]:last[1]]
    print(f"bare publisher: {len(came)} wrenches; stamp to the callback: {quantiles([c - s for c, s in zip(came, stamp)])}")
    print(f"bridge: {100 * (after[0] - before[0]) / span:.1f} % of a core, {after[1]:.1f} MB")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs=4, metavar="PATH")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=100.0)
    arguments = parser.parse_args()
    stage = Stage(pathlib.Path(arguments.paths[-1]))
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    stage.play(lambda: one_robot(arguments, stage))


if __name__ == "__main__":
    main()
