#!/usr/bin/env python3
"""The force as controllers in other languages read it, from a running demo: Python and C++ over gRPC, Python, C and C++ from
shared memory; and what they say when the daemon stands still, is killed and comes back.

usage: run.py TAXELD SCRATCH          needs grpcio, grpcio-reflection, cmake, a C++ compiler and libgrpc++-dev
"""

import gzip
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
PATIENCE_S = 180.0


class Demo:
    """A demo with both doors open."""

    def __init__(self, taxeld, folder, listen="127.0.0.1:0"):
        arguments = [taxeld, "demo", "--listen", listen, "--shared-memory", folder]
        self.process = subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True)
        for line in self.process.stdout:
            if line.startswith("The skin is now"):
                self.address = line.rsplit(" on ")[1].strip().rstrip(".")
            if line.startswith("Ctrl-C"):
                return
        raise AssertionError("the demo did not start")

    def signal(self, number):
        self.process.send_signal(number)
        if number in (signal.SIGKILL, signal.SIGTERM):
            self.process.wait()


def until(what, wanted):
    """Repeats `wanted` until it gives something."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        found = wanted()
        if found:
            return found
        time.sleep(0.002)
    raise AssertionError(f"not within {PATIENCE_S} s: {what}")


def install(scratch):
    """The wheel, made of a copy so that nothing is built in the repository, and installed; gives where it is."""
    copy, site = scratch / "python", scratch / "site"
    shutil.copytree(REPOSITORY / "deploy/python", copy, ignore=shutil.ignore_patterns("__pycache__", "build", "*.egg-info"))
    pip = [sys.executable, "-m", "pip"]
    subprocess.run([*pip, "wheel", "--quiet", "--no-deps", "--wheel-dir", str(scratch), str(copy)], check=True)
    (wheel,) = scratch.glob("taxel-*-py3-none-any.whl")
    subprocess.run([*pip, "install", "--quiet", "--no-deps", "--target", str(site), str(wheel)], check=True)
    assert (site / "taxel/py.typed").is_file()
    return site


# Runs the cells of a notebook one after the other, as Jupyter does, and keeps each figure that it shows.
CELLS = """
import json, sys
import matplotlib
matplotlib.use("agg")
import matplotlib.pyplot as pyplot
names, figures = {}, []
pyplot.show = lambda: (pyplot.savefig(f"figure-{len(figures)}.png"), figures.append(pyplot.gcf()))
for cell in json.load(open(sys.argv[1]))["cells"]:
    if cell["cell_type"] == "code":
        exec("".join(cell["source"]), names)
lines = [len(figure.axes[0].lines) for figure in figures]
print(json.dumps({"lines": lines, "scans": len(names["session"].time_s), "forces": len(names["total"])}))
"""


def notebook(taxeld, site, scratch, folder):
    """The notebook runs to its end against a daemon of its own: scans, curves and forces are in its figures."""
    demo = Demo(taxeld, folder)
    try:
        # A mass lies on the skin half of the time, and of so low a target a set may be not good.
        for command in ("calibrate --target 20", "models use newest --yes", "tare"):
            words = [taxeld, *command.split(), "--server", demo.address]
            until(f"taxeld {command}", lambda words=words: subprocess.run(words, capture_output=True).returncode == 0)
        path = f"{pathlib.Path(taxeld).resolve().parent}:{os.environ['PATH']}"
        environment = {**os.environ, "PYTHONPATH": str(site), "PATH": path, "TAXELD_SERVER": demo.address}
        command = [sys.executable, "-c", CELLS, str(REPOSITORY / "deploy/python/examples/skin.ipynb")]
        done = subprocess.run(command, env=environment, cwd=scratch, capture_output=True, text=True, timeout=PATIENCE_S)
    finally:
        demo.signal(signal.SIGTERM)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["lines"] == [6, 1] and found["scans"] > 100 and found["forces"] > 10, found
    print(f"the notebook runs: {found['scans']} scans, {found['forces']} forces")


def build(scratch):
    """The CMake project; gives its folder."""
    folder = scratch / "cpp"
    subprocess.run(["cmake", "-S", str(REPOSITORY / "deploy/cpp"), "-B", str(folder)], check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["cmake", "--build", str(folder), "--parallel", "2"], check=True, stdout=subprocess.DEVNULL)
    return folder


def controllers(cpp, page, address):
    """What each compiled controller needs to be told."""
    return [[cpp / "controller", page, "1"], [cpp / "controller_cpp", page, "1"], [cpp / "controller_grpc", address, "", "1"]]


def run(command):
    """Exit code and text of a controller that runs for a second."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=PATIENCE_S)
    return done.returncode, done.stdout


