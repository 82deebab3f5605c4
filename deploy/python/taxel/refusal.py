"""Why the daemon refused a call, for programs: the details of a gRPC status, without any package beside grpcio.

What the reasons mean is written at `ErrorReason` in proto/taxel/v1/error.proto.
"""

from __future__ import annotations

from typing import Any, Dict, Iterator, Optional, Tuple

_TRAILER = "grpc-status-details-bin"
_INFO = "type.googleapis.com/google.rpc.ErrorInfo"


def reason_of(error: Any) -> Optional[str]:
    """The reason that a `grpc.RpcError` carries, such as `SKIN_LOADED`; None if it carries none of the daemon's."""
    return info_of(error)[0]


def info_of(error: Any) -> Tuple[Optional[str], Dict[str, str]]:
    """The same with what it is about, such as `{"patch": "left_forearm"}`."""
    for key, value in (getattr(error, "trailing_metadata", tuple)() or ()):
        if key == _TRAILER:
            try:
                return _info(value)
            except (IndexError, UnicodeDecodeError, ValueError):
                return None, {}
    return None, {}


def _info(status: bytes) -> Tuple[Optional[str], Dict[str, str]]:
    """The google.rpc.ErrorInfo of domain `taxeld` in the details (field 3) of a google.rpc.Status."""
    for number, detail in _fields(status):
        if number != 3:
            continue
        packed = dict(_fields(detail))  # google.protobuf.Any: type_url = 1, value = 2
        if packed.get(1, b"").decode() != _INFO:
            continue
        reason, domain, metadata = None, None, {}
        for number, value in _fields(packed.get(2, b"")):
            if number == 1:
                reason = value.decode()
            elif number == 2:
                domain = value.decode()
            elif number == 3:
                entry = dict(_fields(value))
                metadata[entry.get(1, b"").decode()] = entry.get(2, b"").decode()
        if domain == "taxeld":
            return reason, metadata
    return None, {}


def _fields(message: bytes) -> Iterator[Tuple[int, bytes]]:
    """The fields of a protobuf message that hold bytes; of the others these messages have but numbers, which are passed."""
    at = 0

    def varint() -> int:
        nonlocal at
        value = shift = 0
        while True:
            byte = message[at]
            at += 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    while at < len(message):
        tag = varint()
        if tag & 7 == 0:
            varint()
        elif tag & 7 == 2:
            length = varint()
            if at + length > len(message):
                raise ValueError("a field goes beyond its message")
            yield tag >> 3, message[at : at + length]
            at += length
        else:
            raise ValueError("a field of another kind than google.rpc.Status has")
