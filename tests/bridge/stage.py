"""What the tests of the bridge run on: processes, ports, waiting."""

import os
import pathlib
import socket
import subprocess
import sys
import time
import traceback

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


def listens(pid):
    """Whether a process has a TCP socket that listens."""
    sockets = {os.readlink(link) for link in pathlib.Path(f"/proc/{pid}/fd").iterdir() if link.is_symlink()}
    lines = [line.split() for table in ("tcp", "tcp6") for line in open(f"/proc/{pid}/net/{table}").readlines()[1:]]
    return any(line[3] == "0A" and f"socket:[{line[9]}]" in sockets for line in lines)


def quantiles(values_ns):
    """p50, p99 and the largest, in ms."""
    values = sorted(values_ns)
    at = lambda q: values[min(len(values) - 1, int(q * len(values)))] / 1e6
    return f"p50 {at(0.5):.3f} ms, p99 {at(0.99):.3f} ms, largest {values[-1] / 1e6:.1f} ms"


def evenness(times_ns, rate_hz):
    """How evenly something happened that was to happen at a rate: its rate, its pauses, and what came in pairs."""
    pauses = [b - a for a, b in zip(times_ns, times_ns[1:])]
    pairs = sum(pause < 0.25e9 / rate_hz for pause in pauses)
    longer = ", ".join(f"{sum(pause > ms * 1e6 for pause in pauses)} longer than {ms} ms" for ms in (5, 10, 20))
    rate = 1e9 * len(pauses) / (times_ns[-1] - times_ns[0])
    return f"{rate:.1f} Hz, {quantiles(pauses)}, {longer}, {pairs} within a quarter of the period"


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

    def router(self, endpoint=None, config=None):
        """A router that listens at `endpoint`, or as `config` says: ZENOHD, or a session that routes, which is the same code."""
        zenohd = os.environ.get("ZENOHD")
        if zenohd:
            listening = ["--config", config] if config else ["--listen", endpoint, "--no-multicast-scouting"]
            router = self.start("zenohd", zenohd, *listening)
            until("zenohd listens", lambda: router.poll() or listens(router.pid))
            assert router.poll() is None, router.log.read_text()
            return router
        listening = ["--config", config] if config else [endpoint]
        router = self.start("router", sys.executable, HERE / "router.py", *listening, stdout=subprocess.PIPE)
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
            for log in sorted(self.scratch.glob("*.log")):
                print(f"-- {log.name}", *log.read_text(errors="replace").splitlines()[-4:], sep="\n   ", file=sys.stderr)
        finally:
            for process in self.processes:
                self.end(process)
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(failed)
