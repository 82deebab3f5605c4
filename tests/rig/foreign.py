#!/usr/bin/env python3
"""Gauges and drives whose other side others wrote: registers of a pymodbus server, a simulated Alicat that PyPI's drivers speak to.

usage: foreign.py TAXELD SCRATCH

What moves the pressure behind each drive is the simulated pump of `taxeld demo --device`, so a calibration through it ends with
models in use. What is not installed here is skipped, and said so.
"""

import asyncio
import json
import os
import pathlib
import pty
import re
import select
import socket
import subprocess
import sys
import threading
import time
import tty

from bench import PATIENCE_S, Bench, Calibration, Works, ended_early, tried

CONFIG = """
listen = ["unix:{folder}/s"]
[store]
path = "store.db"
[[bus]]
name = "skin"
source = "sim"
[[patch]]
name = "lower"
bus = "skin"
listen_only = true
boards = [{{ address = 12, modules = "0-6" }}]
gauge = {{ line = "{at}", register = "input 18 f32 x0.1 slave 3", unit = "mbar" }}
"""


def in_background(run):
    threading.Thread(target=run, daemon=True).start()


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as free:
        return free.getsockname()[1]


class Terminals:
    """Two pseudo terminals as the ends of one serial cable."""

    def __init__(self):
        self.masters, self.paths, self.slaves = [], [], []
        for _ in range(2):
            master, slave = pty.openpty()
            tty.setraw(slave)
            self.masters.append(master)
            self.slaves.append(slave)  # kept open: nobody hangs up
            self.paths.append(os.ttyname(slave))
        in_background(self._pass)

    def _pass(self):
        while True:
            for master in select.select(self.masters, [], [])[0]:
                os.write(self.masters[1 - self.masters.index(master)], os.read(master, 4096))


def modbus(device, at):
    """A server of pymodbus, over TCP or as RTU."""
    from pymodbus import FramerType
    from pymodbus.server import ModbusSerialServer, ModbusTcpServer

    async def serve():
        if isinstance(at, int):
            await ModbusTcpServer(device, address=("127.0.0.1", at)).serve_forever()
        else:
            await ModbusSerialServer(device, framer=FramerType.RTU, port=at, baudrate=115200).serve_forever()

    in_background(lambda: asyncio.run(serve()))


def registers(slave, first, count, action):
    from pymodbus.simulator import DataType, SimData, SimDevice

    return SimDevice(slave, simdata=[SimData(first, count=count, values=0, datatype=DataType.REGISTERS)], action=action)


def gauge_is_read(taxeld, scratch, at, near):
    """The daemon reads a register of pymodbus, and follows what is in it."""
    import struct

    now = {"kpa": 12.5}

    async def action(_function, start, _address, _count, current, _values):
        current[18 - start : 20 - start] = struct.unpack(">HH", struct.pack(">f", 100 * now["kpa"]))

    modbus(registers(3, 10, 20, action), near)
    folder = scratch / ("rtu" if isinstance(near, str) else "tcp")
    folder.mkdir()
    (folder / "taxeld.toml").write_text(CONFIG.format(folder=folder, at=at))
    with open(folder / "log", "wb") as log:
        daemon = subprocess.Popen([taxeld, "run", "--config", folder / "taxeld.toml"], cwd=folder, stdout=log, stderr=log)

    def read():
        words = [taxeld, "health", "--json", "--server", f"unix:{folder}/s"]
        answer = subprocess.run(words, capture_output=True, text=True).stdout
        return json.loads(answer)["patches"][0].get("gaugeKpa") if answer else None

    try:
        for kpa in (12.5, 43.75):
            now["kpa"] = kpa
            end = time.monotonic() + PATIENCE_S
            while (found := read()) is None or abs(found - kpa) > 1e-3:
                assert time.monotonic() < end and daemon.poll() is None, f"{at}: {found}, not {kpa}\n{(folder / 'log').read_text()}"
        print(f"gauge in a register of pymodbus, {folder.name}: read as it is", flush=True)
    finally:
        daemon.terminate()
        daemon.wait(PATIENCE_S)


def calibrated(bench, what, profile, at):
    """A calibration through a drive ends with models in use, and its own gauge agrees with the bag's."""
    one = Calibration(bench, profile, at, "--attended")
    if one.process.wait(PATIENCE_S):
        ended_early(one.said())
    said = one.said()
    for part in ("drive: self-test", "drive: rising", "is in use"):
        assert part in said, (part, said)
    differ = re.search(r"its own gauge read up to ([+-][0-9.]+) kPa", said)
    assert differ and abs(float(differ[1])) < 4.0, said
    bench.until("a vented bag", lambda: bench.gauge_kpa() < 1.5)
    print(f"{what}: calibrated; {differ[0]} against the bag's", flush=True)


def gripper_over_tcp(bench):
    """A VG10: mode and percent in register 0, the vacuum in 1/1000 in register 18."""
    works = Works(bench.drive_port)

    async def action(_function, start, _address, _count, current, values):
        if values:
            mode, percent = values[0] >> 8, values[0] & 0xFF
            works.set_kpa = 1.01325 * percent if mode == 1 else None
        current[18 - start] = round(works.kpa / 0.101325)

    port = free_port()
    modbus(registers(65, 0, 30, action), port)
    try:
        calibrated(bench, "VG10 by pymodbus over TCP", "vg10", f"tcp:127.0.0.1:{port}")
    finally:
        works.close()


