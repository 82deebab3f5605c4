"""The newest force over the service: a thread of its own follows the stream and connects again; `force` never waits.

The messages come from the daemon's own reflection, so there is no generated code. Needs grpcio and grpcio-reflection.

The age is the sample's age when it was sent, plus the time that it was on its way, by the wall clocks of both machines, plus
the time that passed here since it came. Another machine than the daemon's needs NTP or PTP.
"""

from __future__ import annotations

import math
import os
import threading
import time
from typing import Any, Optional, Tuple, Union

from .force import Force, NoForce, Why, judge, state_name
from .refusal import reason_of

SOCKET = "/run/taxeld/taxeld.sock"
LOOPBACK = "127.0.0.1:50051"

_PAUSE_FIRST_S, _PAUSE_MOST_S = 0.05, 2.0  # between connections
# What is not read yet shall wait at the daemon, which replaces it by newer samples; not in this process.
_OPTIONS = [("grpc.http2.lookahead_bytes", 4096), ("grpc.http2.bdp_probe", 0), ("grpc.keepalive_time_ms", 5000)]
# gRPC would take the socket's path for the authority of each call, which HTTP/2 does not allow and the daemon refuses.
_UNIX_OPTIONS = [*_OPTIONS, ("grpc.default_authority", "localhost")]


def _now() -> float:
    """By a clock that goes on while this machine is suspended: a force from before is old then."""
    if hasattr(time, "CLOCK_BOOTTIME"):
        return time.clock_gettime(time.CLOCK_BOOTTIME)
    return time.monotonic()  # a system without that clock


def connect(
    address: Optional[str] = None,
    patch: str = "",
    *,
    rate_hz: Optional[float] = None,
    age_max_s: Optional[float] = None,
    token: Optional[str] = None,
    credentials: Any = None,
) -> "Forces":
    """Follows the force of a patch from now on; nobody need answer yet.

    `address`: HOST:PORT or unix:PATH; without one the daemon of this machine. `patch`: needed only if the daemon has several.
    `rate_hz`: 1 to 1000; without it each sample comes. `age_max_s`: the caller's own
    limit, if it has a stricter one than the daemon. `token`: shown with each call.
    `credentials`: `grpc.ssl_channel_credentials(...)` for a listener with TLS.
    """
    if address is None:
        address = f"unix:{SOCKET}" if os.path.exists(SOCKET) else LOOPBACK
    return Forces(address, patch, rate_hz, age_max_s, token, credentials)


def _on_the_way(sample: Any) -> float:
    """For how long a sample that just came was on its way, by the wall clocks of both machines; 0 where the daemon's is ahead."""
    sent = sample.sent.seconds + sample.sent.nanos * 1e-9
    return max(0.0, time.time() - sent) if sample.HasField("sent") else math.inf


