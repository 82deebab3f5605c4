#!/usr/bin/env python3
"""Recordings of the simulated forearm, read by the MCAP package of others and replayed.

    tests/recording/run.py TAXELD SCRATCH

Calibrates, ends the daemon and reads its recording by its summary. Starts it anew and kills it with
SIGKILL while it records under a load: what was recorded is read without a summary, and its replay must give the force that
the daemon published. At last there is no room on the disk: that is told, and the force goes on.
"""

import csv
import json
import pathlib
import re
import signal
import sqlite3
import subprocess
import sys
import time
from xml.etree import ElementTree

from mcap.exceptions import EndOfFile, McapError
from mcap.reader import NonSeekingReader, SeekingReader
from mcap_protobuf.decoder import DecoderFactory

HERE = pathlib.Path(__file__).parent
DEPLOY = HERE.parents[1] / "deploy"
PATIENCE_S = 600
OK, DEGRADED = 1, 2
# The force file of a replay has six digits.
SAME_N = 2e-6
HELD_UP_SHARE = 0.03


def run(*words, allowed=(0,)):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=PATIENCE_S)
    if done.returncode not in allowed:
        sys.exit(f"{' '.join(str(word) for word in words)}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done


def wait(what, done):
    end = time.monotonic() + PATIENCE_S
    while not (found := done()):
        if time.monotonic() > end:
            sys.exit(f"{what} did not come within {PATIENCE_S} s")
        time.sleep(0.2)
    return found


class Daemon:
    def __init__(self, taxeld, scratch, change=lambda text: text):
        self.taxeld, self.server = taxeld, f"unix:{scratch / 's'}"
        self.config = scratch / "recording.toml"
        self.config.write_text(change((HERE / "recording.toml").read_text(encoding="utf-8")), encoding="utf-8")
        self.log = open(scratch / "daemon.log", "a", encoding="utf-8")
        self.process = subprocess.Popen([taxeld, "run", "--config", str(self.config)], stderr=self.log, cwd=scratch)
        wait("an answer", self.answers)

    def answers(self):
        if self.process.poll() is not None:
            sys.exit(f"the daemon ended: {self.config.with_name('daemon.log').read_text()}")
        return self.call("models", "list", allowed=(0, 1)).returncode == 0

    def call(self, *words, allowed=(0,)):
        return run(self.taxeld, *words, "--server", self.server, allowed=allowed)

    def health(self):
        return json.loads(self.call("health", "--json", allowed=(0, 3)).stdout.splitlines()[0])

    def end(self, how):
        self.process.send_signal(how)
        return self.process.wait(timeout=60)


def messages(path, reader, order):
    """Topic and message of each message, as far as the file is whole; whether it is to its end."""
    found = {}
    with open(path, "rb") as file:
        try:
            for _, channel, _, message in reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(
                log_time_order=order
            ):
                found.setdefault(channel.topic, []).append(message)
        except (EndOfFile, McapError):
            return found, False
    return found, True


def newest(folder):
    return max(folder.glob("taxeld-*.mcap"))


def calibrated(taxeld, scratch):
    """A model set in use, and its files; the daemon's recording has a summary."""
    daemon = Daemon(taxeld, scratch)
    daemon.call("calibrate", "--target", "10", "--confirmed-by", "test")
    daemon.call("models", "use", "newest", "--yes")  # of so low a target it may be not good
    daemon.call("models", "export", "--out", scratch / "models.json")
    health = daemon.health()["recording"]
    if health["problem"] or health["lost"] != "0":
        sys.exit(f"the recording: {health}")
    if daemon.end(signal.SIGTERM) != 0:
        sys.exit("the daemon did not end well")
    found, whole = messages(newest(scratch / "recordings"), SeekingReader, True)
    kinds = {str(event.text) for event in found["/taxeld/events"]}
    if not whole or len(found["/taxeld/bus/skin"]) < 100 or len(kinds) < 3:
        sys.exit(f"the closed recording: {({topic: len(all) for topic, all in found.items()})}, {kinds}")
    layouts(found)
    taxels = found["/taxeld/taxels/left_forearm"][-1].taxels
    print(f"closed: {', '.join(f'{topic} {len(all)}' for topic, all in found.items())}, {len(taxels)} taxels")


def drawn():
    """Topic and field of everything that the layouts for Foxglove and PlotJuggler draw."""
    layout = json.loads((DEPLOY / "foxglove.json").read_text(encoding="utf-8"))
    panels = layout["configById"]
    used = re.findall(r'"(?:first|second)": "([^"]+)"', json.dumps(layout["layout"]))
    if sorted(used) != sorted(panels):
        sys.exit(f"foxglove.json: panels {sorted(panels)}, laid out are {sorted(used)}")
    paths = [path["value"] for panel in panels.values() for path in panel.get("paths", [])]
    paths += [panel["topicPath"] for panel in panels.values() if "topicPath" in panel]
    curves = ElementTree.parse(DEPLOY / "plotjuggler.xml").iter("curve")
    return [tuple(path.partition("."))[::2] for path in paths] + [tuple(curve.get("name").rsplit("/", 1)) for curve in curves]


def layouts(found):
    """Foxglove and PlotJuggler draw nothing that a recording lacks."""
    for topic, field in (every := drawn()):
        if topic not in found or field and field not in found[topic][-1].DESCRIPTOR.fields_by_name:
            sys.exit(f"a layout draws {topic} {field}, which a recording lacks")
    print(f"layouts: {len(every)} curves and topics are in a recording")


def forces(found):
    good = [force for force in found.get("/taxeld/force/left_forearm", []) if force.state in (OK, DEGRADED)]
    return {force.monotonic_ns: force.total_n for force in good}


def forget_zero(store):
    """A daemon without the zero of its last run takes one from its first scans, as a replay does."""
    connection = sqlite3.connect(store)
    with connection:
        if connection.execute("DELETE FROM facts WHERE kind = 'zeros'").rowcount != 1:
            sys.exit("the store has no zero")
    connection.close()


def killed(taxeld, scratch):
    """Kills the daemon under a load. Gives what the recording has."""
    before = newest(scratch / "recordings")
    forget_zero(scratch / "store.db")
    daemon = Daemon(taxeld, scratch)

    def loaded():
        path = newest(scratch / "recordings")
        if path == before:
            return None
        found, _ = messages(path, NonSeekingReader, False)
        return found if sum(newton > 3 for newton in forces(found).values()) > 60 else None

    seen = wait("a recorded load", loaded)
    daemon.end(signal.SIGKILL)
    path = newest(scratch / "recordings")
    found, whole = messages(path, NonSeekingReader, False)
    if whole:
        sys.exit("a recording that nobody closed has an end")
    for topic, before in seen.items():
        if len(found[topic]) < len(before):
            sys.exit(f"{topic}: {len(found[topic])} messages, {len(before)} were there before the end")
    frames = [batch for batch in found["/taxeld/bus/skin"]]
    seconds = (frames[-1].monotonic_ns - frames[0].monotonic_ns) / 1e9
    if any(batch.not_recorded or batch.kernel_lost for batch in frames):
        sys.exit("frames are missing")
    count = sum(len(batch.frames) for batch in frames)
    print(f"killed: {seconds:.1f} s, {count} frames, {path.stat().st_size / seconds / 1000:.1f} kB/s")
    return path, found


def replayed(taxeld, scratch, path, found):
    """The force of the recording, computed again, is the force that was published."""
    table = scratch / "force.csv"
    done = run(
        taxeld, "replay", path, "--config", scratch / "recording.toml", "--models", scratch / "models.json", "--force", table
    )
    if "was cut off" not in done.stdout + done.stderr:
        sys.exit(f"nothing is said of the end that lacks: {done.stderr}")
    first = found["/taxeld/bus/skin"][0]
    offset_ns = first.time.seconds * 10**9 + first.time.nanos - first.monotonic_ns
    again = {}
    with open(table, encoding="utf-8") as rows:
        for row in csv.DictReader(rows):
            if row["total_n"]:
                seconds, nanos = row["time_s"].split(".")
                again[int(seconds) * 10**9 + int(nanos) - offset_ns] = float(row["total_n"])
    live = forces(found)
    both = live.keys() & again.keys()
    others = sorted(ns for ns in both if not abs(live[ns] - again[ns]) <= SAME_N)
    print(f"replayed: {len(live)} forces live, {len(again)} again, {len(both)} at one time, {len(others)} of them differ")
    said = {force.monotonic_ns: force for force in found["/taxeld/force/left_forearm"]}
    for ns in others:
        print(f"{live[ns]} N live, {again[ns]} N again, {said[ns].state}: {'; '.join(said[ns].reasons)}")
    # A machine that holds the daemon up for a moment lets it see silence where a replay sees none.
    if len(both) < 0.9 * len(live) or len(others) > HELD_UP_SHARE * len(both):
        sys.exit("the replay gives another force")


def main():
    taxeld, scratch = str(pathlib.Path(sys.argv[1]).resolve()), pathlib.Path(sys.argv[2]).resolve()
    scratch.mkdir(parents=True, exist_ok=True)
    calibrated(taxeld, scratch)
    path, found = killed(taxeld, scratch)
    replayed(taxeld, scratch, path, found)


if __name__ == "__main__":
    main()
