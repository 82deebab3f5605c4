#!/usr/bin/env python3
"""How fast and how regularly forces come.

    tests/bridge/rate.py TAXELD BRIDGE SCRATCH [--seconds 60] [--rate 1000]

Asks the daemon for forces at that rate, through bridge and router to a reader in Python, and beside it over gRPC. Times are
of one machine and of what else runs on it: the load is printed.
"""

import argparse
import array
import bisect
import os
import pathlib
import struct
import sys
import time

import ros
from stage import Stage, client, evenness, free_port, quantiles, until

CONFIG = """
robot = "icub01"
[daemon]
server = "http://127.0.0.1:{grpc}"
[zenoh]
router = "{router}"
[ros]
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

    def __init__(self, session, endpoint):
        self.sequence, self.sent, self.came, self.stamp = (array.array("q") for _ in range(4))
        self.key = f"0{endpoint.name}/{endpoint.type}/{endpoint.hash}"
        self.subscriber = session.declare_subscriber(self.key, self._take)

    def _take(self, sample):
        came = time.time_ns()
        sequence, sent = struct.unpack_from("<qq", bytes(sample.attachment))
        seconds, nanoseconds = struct.unpack_from("<iI", bytes(sample.payload), 4)
        for kept, value in [(self.sequence, sequence), (self.sent, sent), (self.came, came),
                            (self.stamp, seconds * 10**9 + nanoseconds)]:
            kept.append(value)


def missing(sequence):
    """The numbers that are not there, between the first and the last."""
    return sorted(set(range(sequence[0], sequence[-1] + 1)) - set(sequence))


def since(times, ticks):
    """How long before each of the times the last tick was; both ascend. The daemon sends all of one rate at one tick."""
    last = lambda time: ticks[bisect.bisect(ticks, time) - 1]
    return [time - last(time) for time in times if ticks[0] < time < ticks[-1]]


def one_robot(arguments, stage):
    grpc, router = free_port(), f"tcp/127.0.0.1:{free_port()}"
    daemon = stage.start("taxeld", arguments.paths[0], "demo", "--listen", f"127.0.0.1:{grpc}")
    until("the demo serves", lambda: "live on" in daemon.log.read_text() or daemon.poll())
    router_process = stage.router(router)
    config = stage.scratch / "rate.toml"
    config.write_text(CONFIG.format(grpc=grpc, router=router, rate=arguments.rate))
    bridge = stage.start("bridge", arguments.paths[1], "run", "--config", config)
    session = client(router)
    graph = ros.Graph(session, 0)
    until("the wrench", lambda: "/skin/left_forearm/wrench" in graph.topics())
    reader = Reader(session, graph.topics()["/skin/left_forearm/wrench"])
    until("forces", lambda: len(reader.sequence) > 100)
    beside, sendings = pathlib.Path(__file__).parent / "beside.py", stage.scratch / "sendings"
    other = stage.start("grpc", sys.executable, beside, f"127.0.0.1:{grpc}", str(arguments.rate), str(arguments.seconds), sendings)
    first, before, begun = len(reader.sequence), usage(bridge.pid), time.monotonic()
    time.sleep(arguments.seconds)
    last, after, span = len(reader.sequence), usage(bridge.pid), time.monotonic() - begun
    sequence, sent, came = (list(kept)[first:last] for kept in (reader.sequence, reader.sent, reader.came))
    print(f"bridge, {arguments.rate:.0f} Hz asked for: sent {evenness(sent, arguments.rate)}")
    print(f"Python: {len(sequence)} samples in {span:.1f} s, {len(missing(sequence))} missing {missing(sequence)[:20]}; "
          f"between two arrivals {evenness(came, arguments.rate)}")
    print(f"  bridge's sending to here: {quantiles([c - s for c, s in zip(came, sent)])}")
    until("the other reader ends", lambda: other.poll() is not None)
    print(other.log.read_text().strip())
    ways = since(sent, array.array("q", sendings.read_bytes()))
    print(f"daemon's sending to the bridge's: {quantiles(ways)} of {len(ways)}")
    print(f"bridge: {100 * (after[0] - before[0]) / span:.1f} % of a core, {after[1]:.1f} MB; router {usage(router_process.pid)[1]:.1f} MB")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs=3, metavar="PATH")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=1000.0)
    arguments = parser.parse_args()
    stage = Stage(pathlib.Path(arguments.paths[-1]))
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    stage.play(lambda: one_robot(arguments, stage))


if __name__ == "__main__":
    main()