def same_figures(taxel, memory, service):
    """Both ways give the same samples, figure by figure."""
    def both():
        first, second = memory.force(), service.force()
        return (first, second) if first and second and first.sequence == second.sequence else None

    for _ in range(20):
        first, second = until("one sample on both ways", both)
        differ = {"age_s", "written_ns", "wall_ns", "reasons", "codes"}
        left, right = ({k: v for k, v in vars(f).items() if k not in differ} for f in (first, second))
        assert left == right, f"{left}\n{right}"
        assert second.reasons.startswith(first.reasons[:200]), (first.reasons, second.reasons)
        assert bool(second.codes) == bool(second.reasons), second
        assert isinstance(first, taxel.Force) and 0.0 <= first.age_s < 1.0 and first.sigma_n > 0.0


def over_a_socket(taxel, taxeld, cpp, scratch):
    """Both gRPC controllers hear over a Unix socket what the daemon says, which is that there is no model yet."""
    socket, config = scratch / "taxeld.sock", scratch / "taxeld.toml"
    config.write_text(f"""
        listen = ["unix:{socket}"]
        [store]
        path = "{scratch / "store.db"}"
        [[bus]]
        name = "skin"
        source = "sim"
        [[patch]]
        name = "palm"
        bus = "skin"
        boards = [{{ address = 13, modules = "0-1" }}]
    """)
    daemon = subprocess.Popen([taxeld, "run", "--config", config], stderr=subprocess.DEVNULL)
    try:
        with taxel.connect(f"unix:{socket}") as service:
            until("Python over a Unix socket", lambda: "no model set is in use" in str(service.force()))
        for command in controllers(cpp, "", f"unix:{socket}")[2:]:
            code, said = run(command)
            assert code == 3 and "no model set is in use" in said, (command, code, said)
    finally:
        daemon.terminate()
        daemon.wait()
    print("Python and C++ over gRPC hear the daemon over a Unix socket, too")


# Says again and again whether there is a force, or why there is none.
READER = '''
import sys, time, taxel
with taxel.connect(sys.argv[1]) as service:
    while True:
        force = service.force()
        print("force" if force else force, flush=True)
        time.sleep(0.02)
'''


def stop(demo, memory):
    """The daemon stands still. What it felt before and not afterwards would take its zero along, so nothing lies on its skin."""
    until("a force of nothing", lambda: (force := memory.force()) and force.total_n < 0.1)
    demo.signal(signal.SIGSTOP)


def over_a_suspend(site, demo, memory, scratch):
    """The machine of a Python reader is suspended for an hour, by the clock of its process: the force from before is an hour old, and
    one that comes then is none."""
    library, suspended = scratch / "suspend.so", scratch / "suspended"
    source = REPOSITORY / "crates/taxeld/tests/suspend.c"
    subprocess.run(["cc", "-shared", "-fPIC", "-o", str(library), str(source)], check=True)
    environment = {**os.environ, "LD_PRELOAD": str(library), "SUSPENDED_AN_HOUR": str(suspended), "PYTHONPATH": str(site)}
    reader = subprocess.Popen(
        [sys.executable, "-c", READER, demo.address], stdout=subprocess.PIPE, text=True, env=environment
    )
    try:
        until("a force", lambda: reader.stdout.readline() == "force\n")
        # First nothing is on its way to the reader any more: it would come after the suspension, and be as old as it is.
        stop(demo, memory)
        until("a force that is seconds old", lambda: re.search(r"\b[1-9]\d{3} ms old", reader.stdout.readline()))
        suspended.touch()
        until("a force that is an hour old", lambda: re.search(r"\b36\d{5} ms old", reader.stdout.readline()))
        demo.signal(signal.SIGCONT)
        until("a force after it", lambda: reader.stdout.readline() == "force\n")
    finally:
        reader.kill()
    print("a reader whose machine was suspended takes no force from before for a new one, and the next one for what it is")


