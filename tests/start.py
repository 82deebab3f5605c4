#!/usr/bin/env python3
"""How long a start takes until a client is served, with a store that has grown for years.

usage: start.py TAXELD SCRATCH      (needs a build of taxel-store's tests, which fill the store; two minutes)
"""

import os
import pathlib
import socket
import subprocess
import sys
import time

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
boards = [{{ address = 13, modules = "0-15" }}, {{ address = 12, modules = "0-6" }}]
"""


def fill(store):
    """1,000 model sets and 10,000 sessions."""
    command = ["cargo", "test", "-q", "-p", "taxel-store", "--lib", "a_store_that_has_grown", "--", "--ignored"]
    subprocess.run(command, check=True, env={**os.environ, "TAXEL_STORE_GROWN": str(store)}, stdout=subprocess.DEVNULL)


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def start(taxeld, scratch, store):
    """Seconds until the port is open."""
    port = free_port()
    config = scratch / "start.toml"
    config.write_text(CONFIG.format(store=store, port=port), encoding="utf-8")
    begun = time.monotonic()
    with subprocess.Popen([taxeld, "run", "--config", config], stderr=subprocess.DEVNULL) as daemon:
        try:
            while True:
                assert daemon.poll() is None, "the daemon ended"
                with socket.socket() as client:
                    if client.connect_ex(("127.0.0.1", port)) == 0:
                        return time.monotonic() - begun
                time.sleep(0.002)
        finally:
            daemon.terminate()


def main():
    taxeld, scratch = sys.argv[1], pathlib.Path(sys.argv[2]).resolve()
    scratch.mkdir(parents=True, exist_ok=True)
    grown, empty = scratch / "grown.db", scratch / "empty.db"
    if not grown.exists():
        fill(grown)
    empty.unlink(missing_ok=True)
    for name, store in [("an empty store", empty), ("1,000 model sets, 10,000 sessions", grown)]:
        seconds = sorted(start(taxeld, scratch, store) for _ in range(5))
        size = os.path.getsize(store) / 1e6
        print(f"{name} ({size:.0f} MB): the port is open after {seconds[2]:.2f} s ({seconds[0]:.2f} to {seconds[-1]:.2f})")


main()