class Forces:
    """The newest force of a patch. `force` may be called from any thread at any time."""

    def __init__(self, address, patch, rate_hz, age_max_s, token, credentials):
        import grpc  # noqa: F401: told here and not by a thread, if it is missing

        self._address, self._patch, self._rate_hz = address, patch, rate_hz
        self._age_max_s, self._credentials = age_max_s, credentials
        # A file that holds a token ends with a line feed, which no header may have.
        self._metadata = [("authorization", f"Bearer {token.strip()}")] if token else []
        self._newest: Optional[tuple] = None  # (sample, when it came, time on the way); replaced as a whole
        self._broken: Optional[str] = None
        self._refused: Tuple[str, ...] = ()  # why the daemon did, for programs
        self._closed = threading.Event()
        self._channel: Any = None
        threading.Thread(target=self._follow, name="taxel", daemon=True).start()

    def force(self) -> Union[Force, NoForce]:
        """The newest force if it may be acted on now; else a `NoForce`, which is false and says why."""
        newest, broken = self._newest, self._broken
        if newest is None:
            return NoForce(Why.DISCONNECTED, broken, codes=self._refused) if broken else NoForce(Why.NOTHING_YET)
        sample, came, on_the_way = newest
        state, waited_s = state_name(sample.state), on_the_way + _now() - came
        total_n, age_s = (getattr(sample, name) if sample.HasField(name) else None for name in ("total_n", "age_s"))
        why = judge(state, total_n, age_s, waited_s, sample.max_age_s, self._age_max_s)
        if why is None:
            return _force(sample, state, age_s + waited_s)
        if broken:  # what the daemon said last is no reason any more once it cannot be heard
            return NoForce(Why.DISCONNECTED, f"the stream was lost: {broken}", codes=self._refused)
        if why is Why.STATE:
            return NoForce(why, f"{state}: {'; '.join(sample.reasons)}", codes=_codes(sample))
        limit_s = sample.max_age_s if self._age_max_s is None else min(self._age_max_s, sample.max_age_s)
        return NoForce(why, f"{1e3 * (age_s + waited_s):.0f} ms old, more than {1e3 * limit_s:.0f} ms")

    def close(self) -> None:
        """Ends the connection."""
        self._closed.set()
        channel = self._channel
        if channel is not None:
            channel.close()

    def __enter__(self) -> "Forces":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def _follow(self) -> None:
        import grpc

        self._pause_s = _PAUSE_FIRST_S
        while not self._closed.is_set():
            secure = self._credentials
            options = _UNIX_OPTIONS if self._address.startswith("unix:") else _OPTIONS
            make = grpc.secure_channel if secure else grpc.insecure_channel
            channel = make(self._address, secure, options) if secure else make(self._address, options)
            self._channel = channel
            try:
                self._read(channel)
                self._refused, self._broken = (), "the daemon ended the stream"
            except grpc.RpcError as error:
                reason = reason_of(error)
                self._refused = (reason,) if reason else ()
                self._broken = f"{error.code().name}: {error.details()}"
            except Exception as error:  # a thread that dies would look like a daemon that is silent
                self._refused, self._broken = (), f"{type(error).__name__}: {error}"
            finally:
                channel.close()
            self._closed.wait(self._pause_s)
            self._pause_s = min(2 * self._pause_s, _PAUSE_MOST_S)

    def _read(self, channel: Any) -> None:
        from google.protobuf.descriptor_pool import DescriptorPool
        from google.protobuf.message_factory import GetMessageClass
        from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase

        pool = DescriptorPool(_Authorised(ProtoReflectionDescriptorDatabase, channel, self._metadata))
        service = pool.FindServiceByName("taxel.v1.ForceService")
        stream = service.FindMethodByName("StreamForce")
        sample_class, request = GetMessageClass(stream.output_type), GetMessageClass(stream.input_type)
        follow = channel.unary_stream(
            "/taxel.v1.ForceService/StreamForce", request.SerializeToString, sample_class.FromString
        )
        wanted = request(patch=self._patch)
        if self._rate_hz is not None:
            wanted.rate_hz = self._rate_hz
        for sample in follow(wanted, metadata=self._metadata):
            self._newest, self._broken = (sample, _now(), _on_the_way(sample)), None
            self._pause_s = _PAUSE_FIRST_S


class _Authorised:
    """A database of descriptors that shows the token with its calls, which the one of grpcio-reflection cannot."""

    def __new__(cls, database: Any, channel: Any, metadata: list) -> Any:
        if not metadata:
            return database(channel)
        import grpc

        class Show(grpc.StreamStreamClientInterceptor):
            def intercept_stream_stream(self, continuation, details, requests):
                return continuation(details._replace(metadata=metadata), requests)

        return database(grpc.intercept_channel(channel, Show()))


def _codes(sample: Any) -> Tuple[str, ...]:
    """The codes beside the reasons."""
    causes = sample.DESCRIPTOR.fields_by_name["causes"]
    known = causes.message_type.fields_by_name["code"].enum_type.values_by_number
    prefix = len("REASON_CODE_")
    return tuple(known[cause.code].name[prefix:] if cause.code in known else str(cause.code) for cause in sample.causes)


def _force(sample: Any, state: str, age_s: float) -> Force:
    def vector(name: str):
        value = getattr(sample, name)
        return (value.x, value.y, value.z) if sample.HasField(name) else None

    def known(name: str):
        return getattr(sample, name) if sample.HasField(name) else None

    return Force(
        total_n=sample.total_n,
        age_s=age_s,
        state=state,
        sequence=sample.sequence,
        sigma_n=known("total_sigma_n"),
        low_n=known("low_n"),
        high_n=known("high_n"),
        undetected_n=known("undetected_n"),
        step_n=known("step_n"),
        zero_epoch=sample.zero_epoch,
        simulated=sample.simulated,
        resultant_n=vector("resultant_n"),
        moment_nm=vector("moment_nm"),
        centre_of_pressure_m=vector("centre_of_pressure_m"),
        active=sample.active,
        excluded=sample.excluded,
        stale=sample.stale,
        out_of_range=sample.out_of_range,
        model_set=sample.model_set,
        reasons="; ".join(sample.reasons),
        codes=_codes(sample),
        monotonic_ns=known("monotonic_ns"),
        wall_ns=sample.time.ToNanoseconds() if sample.HasField("time") else 0,
    )
