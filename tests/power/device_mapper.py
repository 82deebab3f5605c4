"""A block device that writes down all that is written to it and when it is flushed: Linux's dm-log-writes, asked for by the
kernel's own calls, because the tools for it wait for a udev that the lab does not have."""

import fcntl
import os
import struct

# include/uapi/linux/dm-ioctl.h
HEADER = struct.Struct("=3I I I I i I I I Q 128s 129s 7x")
TARGET = struct.Struct("=Q Q i I 16s")
CREATE, REMOVE, RESUME, LOAD, MESSAGE = 3, 4, 6, 9, 14
SECTOR = 512


class LoggedDevice:
    """`data`, with everything that reaches it in `log`; both are paths of block devices."""

    def __init__(self, name, data, log, size):
        self.name = name
        self.control = open("/dev/mapper/control", "rb", buffering=0)
        self.path = f"/dev/dm-{os.minor(self._ask(CREATE))}"
        parameters = f"{data} {log}".encode() + b"\0"
        table = TARGET.pack(0, size // SECTOR, 0, 0, b"log-writes") + parameters
        self._ask(LOAD, table, targets=1)
        self._ask(RESUME)

    def mark(self, text):
        """Puts a word into the log: all that was flushed before is in it before that word."""
        self._ask(MESSAGE, struct.pack("=Q", 0) + f"mark {text}".encode() + b"\0")

    def close(self):
        self._ask(REMOVE)
        self.control.close()

    def _ask(self, call, data=b"", targets=0):
        size = HEADER.size + len(data) + 8
        header = HEADER.pack(4, 0, 0, size, HEADER.size, targets, 0, 0, 0, 0, 0, self.name.encode(), b"")
        buffer = bytearray((header + data).ljust(size, b"\0"))
        # _IOWR(DM_IOCTL, call, struct dm_ioctl)
        fcntl.ioctl(self.control, 3 << 30 | HEADER.size << 16 | 0xFD << 8 | call, buffer)
        return HEADER.unpack_from(buffer)[10]
