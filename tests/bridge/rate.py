#!/usr/bin/env python3
"""How fast and how regularly forces come, and what a fleet costs its router.

    tests/bridge/rate.py TAXELD BRIDGE SCRATCH [--seconds 60] [--rate 1000] [--reader target/release/examples/reader]
    tests/bridge/rate.py --robots 10,50,200 --load target/release/examples/robots SCRATCH [--seconds 20] [--rate 50]

The first asks the daemon for forces at that rate, through bridge and router to a reader in Python, and beside it over
gRPC, and with --reader to one in Rust, too. The second puts robots on one router. Times are of one machine and of what else runs on it: the load is printed.
"""

import argparse
import array
import os
import pathlib
import struct
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "e2e"))
from foreign import Client  # noqa: E402

import ros  # noqa: E402
from stage import Stage, client, free_port, until  # noqa: E402

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
age_max_ms = 1000
"""


def quantiles(values):
    """p50, p99 and the largest, in ms."""
    values = sorted(values)
    at = lambda q: values[min(len(values) - 1, int(q * len(values)))] / 1e6
    return f"p50 {at(0.5):.3f} ms, p99 {at(0.99):.3f} ms, largest {values[-1] / 1e6:.1f} ms"


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


def beside(address, rate, ways, stop):
    """The same samples over gRPC: from the daemon's sending to here."""
    for sample in Client(address).stream("ForceService/StreamForce", timeout=3600, rate_hz=rate):
        if stop.is_set():
            return
        if sample.HasField("time"):
            ways.append(time.time_ns() - sample.time.ToNanoseconds() - int(sample.age_s * 1e9))


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
    ways, stop = [], threading.Event()
    threading.Thread(target=beside, args=(f"127.0.0.1:{grpc}", arguments.rate, ways, stop), daemon=True).start()
    until("forces", lambda: len(reader.sequence) > 100)
    rust = arguments.reader and stage.start("reader", arguments.reader, router, reader.key, str(arguments.seconds))
    first, before, begun = len(reader.sequence), usage(bridge.pid), time.monotonic()
    time.sleep(arguments.seconds)
    last, after, span = len(reader.sequence), usage(bridge.pid), time.monotonic() - begun
    stop.set()
    sequence, sent, came = (list(kept)[first:last] for kept in (reader.sequence, reader.sent, reader.came))
    lost = sequence[-1] - sequence[0] + 1 - len(sequence)
    counts = {}
    diagnostics = ros.Topic(session, 0, graph.topics()["/diagnostics"])
    until("diagnostics", lambda: diagnostics.count())
    for status in diagnostics.since(0)[-1][2].status:
        if status.name == "taxel: force of left_forearm":
            counts = {value.key: value.value for value in status.values}
    print(f"{len(sequence)} wrenches in {span:.1f} s: {len(sequence) / span:.1f} Hz, asked for {arguments.rate}")
    print(f"numbers missing between bridge and reader: {lost}")
    print(f"samples, whole run: published {counts['published']}, withheld {counts['withheld']}, overtaken in the bridge {counts['skipped']}")
    print(f"bridge's sending to the reader's hands: {quantiles([c - s for c, s in zip(came, sent)])}")
    print(f"between two sendings of the bridge: {quantiles([b - a for a, b in zip(sent, sent[1:])])}")
    print(f"between two arrivals: {quantiles([b - a for a, b in zip(came, came[1:])])}")
    if rust:
        until("the reader in Rust ends", lambda: rust.poll() is not None)
        print(rust.log.read_text().strip())
    print(f"beside, daemon's sending to a gRPC client in Python: {quantiles(ways)} of {len(ways)}")
    print(f"bridge: {100 * (after[0] - before[0]) / span:.1f} % of a core, {after[1]:.1f} MB; router {usage(router_process.pid)[1]:.1f} MB")


def many_robots(arguments, stage):
    print("robots  asked Hz  heard Hz  missing  router % of a core  a robot  router MB  a robot kB")
    for robots in [int(count) for count in arguments.robots.split(",")]:
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        router = stage.router(endpoint)
        empty, heard, alive = usage(router.pid)[1], {}, set()
        session = client(endpoint)
        tokens = session.liveliness().declare_subscriber(
            "taxel/*/alive", lambda sample: alive.add(str(sample.key_expr)), history=True)

        def take(sample):
            key = str(sample.key_expr)
            heard[key] = heard.get(key, 0) + 1

        forces = session.declare_subscriber("taxel/*/force/*", take)
        load = stage.start("robots", arguments.load, endpoint, str(robots), str(arguments.rate), str(arguments.seconds + 30))
        until("all robots", lambda: len(alive) == robots and len(heard) == robots)
        before, begun, count = usage(router.pid), time.monotonic(), sum(heard.values())
        time.sleep(arguments.seconds)
        after, span, total = usage(router.pid), time.monotonic() - begun, sum(heard.values()) - count
        core, asked = 100 * (after[0] - before[0]) / span, robots * arguments.rate
        print(f"{robots:6}  {asked:8.0f}  {total / span:8.0f}  {100 * (1 - total / span / asked):6.1f} %  {core:18.1f}  "
              f"{core / robots:5.2f} %  {after[1]:9.1f}  {1000 * (after[1] - empty) / robots:10.0f}", flush=True)
        forces.undeclare(), tokens.undeclare(), session.close()
        stage.end(load), stage.end(router)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="+", metavar="PATH")
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--reader", metavar="PATH")
    parser.add_argument("--rate", type=float)
    parser.add_argument("--robots")
    parser.add_argument("--load")
    arguments = parser.parse_args()
    fleet = arguments.robots is not None
    arguments.seconds = arguments.seconds or (20 if fleet else 60)
    arguments.rate = arguments.rate or (50.0 if fleet else 1000.0)
    stage = Stage(pathlib.Path(arguments.paths[-1]))
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    stage.play(lambda: (many_robots if fleet else one_robot)(arguments, stage))


if __name__ == "__main__":
    main()