def sessions(taxel, scratch):
    """A recording is read, and a row that is none is refused with its line."""
    text = "t_s,pressure_kpa,c0,c1\n0.0,0.5,240,239\n0.05,,239.5,239\n"
    plain, packed = scratch / "data.csv", scratch / "data.csv.gz"
    plain.write_text(text)
    packed.write_bytes(gzip.compress(text.encode()))
    for path in (plain, packed):
        session = taxel.read_session(path)
        assert (session.taxels, session.time_s, session.pressure_kpa) == (2, [0.0, 0.05], [0.5, None])
        assert session.taxel(0) == [240.0, 239.5]
    plain.write_text("t_s,pressure_kpa,c0,ramp,figure\n,,,,rising\n,0.05,240,1,zero\n0.0,0.5,239,1,\n0.05,0.6,238,2,\n")
    exported = taxel.read_session(plain)
    assert (exported.time_s, exported.counts) == ([0.0, 0.05], [[239.0], [238.0]])
    for bad, line in (("a,b\n", 1), ("t_s,pressure_kpa,c0\n1,2\n", 2), ("t_s,pressure_kpa,c0\n1,2,3\n1,2,x\n", 3),
                      ("t_s,pressure_kpa,c0\n1,2,nan\n", 2), ("t_s,pressure_kpa,c0\n1,2,\n", 2)):
        plain.write_text(bad)
        try:
            taxel.read_session(plain)
        except ValueError as error:
            assert f"data.csv:{line}:" in str(error), error
        else:
            raise AssertionError(f"not refused: {bad!r}")


def main(taxeld, scratch):
    scratch.mkdir(parents=True)
    site = install(scratch)
    sys.path.insert(0, str(site))
    import taxel

    assert pathlib.Path(taxel.__file__).is_relative_to(scratch), taxel.__file__
    sessions(taxel, scratch)
    cpp = build(scratch)
    over_a_socket(taxel, taxeld, cpp, scratch)
    with tempfile.TemporaryDirectory(prefix="taxeld-notebook-", dir="/dev/shm") as folder:
        notebook(taxeld, site, scratch, folder)
    with tempfile.TemporaryDirectory(prefix="taxeld-readers-", dir="/dev/shm") as folder:
        page = os.path.join(folder, "left_forearm")
        memory = taxel.Reader(page)
        assert not memory.force() and memory.force().why is taxel.Why.NO_PAGE
        demo = Demo(taxeld, folder)
        service = taxel.connect(demo.address)
        same_figures(taxel, memory, service)
        with taxel.connect(demo.address, "nose") as nowhere:
            until("the reason of a refusal", lambda: nowhere.force().codes == ("PATCH_UNKNOWN",))
        for command in controllers(cpp, page, demo.address):
            until(f"a force: {command}", lambda command=command: run(command)[0] == 0)
        print("the same figures in Python over gRPC and from shared memory; C, C++ and C++ over gRPC have a force")

        stop(demo, memory)
        until("a daemon that stands still is told", lambda: not memory.force() and not service.force())
        for command in controllers(cpp, page, demo.address):
            code, said = run(command)
            assert code == 3 and "no force" in said, (command, code, said)
        demo.signal(signal.SIGCONT)
        # Whether its zero outlived that is the daemon's to say; that it lives, the page's.
        until("it goes on", lambda: memory.force() or memory.force().why is taxel.Why.STATE)
        until("its zero holds or is proven anew", memory.force)
        over_a_suspend(site, demo, memory, scratch)

        demo.signal(signal.SIGKILL)
        gone = taxel.Why.WRITER_GONE
        until("a killed daemon is told", lambda: getattr(memory.force(), "why", None) is gone and not service.force())
        assert os.path.exists(page), "nobody was left to remove its page"
        demo = Demo(taxeld, folder, demo.address)
        until("the next one is found", lambda: memory.force() and service.force())
        same_figures(taxel, memory, service)

        demo.signal(signal.SIGTERM)
        assert memory.force().why is taxel.Why.CLOSED and not os.path.exists(page)
        until("the end is told", lambda: service.force() or service.force().why is taxel.Why.DISCONNECTED)
        service.close()
        print("no reader took a daemon that stood still, was killed or ended for a living one; all found the next one")


if __name__ == "__main__":
    main(sys.argv[1], pathlib.Path(sys.argv[2]).resolve())