def gripper_over_rtu(bench):
    """An EPick: action, absolute pressure and times from register 1000, what it was asked for and has from 2001."""
    works, cable = Works(bench.drive_port), Terminals()

    async def action(_function, start, _address, _count, current, values):
        if values:
            asked = values[1] & 0xFF
            works.set_kpa = 100 - asked if values[0] == 0x0B00 and asked < 100 else None
            current[2001 - start] = asked
        current[2002 - start] = round(100 - works.kpa) << 8

    modbus(registers(9, 1000, 1010, action), cable.paths[0])
    try:
        calibrated(bench, "EPick by pymodbus as RTU", "epick", cable.paths[1])
    finally:
        works.close()


class Alicat:
    """A PCD of the firmware 5v12, as far as its drivers ask."""

    FORMAT = ["A  D00 NAME_______ TYPE_____ MinVal_  MaxVal_  UNITS__", "A  D01 Unit ID char A Z na",
              "A  D02 Pressure signed -100.00 +100.00 kPaG", "A  D03 Setpoint signed -100.00 +100.00 kPaG"]

    def __init__(self, works):
        self.works, self.listener = works, socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        in_background(self._accept)

    def answer(self, line):
        poll = lambda: [f"A {-self.works.kpa:+07.2f} {-(self.works.set_kpa or 0.0):+07.2f}"]
        if line in ("A", "A$$H", "A$$C"):
            return poll()
        if found := re.fullmatch(r"AS ?([-+]?[0-9.]+)", line):
            self.works.set_kpa = max(0.0, -float(found[1]))
            return poll()
        return {"AVE": ["A   5v12.0-R24 Dec 10 2014, 10:35:21"], "A??D*": self.FORMAT, "AR122": ["A   122 = 38"]}.get(line, ["?"])

    def serve(self, read, write):
        came = b""
        while data := read():
            *lines, came = (came + data).split(b"\r")
            for line in lines:
                write("".join(f"{text}\r" for text in self.answer(line.decode().strip())).encode())

    def _accept(self):
        while True:
            one, _ = self.listener.accept()
            in_background(lambda one=one: self.serve(lambda: one.recv(256), one.sendall))

    def on_a_terminal(self):
        cable = Terminals()
        in_background(lambda: self.serve(lambda: os.read(cable.slaves[0], 256), lambda data: os.write(cable.slaves[0], data)))
        return cable.paths[1]


def until_held(alicat, kpa):
    end = time.monotonic() + PATIENCE_S
    while abs(alicat.works.kpa - kpa) > 0.2:
        assert time.monotonic() < end, alicat.works.kpa
        time.sleep(0.05)  # the pump works


async def numat(alicat, path):
    """The driver `alicat`, of numat."""
    from alicat import FlowController

    for at in (f"127.0.0.1:{alicat.port}", path):
        async with FlowController(at) as device:
            await device.set_pressure(-12.0)
            until_held(alicat, 12.0)
            read = await device.get()
            assert abs(read["pressure"] + 12.0) < 0.5 and read["setpoint"] == -12.0, read
            assert read["control_point"] == "gauge pressure", read
            await device.set_pressure(0.0)
            until_held(alicat, 0.0)
    print(f"the driver alicat sets and reads it over TCP and a terminal: {read}", flush=True)


async def modern(alicat, path):
    """The driver `alicatlib`."""
    from alicatlib.commands import Capability
    from alicatlib.devices.factory import open_device

    hint = "PCD-100KPAG-D"
    async with await open_device(path, model_hint=hint, assume_capabilities=Capability.BIDIRECTIONAL) as device:
        state = await device.setpoint(-12.0)
        assert state.requested == -12.0, state
        until_held(alicat, 12.0)
        read = (await device.poll()).values
        assert abs(read["Pressure"] + 12.0) < 0.5, read
        await device.setpoint(0.0)
        until_held(alicat, 0.0)
    print(f"the driver alicatlib sets and reads it over a terminal: {read}", flush=True)


def alicats(bench):
    works = Works(bench.drive_port)
    alicat = Alicat(works)
    try:
        for name, driver in [("alicat", numat), ("alicatlib", modern)]:
            try:
                __import__(name)
            except ImportError as why:
                print(f"SKIPPED: the driver {name} is not here ({why})", flush=True)
                continue
            asyncio.run(driver(alicat, alicat.on_a_terminal()))
        calibrated(bench, "Alicat over TCP", "alicat", f"tcp:127.0.0.1:{alicat.port}")
        works.set_kpa = None
    finally:
        works.close()


def main(taxeld, scratch):
    scratch = pathlib.Path(scratch).resolve()
    scratch.mkdir(parents=True, exist_ok=True)
    try:
        import pymodbus
    except ImportError as why:
        pymodbus = None
        print(f"SKIPPED: pymodbus is not here ({why})", flush=True)
    if pymodbus:
        port, cable = free_port(), Terminals()
        gauge_is_read(taxeld, scratch, f"tcp:127.0.0.1:{port}", port)
        gauge_is_read(taxeld, scratch, cable.paths[1], cable.paths[0])
    bench = Bench(taxeld, scratch)
    try:
        tried(alicats, bench)
        if pymodbus:
            tried(gripper_over_tcp, bench)
            tried(gripper_over_rtu, bench)
    finally:
        bench.demo.terminate()
        bench.demo.wait(PATIENCE_S)


if __name__ == "__main__":
    main(os.path.abspath(sys.argv[1]), sys.argv[2])
