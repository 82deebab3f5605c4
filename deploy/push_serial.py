#!/usr/bin/env python3
"""Pushes the scans of an array on a serial line to taxeld: a skin that is not on CAN.

usage: push_serial.py DEVICE [--patch NAME] [--address 127.0.0.1:50051] [--baud 115200] [--pressure]
       an account that may push comes over the Unix socket: --address unix:/run/taxeld/taxeld.sock
needs: pip install grpcio grpcio-reflection     (no generated code: the messages come from the daemon's reflection)

The array sends a line of text for each scan: one raw count per taxel, with --pressure then the differential pressure in
the bag in Pa, and after a `*` the exclusive or of all bytes before it in two hexadecimal digits, as in NMEA 0183:

    1843,1839,1851,...,12500*5C

For an array that sends something else, change `scan_of`. Policy:
1. A line that is torn or damaged is no scan: it is counted and left out. Without a check sum a lost digit would be force.
2. When this program is held up only the newest scan is pushed. Old ones would come too fast one after the other, and the
   daemon refuses that.
3. The daemon gives each scan the time at which it receives it. So nothing waits here.
4. A stream that ends is begun again. The daemon then wants a new zero: it cannot know that the array is the same.
"""

import argparse
import os
import sys
import termios
import threading
import time

import grpc
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase

LINE_BYTES_MAX = 65536


def open_serial(device, baud):
    """The line without any translation of bytes."""
    port = os.open(device, os.O_RDWR | os.O_NOCTTY)
    settings = termios.tcgetattr(port)
    speed = getattr(termios, f"B{baud}")
    settings[0] = settings[1] = settings[3] = 0
    settings[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
    settings[4] = settings[5] = speed
    settings[6][termios.VMIN], settings[6][termios.VTIME] = 1, 0
    termios.tcsetattr(port, termios.TCSANOW, settings)
    termios.tcflush(port, termios.TCIFLUSH)
    return port


def scan_of(line, taxels, pressure):
    """Counts and pressure in kPa of a line; None if it is damaged."""
    body, star, check = line.strip().rpartition(b"*")
    parity = 0
    for byte in body:
        parity ^= byte
    try:
        if not star or int(check, 16) != parity:
            return None
        numbers = [int(number) for number in body.split(b",")]
    except ValueError:
        return None
    if len(numbers) != taxels + pressure:
        return None
    return numbers[:taxels], numbers[taxels] * 1e-3 if pressure else None


class Newest:
    """The newest scan of the line, read by a thread of its own."""

    def __init__(self, port, taxels, pressure):
        self.port, self.taxels, self.pressure = port, taxels, pressure
        self.came = threading.Condition()
        self.scan, self.gone = None, False
        self.damaged, self.left_out = 0, 0
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        rest = b""
        try:
            while chunk := os.read(self.port, 65536):
                *lines, rest = (rest + chunk).split(b"\n")
                rest = rest if len(rest) <= LINE_BYTES_MAX else b""
                for line in lines:
                    self._take(scan_of(line, self.taxels, self.pressure))
        except OSError as error:
            print(f"the serial line: {error}", file=sys.stderr)
        with self.came:
            self.gone = True
            self.came.notify_all()

    def _take(self, scan):
        with self.came:
            if scan is None:
                self.damaged += 1
                return
            self.left_out += self.scan is not None
            self.scan = scan
            self.came.notify_all()

    def take(self):
        """The next scan, waiting for it; None when the line is gone."""
        with self.came:
            self.came.wait_for(lambda: self.scan is not None or self.gone)
            scan, self.scan = self.scan, None
            return scan


def push(channel, newest_of, patch):
    """One stream of scans, until it ends."""
    pool = DescriptorPool(ProtoReflectionDescriptorDatabase(channel))

    def method(service, name):
        found = pool.FindServiceByName(f"taxel.v1.{service}").FindMethodByName(name)
        return GetMessageClass(found.input_type), GetMessageClass(found.output_type)

    skin_request, skin = method("SkinService", "GetSkin")
    get_skin = channel.unary_unary("/taxel.v1.SkinService/GetSkin", skin_request.SerializeToString, skin.FromString)
    newest = newest_of(len(get_skin(skin_request(patch=patch), timeout=10).taxels))
    request, response = method("IngestService", "PushScans")
    begun = threading.Event()

    def scans():
        yield request(patch=patch)
        begun.wait()
        newest.take()  # an old one
        while (scan := newest.take()) is not None:
            counts, kpa = scan
            yield request(counts=counts, pressure_kpa=kpa)

    call = channel.stream_stream(
        "/taxel.v1.IngestService/PushScans", request.SerializeToString, response.FromString
    )(scans())
    try:
        for answer in call:
            if begun.is_set():
                print(f"{answer.taken} scans taken, {answer.refused} refused; {newest.damaged} lines damaged, "
                      f"{newest.left_out} left out for a newer one", flush=True)
            else:
                print("pushing", flush=True)
            begun.set()
    finally:
        begun.set()
    return not newest.gone


def main():
    words = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    words.add_argument("device")
    words.add_argument("--patch", default="")
    words.add_argument("--address", default="127.0.0.1:50051")
    words.add_argument("--baud", type=int, default=115200)
    words.add_argument("--pressure", action="store_true", help="the last number of a line is the bag's pressure in Pa")
    asked = words.parse_args()
    port = open_serial(asked.device, asked.baud)
    newest = None

    def newest_of(taxels):
        nonlocal newest
        newest = newest or Newest(port, taxels, asked.pressure)
        return newest

    while True:
        try:
            # gRPC would take a socket's path for the authority of each call, which HTTP/2 does not allow and the daemon refuses.
            options = [("grpc.default_authority", "localhost")] if asked.address.startswith("unix:") else []
            with grpc.insecure_channel(asked.address, options) as channel:
                if not push(channel, newest_of, asked.patch):
                    return
        except grpc.RpcError as error:
            print(f"{error.code().name}: {error.details()}", file=sys.stderr, flush=True)
        time.sleep(1.0)


if __name__ == "__main__":
    main()
