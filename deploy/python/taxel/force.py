"""What a controller gets: a force that may be acted on, or why there is none."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field
from typing import Any, Mapping, Optional, Tuple

Vector = Tuple[float, float, float]

_STATES = ("UNSPECIFIED", "OK", "DEGRADED", "STALE", "TARE_INVALID", "UNCALIBRATED")


def state_name(number: int) -> str:
    """The name of a `taxel.v1.ForceState`, without its prefix."""
    return _STATES[number] if 0 <= number < len(_STATES) else "UNSPECIFIED"


def judge(
    state: str,
    total_n: Optional[float],
    age_s: Optional[float],
    waited_s: float,
    max_age_s: float,
    own_s: Optional[float] = None,
) -> Optional["Why"]:
    """Why a sample is not a force, or None if it is one: the rule that the daemon and all its readers share.

    It is one while its state is OK or DEGRADED, its total is a number and its age has not passed the daemon's limit or the
    caller's own, if that is stricter. `age_s`: its age when it was sent; `waited_s`: the time since then.
    """
    total_n, age_s = (math.nan if figure is None else figure for figure in (total_n, age_s))
    if state not in ("OK", "DEGRADED") or not math.isfinite(total_n) or math.isnan(age_s):
        return Why.STATE
    limit_s = max_age_s if math.isfinite(max_age_s) and max_age_s > 0.0 else 0.0
    limit_s = limit_s if own_s is None else min(own_s, limit_s)
    return None if age_s >= 0.0 and age_s + waited_s <= limit_s else Why.TOO_OLD


class Why(enum.Enum):
    """Why there is no force; the numbers are those of taxel_force.h."""

    NO_PAGE = 1
    NOTHING_YET = 2
    CLOSED = 3
    WRITER_GONE = 4
    STATE = 5
    TOO_OLD = 6
    OTHER_CLOCK = 7
    DISCONNECTED = 8


_WORDS = {
    Why.NO_PAGE: "there is no page to be read: no daemon runs, it has another patch, "
    "this account is not in the page's group, or others may write in it or in its folder",
    Why.NOTHING_YET: "no sample yet",
    Why.CLOSED: "the daemon has ended",
    Why.WRITER_GONE: "the daemon's engine does not run",
    Why.STATE: "the state carries no force",
    Why.TOO_OLD: "too old",
    Why.OTHER_CLOCK: "stamps of the future: reader and daemon do not have the same clock",
    Why.DISCONNECTED: "no connection",
}


@dataclass(frozen=True)
class Force:
    """A force that may be acted on now, as `taxel.v1.ForceSample` has it. What is not known is None.

    The force lies between `low_n` and `high_n` with a probability of 95 %; without `high_n` nothing bounds it above.
    `reasons` says in words why the state is not OK, `codes` says the same for programs: names of `taxel.v1.ReasonCode`
    without their prefix, such as `TAXELS_SILENT`; empty over shared memory, which has the words alone. `simulated`: a simulator
    makes it, as in `taxeld demo`, and no skin is touched.
    """

    total_n: float
    age_s: float
    state: str
    sequence: int
    sigma_n: Optional[float] = None
    low_n: Optional[float] = None
    high_n: Optional[float] = None
    undetected_n: Optional[float] = None
    step_n: Optional[float] = None
    zero_epoch: int = 0
    resultant_n: Optional[Vector] = None
    moment_nm: Optional[Vector] = None
    centre_of_pressure_m: Optional[Vector] = None
    active: int = 0
    excluded: int = 0
    stale: int = 0
    out_of_range: int = 0
    model_set: str = ""
    reasons: str = ""
    codes: Tuple[str, ...] = ()
    monotonic_ns: Optional[int] = None
    wall_ns: int = 0
    written_ns: int = 0
    simulated: bool = False

    def __bool__(self) -> bool:
        return True  # also a force of 0 N is one


@dataclass(frozen=True)
class NoForce:
    """There is no force to act on. It is false in a condition.

    `codes`: with `Why.STATE` as those of a `Force`; with `Why.DISCONNECTED` why the daemon refused, if it did: the name of a
    `taxel.v1.ErrorReason`, such as `PATCH_UNKNOWN`.
    """

    why: Why
    text: str = ""
    sample: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)
    codes: Tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return False

    def __str__(self) -> str:
        return self.text or _WORDS[self.why]
