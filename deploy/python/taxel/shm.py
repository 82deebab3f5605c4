"""The newest force of a patch from the shared memory of taxeld on the same machine. Needs nothing but Python on Linux.

    reader = Reader("/dev/shm/taxeld/left_forearm")     # need not be there yet
    force = reader.force()
    if force:
        act(force.total_n)
    else:
        do_without(force.why)

A page is refused if others may write in it or in its folder.

The layout of a page is in deploy/shared-memory.md. Python has no memory barriers, so a sample is also checked by its CRC.
"""

from __future__ import annotations

import math
import mmap
import os
import struct
import time
import zlib
from typing import Optional, Union

from .force import Force, NoForce, Why, judge, state_name

VERSION = 1
PAGE_BYTES = 4096
LOOK_EVERY_S = 0.05  # how often a reader without a living page looks for a new one

_MAGIC = b"TAXELFRC"
_SAMPLE_BYTES, _FIRST_SAMPLE = 512, 256
_VERSION, _AGE_LIMIT, _BEAT_LIMIT, _WRITES, _BEAT, _CLOSED = 1, 4, 5, 16, 17, 18  # by word of eight bytes
_SAMPLE = struct.Struct("=Qqqq2I6dQ9d4I64s256sQ")
assert _SAMPLE.size == _SAMPLE_BYTES
_TRIES = 16
_INT64 = 1 << 63


def _signed(word: int) -> int:
    return word - 2 * _INT64 if word >= _INT64 else word


def _text(raw: bytes) -> str:
    return raw.split(b"\0", 1)[0].decode("utf-8", "ignore")


class _Page:
    """One page of one run of a daemon."""

    def __init__(self, path: str):
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
        try:
            about = os.fstat(descriptor)
            folder = os.stat(os.path.dirname(path) or ".")
            if (about.st_mode | folder.st_mode) & 0o022:
                raise ValueError(f"{path}: others may write in it or in its folder")
            if about.st_size < PAGE_BYTES:
                raise ValueError(f"{path}: {about.st_size} bytes, expected {PAGE_BYTES}")
            self._memory = mmap.mmap(descriptor, PAGE_BYTES, mmap.MAP_SHARED, mmap.PROT_READ)
        finally:
            os.close(descriptor)
        self.file = (about.st_dev, about.st_ino)
        self._words = memoryview(self._memory).cast("Q")
        version, size = struct.unpack_from("=2I", self._memory, 8 * _VERSION)
        if self._memory[:8] != _MAGIC:
            raise ValueError(f"{path}: this is not a page of taxeld")
        if (version, size) != (VERSION, PAGE_BYTES):
            raise ValueError(f"{path}: layout {version} of {size} bytes, this reader knows {VERSION}")
        self.age_limit_s = self._words[_AGE_LIMIT] * 1e-9
        self.beat_limit_s = self._words[_BEAT_LIMIT] * 1e-9

    def _newest(self) -> Optional[tuple]:
        for _ in range(_TRIES):
            number = self._words[_WRITES]
            if number == 0:
                return None
            at = _FIRST_SAMPLE + (number & 1) * _SAMPLE_BYTES
            raw = self._memory[at : at + _SAMPLE_BYTES]
            fields = _SAMPLE.unpack(raw)
            if self._words[_WRITES] == number and zlib.crc32(raw[:-8]) == fields[-1]:
                return fields
        return None

    def force(self, age_max_s: Optional[float]) -> Union[Force, NoForce]:
        fields = self._newest()
        beat_ns, closed = _signed(self._words[_BEAT]), self._words[_CLOSED]
        now_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)  # last: all that was found is earlier on the same clock
        if fields is None:
            return NoForce(Why.CLOSED) if closed else NoForce(Why.NOTHING_YET)
        sample, frame_ns = _decode(fields)
        silence_s = (now_ns - beat_ns) * 1e-9
        age_s = None if frame_ns is None else (now_ns - frame_ns) * 1e-9
        sample["age_s"] = age_s
        if closed:
            return NoForce(Why.CLOSED, sample=sample)
        if silence_s < 0:
            return NoForce(Why.OTHER_CLOCK, sample=sample)
        if silence_s > self.beat_limit_s:
            return NoForce(Why.WRITER_GONE, f"the daemon's engine has not run for {1e3 * silence_s:.0f} ms", sample)
        if age_s is not None and age_s < 0:
            return NoForce(Why.OTHER_CLOCK, sample=sample)
        why = judge(sample["state"], sample["total_n"], age_s, 0.0, self.age_limit_s, age_max_s)
        if why is Why.STATE:
            return NoForce(why, f"{sample['state']}: {sample['reasons']}", sample)
        if why is Why.TOO_OLD:
            limit_s = self.age_limit_s if age_max_s is None else min(age_max_s, self.age_limit_s)
            return NoForce(why, f"{1e3 * age_s:.0f} ms old, more than {1e3 * limit_s:.0f} ms", sample)
        return Force(**sample)


def _decode(fields: tuple) -> Tuple[dict, Optional[int]]:
    sequence, frame_ns, wall_ns, written_ns, state, flags, total, sigma, low, high, undetected, step, epoch = fields[:13]
    vectors = fields[13:22]
    active, excluded, stale, out_of_range, models, reasons = fields[22:28]

    def known(*figures: float):
        there = all(map(math.isfinite, figures))
        return (figures[0] if len(figures) == 1 else figures) if there else None

    sample = {
        "sequence": sequence,
        "state": state_name(state),
        "total_n": known(total),
        "sigma_n": known(sigma),
        "low_n": known(low),
        "high_n": known(high),
        "undetected_n": known(undetected),
        "step_n": known(step),
        "zero_epoch": epoch,
        "resultant_n": known(*vectors[0:3]),
        "moment_nm": known(*vectors[3:6]),
        "centre_of_pressure_m": known(*vectors[6:9]),
        "simulated": bool(flags >> 1 & 1),
        "active": active,
        "excluded": excluded,
        "stale": stale,
        "out_of_range": out_of_range,
        "model_set": _text(models),
        "reasons": _text(reasons),
        "monotonic_ns": frame_ns if flags & 1 else None,
        "wall_ns": wall_ns,
        "written_ns": written_ns,
    }
    return sample, sample["monotonic_ns"]


class Reader:
    """Follows a patch over restarts of its daemon, each of which makes a new page under the same name."""

    def __init__(self, path: Union[str, "os.PathLike[str]"], age_max_s: Optional[float] = None):
        """`age_max_s`: the caller's own limit, if it has a stricter one than the daemon."""
        self._path = os.fspath(path)
        self._age_max_s = age_max_s
        self._page: Optional[_Page] = None
        self._look_at = -math.inf

    def force(self) -> Union[Force, NoForce]:
        """The newest force if it may be acted on now; else a `NoForce`, which is false and says why."""
        judged = self._judged()
        # A page without a sample may be that of a daemon that was killed as it started.
        lost = (Why.NO_PAGE, Why.NOTHING_YET, Why.CLOSED, Why.WRITER_GONE)
        if judged or judged.why not in lost or not self._finds_another():
            return judged
        return self._judged()

    def _judged(self) -> Union[Force, NoForce]:
        return self._page.force(self._age_max_s) if self._page else NoForce(Why.NO_PAGE)

    def _finds_another(self) -> bool:
        now = time.monotonic()
        if now < self._look_at:
            return False
        self._look_at = now + LOOK_EVERY_S
        try:
            about = os.stat(self._path)
            if self._page and self._page.file == (about.st_dev, about.st_ino):
                return False
            self._page = _Page(self._path)
        except (OSError, ValueError):
            return False
        return True
