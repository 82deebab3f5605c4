#!/usr/bin/env python3
"""A real Prometheus scrapes the demo, and knows every metric that deploy/grafana.json draws.

    tests/page/metrics.py TAXELD SCRATCH

Needs Debian's prometheus.
"""

import json
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import time
import urllib.parse
import urllib.request

PATIENCE_S = 300
HOME = pathlib.Path(__file__).resolve().parents[2]
DASHBOARD = HOME / "deploy/grafana.json"
SOURCE = HOME / "crates/taxel-page/src/metrics.rs"

# What is absent in a demo that nobody has calibrated yet.
ABSENT = {
    "taxeld_force_newtons",
    "taxeld_force_sigma_newtons",
    "taxeld_force_low_newtons",
    "taxeld_force_high_newtons",
    "taxeld_model_set_info",
}


def until(what, condition):
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        found = condition()
        if found:
            return found
        time.sleep(0.1)
    raise AssertionError(f"{what}: not within {PATIENCE_S} s")


def main():
    taxeld, scratch = sys.argv[1], pathlib.Path(sys.argv[2])
    scratch.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(scratch / "tsdb", ignore_errors=True)
    log = open(scratch / "metrics-demo.log", "w+")
    daemon = subprocess.Popen([taxeld, "demo", "--bare"], stdout=log, stderr=subprocess.STDOUT)
    prometheus = None
    try:
        def address():
            log.seek(0)
            assert daemon.poll() is None, "the demo ended"
            return re.search(r"http://(127\.0\.0\.1:\d+)/", log.read())

        target = until("the demo's address", address).group(1)
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            listen = f"127.0.0.1:{probe.getsockname()[1]}"
        config = scratch / "prometheus.yml"
        config.write_text(f"scrape_configs:\n- job_name: taxeld\n  scrape_interval: 500ms\n  scrape_timeout: 500ms\n  static_configs: [{{targets: ['{target}']}}]\n")
        command = ["prometheus", f"--config.file={config}", f"--storage.tsdb.path={scratch}/tsdb", f"--web.listen-address={listen}"]
        prometheus = subprocess.Popen(command, stdout=open(scratch / "prometheus.log", "w"), stderr=subprocess.STDOUT)

        def ask(path):
            try:
                with urllib.request.urlopen(f"http://{listen}/api/v1/{path}") as answer:
                    return json.load(answer)["data"]
            except OSError:
                return None

        def query(expression):
            return (ask("query?" + urllib.parse.urlencode({"query": expression})) or {}).get("result")

        until("two scrapes", lambda: query("increase(taxeld_bus_frames_total[1m]) > 0"))
        targets = ask("targets")["activeTargets"]
        assert [t["health"] for t in targets] == ["up"], targets
        assert float(query("taxeld_force_state{state='uncalibrated'}")[0]["value"][1]) == 1
        known = {t["expr"] for panel in json.loads(DASHBOARD.read_text())["panels"] for t in panel["targets"]}
        names = {name for expression in known for name in re.findall(r"taxeld_\w+", expression)}
        for name in sorted(names - ABSENT):
            assert query(name), f"{name} has no value"
        for name in ABSENT:
            assert f'"{name.removeprefix("taxeld_")}"' in SOURCE.read_text(), f"{name} is no metric"
        for expression in known:
            assert query(expression.replace("$patch", ".*")) is not None, f"refused: {expression}"
        print(f"Prometheus scrapes {target}; {len(known)} expressions of the dashboard hold, over {len(names)} metrics")
    finally:
        for process in filter(None, [prometheus, daemon]):
            process.terminate()
            process.wait(30)


if __name__ == "__main__":
    main()
