"""What is on a disk at each moment, from the log of dm-log-writes, and what a power cut then leaves of it.

A disk that loses its power has all that was flushed, and all that was written through (FUA). What was written since the last
flush it has or has not, in any order, and of a write any sectors.
"""

import random
import struct

SECTOR = 512
# The kernel's drivers/md/dm-log-writes.c
SUPER = struct.Struct("<QQQI")
MAGIC, VERSION = 0x6A736677736872, 1
ENTRY = struct.Struct("<QQQQ")
FLUSH, THROUGH, DISCARD, MARK = 1, 2, 4, 8


class Entry:
    """Something in the log: `data` written `at` a byte, a flush, or a mark with its `text`."""

    def __init__(self, at, flags, data):
        self.at = at
        self.is_flush = bool(flags & FLUSH)
        self.is_through = bool(flags & THROUGH)
        self.text = data.decode() if flags & MARK else None
        self.data = b"" if flags & MARK else data


def read_log(path):
    """All entries of a log."""
    with open(path, "rb") as log:
        magic, version, entries, sector = SUPER.unpack(log.read(SUPER.size))
        if (magic, version, sector) != (MAGIC, VERSION, SECTOR):
            raise ValueError(f"{path} is no log of writes: {magic:x} {version} {sector}")
        at, found = sector, []
        for _ in range(entries):
            log.seek(at)
            block = log.read(sector)
            sector_number, sectors, flags, length = ENTRY.unpack_from(block)
            at += sector
            if flags & MARK:
                found.append(Entry(0, flags, block[ENTRY.size : ENTRY.size + length].rstrip(b"\0")))
                continue
            if flags & DISCARD:
                data = bytes(sectors * sector)
            else:
                data = log.read(sectors * sector)
                at += len(data)
            found.append(Entry(sector_number * sector, flags, data))
    return found


class Disk:
    """The disk while the log goes on from a first content."""

    def __init__(self, content, entries, obeys=True):
        self.kept = bytearray(content)
        self.entries = entries
        # Whether a flush has an effect: of some disks it is told that it has none.
        self.obeys = obeys
        self.position = 0
        # Written, but not flushed.
        self.open = []
        # What was acknowledged and what had begun, as the marks say.
        self.done = self.begun = 0

    def ended(self):
        return self.position == len(self.entries)

    def keeps_more_next(self):
        """Whether the next entry changes what a power cut must leave."""
        entry = self.entries[self.position]
        return self.obeys and (entry.is_flush and bool(self.open) or entry.is_through and bool(entry.data))

    def step(self):
        """The next entry."""
        entry = self.entries[self.position]
        self.position += 1
        if entry.text is not None:
            # The kernel has a mark of its own at the end.
            word, _, number = entry.text.partition("-")
            if word == "done":
                self.done = int(number)
            elif word == "begins":
                self.begun = int(number)
            return
        if entry.is_flush and self.obeys:
            for write in self.open:
                self._apply(self.kept, write)
            self.open.clear()
        if entry.data and entry.is_through and self.obeys:
            self._apply(self.kept, entry)
        elif entry.data:
            self.open.append(entry)

    def all_written(self):
        """What is on it while it has power."""
        content = bytearray(self.kept)
        for write in self.open:
            self._apply(content, write)
        return bytes(content)

    def cut(self, seed):
        """What a power cut leaves, and what it did: each open write is there, not there, or in part."""
        draw = random.Random(seed)
        content = bytearray(self.kept)
        whole = part = lost = 0
        writes = list(self.open)
        # Also the next one may be on its way.
        if not self.ended() and self.entries[self.position].data:
            writes.append(self.entries[self.position])
        chance = draw.random()
        for write in writes:
            if draw.random() < 0.2:
                part += 1
                sectors = range(0, len(write.data), SECTOR)
                for at in (at for at in sectors if draw.random() < chance):
                    content[write.at + at : write.at + at + SECTOR] = write.data[at : at + SECTOR]
            elif draw.random() < chance:
                whole += 1
                self._apply(content, write)
            else:
                lost += 1
        return content, f"of {len(writes)} open writes {whole} are there, {part} in part, {lost} not"

    @staticmethod
    def _apply(content, entry):
        content[entry.at : entry.at + len(entry.data)] = entry.data
