#!/usr/bin/env python3
"""How long a start takes until a client is served, with an empty store and with one that has 320 model sets.

usage: start.py TAXELD SCRATCH      (a build with the simulator; half a minute)
"""

import json
import os
import pathlib
import socket
import subprocess
import sys
import time

SETS = 320

CONFIG = """
listen = ["tcp:127.0.0.1:{port}"]
[store]
path = "{store}"
[[bus]]
name = "skin"
source = "sim"
[[patch]]
name = "left_forearm"
bus = "skin"
boards = [{{ address = 13, modules = "0-15" }}, {{ address = 12, modules = "1, 5, 8-10, 12-13" }}]
"""


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def served(daemon, port):
    """Waits until the port is open."""
    while True:
        assert daemon.poll() is None, "the daemon ended"
        with socket.socket() as client:
            if client.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.002)


def daemon(taxeld, scratch, store, port):
    config = scratch / "start.toml"
    config.write_text(CONFIG.format(store=store, port=port), encoding="utf-8")
    return subprocess.Popen([taxeld, "run", "--config", config], stderr=subprocess.DEVNULL)


def models_of_the_demo(taxeld):
    """The model set that the demo calibrates."""
    port = free_port()
    demo = subprocess.Popen([taxeld, "demo", "--listen", f"127.0.0.1:{port}"], stdout=subprocess.DEVNULL)
    try:
        served(demo, port)
        export = [taxeld, "models", "export", "--server", f"127.0.0.1:{port}"]
        while True:
            exported = subprocess.run(export, capture_output=True, check=False)
            if exported.returncode == 0:
                return json.loads(exported.stdout)
            time.sleep(0.1)
    finally:
        demo.terminate()
        demo.wait()


def fill(taxeld, scratch, store):
    """Imports sets that differ by their method alone: the id is the hash of the content."""
    models, port = models_of_the_demo(taxeld), free_port()
    method = models["method"]
    del models["id"]
    with daemon(taxeld, scratch, store, port) as filled:
        served(filled, port)
        for number in range(SETS):
            models["method"] = f"{method}, {number}"
            command = [taxeld, "models", "import", "-", "--insist", "--server", f"127.0.0.1:{port}"]
            subprocess.run(command, input=json.dumps(models).encode(), check=True, stdout=subprocess.DEVNULL)
        filled.terminate()


def start(taxeld, scratch, store):
    """Seconds until the port is open."""
    port, begun = free_port(), time.monotonic()
    with daemon(taxeld, scratch, store, port) as started:
        served(started, port)
        seconds = time.monotonic() - begun
        started.terminate()
    return seconds


def main():
    taxeld, scratch = sys.argv[1], pathlib.Path(sys.argv[2]).resolve()
    scratch.mkdir(parents=True, exist_ok=True)
    filled, empty = scratch / "filled.db", scratch / "empty.db"
    if not filled.exists():
        fill(taxeld, scratch, filled)
    empty.unlink(missing_ok=True)
    for name, store in [("an empty store", empty), (f"{SETS} model sets", filled)]:
        seconds = sorted(start(taxeld, scratch, store) for _ in range(5))
        size = os.path.getsize(store) / 1e6
        print(f"{name} ({size:.0f} MB): the port is open after {seconds[2]:.2f} s ({seconds[0]:.2f} to {seconds[-1]:.2f})")


main()
