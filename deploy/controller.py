#!/usr/bin/env python3
"""A robot controller that reads the force of the skin: the newest sample, only if it is good and fresh.

usage: controller.py [ADDRESS [PATCH]]          (127.0.0.1:50051 and the only patch unless given)
needs: pip install grpcio grpcio-reflection     (no generated code: the messages come from the daemon's reflection)

The whole policy in one file; the package in python/ has the same and more, for use as it is.

Policy:
1. A thread of its own takes samples off the stream at once and keeps the newest. The control loop never waits and
   never works through a queue of old samples.
2. Only OK and DEGRADED are forces. STALE, TARE_INVALID and UNCALIBRATED carry none: the loop does without.
3. The age is the sample's age when it was sent, plus the time that it was on its way, plus the time that passed here since
   it came. How long the way takes shows a question beside the stream: the daemon answered not before the question left.
   The limit comes with each sample: `max_age_s`.
4. A stream that ends is opened again; until then the force grows old and is refused.
"""

import math
import sys
import threading
import time

import grpc
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase

RATE_HZ = 200.0  # samples per second that the daemon is asked for
LOOP_S = 0.010  # the control loop's own period
ASK_EVERY_S = 10.0  # how often the daemon's clock is looked at
ANSWER_WITHIN_S = 2.0
DRIFT = 6e-4  # two clocks part by so many seconds a second at most
ASTRAY_S = 0.05  # on clocks that run no sample comes so long before it was sent
GOOD = ("FORCE_STATE_OK", "FORCE_STATE_DEGRADED")
# What is not read yet shall wait at the daemon, which replaces it by newer samples; not in this process.
OPTIONS = [("grpc.http2.lookahead_bytes", 4096), ("grpc.http2.bdp_probe", 0), ("grpc.keepalive_time_ms", 5000)]
# gRPC would take a socket's path for the authority of each call, which HTTP/2 does not allow and the daemon refuses.
UNIX_OPTIONS = [*OPTIONS, ("grpc.default_authority", "localhost")]


class NewestForce:
    """Follows a patch's force; `usable` may be called from any thread at any time."""

    def __init__(self, address, patch=""):
        self.address, self.patch = address, patch
        self.newest = None  # (sample, state, when it came, delay); replaced as a whole, never changed
        self.broken = None  # what is wrong with the stream
        threading.Thread(target=self._follow, daemon=True).start()

    def _follow(self):
        while True:
            try:
                options = UNIX_OPTIONS if self.address.startswith("unix:") else OPTIONS
                with grpc.insecure_channel(self.address, options) as channel:
                    self._read(channel)
                self.broken = "the daemon ended the stream"
            except grpc.RpcError as error:
                self.broken = f"{error.code().name}: {error.details()}"
            except Exception as error:  # of a daemon that ended while its services were looked up; the next one has them
                self.broken = f"{type(error).__name__}: {error}"
            time.sleep(0.5)

    def _read(self, channel):
        pool = DescriptorPool(ProtoReflectionDescriptorDatabase(channel))
        service = pool.FindServiceByName("taxel.v1.ForceService")
        get, method = service.FindMethodByName("GetForce"), service.FindMethodByName("StreamForce")
        question, request = GetMessageClass(get.input_type), GetMessageClass(method.input_type)
        sample_class = GetMessageClass(method.output_type)
        ask = channel.unary_unary("/taxel.v1.ForceService/GetForce", question.SerializeToString, sample_class.FromString)
        states = pool.FindEnumTypeByName("taxel.v1.ForceState").values_by_number
        stream = channel.unary_stream(
            "/taxel.v1.ForceService/StreamForce", request.SerializeToString, sample_class.FromString
        )
        least, found = -math.inf, 0.0  # the least that our clock less the daemon's can be, and when that was found
        before = (-math.inf, 0.0, -math.inf)  # the same before the last answer that raised it, and when that was sent

        def look_at_the_clock():
            nonlocal least, found, before
            left = now_s()
            answered = sent_s(ask(question(patch=self.patch), timeout=ANSWER_WITHIN_S))
            if answered is not None and left - answered > least - DRIFT * (left - found):
                if least > -math.inf:
                    before = (least, found, answered)
                least, found = left - answered, left
            return left

        asked = look_at_the_clock()
        for sample in stream(request(patch=self.patch, rate_hz=RATE_HZ)):
            now, sent = now_s(), sent_s(sample)
            if now - asked > ASK_EVERY_S or (sent is not None and least == -math.inf):
                asked = look_at_the_clock()
            delay = math.inf
            if sent is not None:
                # Where the daemon's clock stood still, as in a sleep of its machine, the last answer says nothing of samples from before.
                known, at = before[:2] if sent < before[2] else (least, found)
                delay = now - sent - known + DRIFT * max(0.0, now - at)
                if delay < -ASTRAY_S:  # our clock has stood still: nothing is known of the daemon's any more
                    delay, least, before = math.inf, -math.inf, (-math.inf, 0.0, -math.inf)
                delay = max(0.0, delay)
            self.newest, self.broken = (sample, states[sample.state].name, now, delay), None

    def usable(self):
        """(newton, age in s, "") or (None, None, why there is no force to act on)."""
        if self.newest is None:
            return None, None, self.broken or "no sample yet"
        sample, state, came, delay = self.newest
        if state not in GOOD or not sample.HasField("total_n") or not sample.HasField("age_s"):
            return None, None, self.broken or f"{state}: {'; '.join(sample.reasons)}"
        if not math.isfinite(sample.total_n) or not sample.age_s >= 0:
            return None, None, f"{sample.total_n} N, {sample.age_s} s old: that is no force"
        age = sample.age_s + delay + now_s() - came
        if not age <= sample.max_age_s:  # also if it is no number
            return None, None, self.broken or f"{1e3 * age:.0f} ms old, more than {1e3 * sample.max_age_s:.0f} ms"
        return sample.total_n, age, ""


def now_s():
    """By a clock that goes on while this machine sleeps: a force from before is old then."""
    if hasattr(time, "CLOCK_BOOTTIME"):
        return time.clock_gettime(time.CLOCK_BOOTTIME)
    return time.monotonic()  # a system without that clock


def sent_s(sample):
    """When the daemon sent this, in seconds of its own clock; None if no frame has come to it yet."""
    if not (sample.HasField("monotonic_ns") and sample.HasField("age_s")):
        return None
    return sample.monotonic_ns * 1e-9 + sample.age_s


def main():
    force = NewestForce(*sys.argv[1:3] or ["127.0.0.1:50051"])
    cycle, next_cycle = 0, time.monotonic()
    while True:
        newton, age, why = force.usable()
        # Here the controller acts. This one shows what it has, twice a second.
        if cycle % 50 == 0:
            print(f"no force: {why}" if newton is None else f"{newton:6.2f} N, {1e3 * age:3.0f} ms old", flush=True)
        cycle += 1
        next_cycle = max(next_cycle + LOOP_S, time.monotonic())
        time.sleep(max(0.0, next_cycle - time.monotonic()))


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass
