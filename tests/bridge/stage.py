"""What the tests of the bridge run on: processes, ports, waiting."""

import json
import os
import pathlib
import socket
import subprocess
import sys
import time
import traceback

import zenoh

# Everything happens within a second; a busy machine may need many times as long.
PATIENCE_S = 180
HERE = pathlib.Path(__file__).parent


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def until(what, condition, limit_s=PATIENCE_S):
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        found = condition()
        if found:
            return found
        time.sleep(0.02)
    raise AssertionError(f"{what}: not within {limit_s} s")


def client(endpoint):
    """A session of a foreign implementation."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    return zenoh.open(config)


class Stage:
    """Starts processes, and ends those that it started."""

    def __init__(self, scratch):
        self.scratch, self.processes, self.logs = scratch, [], 0
        scratch.mkdir(parents=True, exist_ok=True)

    def start(self, name, *command, stdout=None):
        self.logs += 1
        log = open(self.scratch / f"{self.logs}-{name}.log", "w")
        process = subprocess.Popen([str(part) for part in command], stdout=stdout or log, stderr=log, text=True)
        process.log = pathlib.Path(log.name)
        self.processes.append(process)
        return process

    def router(self, *arguments):
        router = self.start("router", sys.executable, HERE / "router.py", *arguments, stdout=subprocess.PIPE)
        assert router.stdout.readline() == "ready\n", router.log.read_text()
        return router

    def end(self, process):
        if process.poll() is None:
            process.kill()
        process.wait(PATIENCE_S)

    def play(self, play):
        """Runs a test and ends all processes, then this one: a session whose router is gone would hold it up."""
        failed = 1
        try:
            play()
            failed = 0
        except BaseException:
            traceback.print_exc()
        finally:
            for process in self.processes:
                self.end(process)
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(failed)
