"""The force on robot skin, as taxeld measures it: for controllers in Python.

    import taxel

    forces = taxel.connect()                                  # the daemon of this machine, over its service
    forces = taxel.Reader("/dev/shm/taxeld/left_forearm")     # or from its shared memory, which needs no package
    force = forces.force()                                    # never waits
    if force:
        act(force.total_n)
    else:
        do_without(str(force))                                # says why
"""

from .client import Forces, connect
from .force import Force, NoForce, Why
from .models import ModelSet, read_models
from .refusal import info_of, reason_of
from .session import Session, read_session
from .shm import Reader

__all__ = [
    "Force", "Forces", "ModelSet", "NoForce", "Reader", "Session", "Why",
    "connect", "info_of", "read_models", "read_session", "reason_of",
]
