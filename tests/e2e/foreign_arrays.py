#!/usr/bin/env python3
"""Three arrays that are no skin of iCub, and one that is, on four CAN buses of one daemon.

The frames are encoded by cantools, sent by boards.py, and read by `taxeld run` through SocketCAN with nothing but the
descriptions of tests/arrays. The four skins are calibrated side by side through the service, and a known load is read by
the foreign client: the force of each array must be within half a point of that of the native path.

usage: foreign_arrays.py TAXELD SCRATCH      (inside tests/vcan/lab: makes the interfaces that it needs)
"""

import pathlib
import subprocess
import sys
import tempfile
import threading

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "arrays"))

import arrays
from foreign import Client
from run import ADDRESS, Boards, Daemon, calibrate, health_until, mean_force

# Below the 5 kPa/s that a session takes; down in three seconds, since a faster fall is that of a burst bag.
RISE_KPA_PER_S = 4.0
FALL_KPA_PER_S = 24.0
REST_S, RAMP_TOP_S = 3.0, 1.0 + arrays.TOP_KPA / RISE_KPA_PER_S


def bag(t):
    """Up from the first second on, and down again."""
    if t < RAMP_TOP_S:
        return max(0.0, RISE_KPA_PER_S * (t - 1.0))
    return max(0.0, arrays.TOP_KPA - FALL_KPA_PER_S * (t - RAMP_TOP_S))


class Bench:
    """One array on an interface of its own."""

    def __init__(self, array, interface, scratch):
        self.array, self.interface = array, interface
        self.patch = array.config.removesuffix(".toml")
        self.of = {"patch": self.patch}
        logs = scratch / self.patch
        logs.mkdir()
        none = lambda *_: 0.0
        at_rest = lambda t: 0.0
        self.rest = str(arrays.write(array, logs / "rest.log", REST_S, at_rest, none))
        self.ramp = str(arrays.write(array, logs / "ramp.log", RAMP_TOP_S + 5.0, bag, lambda taxel, t: bag(t)))
        load = lambda taxel, t: arrays.LOAD_KPA if taxel < arrays.LOADED else 0.0
        self.load = str(arrays.write(array, logs / "load.log", REST_S, at_rest, load))
        self.error = None

    def section(self, scratch):
        """Its part of the configuration: the description as it is, but for the bus, its file and how long it may be silent.

        A machine that does something else for a while holds the boards up, and that is not what is tested here."""
        text = (HERE.parent / "arrays" / self.array.config).read_text(encoding="ascii")
        assert text.count('"can0"') == 1 and text.count('"can"') == 2, text
        text = text.replace('"can0"', f'"{self.interface}"').replace('"can"', f'"{self.patch}"')
        text = text.replace('store.path = "unused.db"\n', "")
        if hasattr(self.array, "dbc"):
            file = f"{self.patch}.dbc"
            (scratch / file).write_text(self.array.dbc, encoding="ascii")
        return text + "stale_periods = 40\n"

    def weigh(self):
        """Calibrates the array and reads the load, as a share too much."""
        client = Client(ADDRESS)
        with Boards(self.rest, self.ramp, self.load, interface=self.interface) as boards:
            # A busy machine starts the boards late, and no session begins beside a silent gauge.
            health_until(client, lambda health: any(
                one.patch == self.patch and one.HasField("gauge_age_s") for one in health.patches
            ))
            calibrate(client, boards, self.ramp, **self.of)
            boards.stay_at(self.load)
            truth = arrays.LOADED * arrays.LOAD_KPA * arrays.AREA_MM2 * 1e-3
            force, active = mean_force(client, 60, 0.9 * truth, **self.of)
        self.error = force / truth - 1.0
        print(f"{self.patch}: {truth:.2f} N read {force:.3f} N ({100 * self.error:+.2f} %), {active:.1f} active", flush=True)


def make_interface(name):
    if not pathlib.Path("/sys/class/net", name).exists():
        subprocess.run(["ip", "link", "add", "dev", name, "type", "vcan"], check=True)
    subprocess.run(["ip", "link", "set", name, "up"], check=True)


def check_health(client, benches):
    """Every frame on all buses was one of ours, and understood."""
    for bench, bus in zip(benches, client.call("SkinService/GetHealth").buses):
        assert bus.up and bus.frames and not (bus.foreign or bus.malformed or bus.dropped), (bench.patch, str(bus))


def main():
    taxeld = sys.argv[1]
    pathlib.Path(sys.argv[2]).mkdir(parents=True, exist_ok=True)
    scratch = pathlib.Path(tempfile.mkdtemp(dir=sys.argv[2]))
    skins = [arrays.Native(), arrays.multiplexed(), arrays.can_fd(), arrays.rising()]
    benches = [Bench(array, f"vcan{n}", scratch) for n, array in enumerate(skins)]
    config = scratch / "arrays.toml"
    sections = "\n".join(bench.section(scratch) for bench in benches)
    config.write_text(f'store.path = "{scratch}/arrays.db"\n\n{sections}', encoding="ascii")
    for bench in benches:
        make_interface(bench.interface)
    with Daemon(taxeld, str(config)) as client:
        threads = [threading.Thread(target=bench.weigh) for bench in benches]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        check_health(client, benches)
    failed = [bench.patch for bench in benches if bench.error is None]
    assert not failed, f"no force of {failed}"
    native = benches[0].error
    for bench in benches:
        worse = abs(bench.error) - abs(native)
        assert worse <= arrays.MARGIN, (bench.patch, bench.error, native)
    print(f"{len(benches)} passed, 0 failed")


if __name__ == "__main__":
    main()
