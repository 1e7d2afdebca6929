"""What a transmitter gateway wrote last to a vehicle, in shared memory that its successor maps.

The page of a vehicle holds two records that are written in turn, each with its number and a checksum: a
process that is killed while it writes one leaves the other. Records of a computer that was started again
since are invalid, because `written_s` is on the monotonic clock.
"""

import errno
import fcntl
import math
import mmap
import os
import stat
import struct
import zlib
from pathlib import Path
from typing import Final

import msgspec

from rcopterx.transmitter_gateway.inputs import NEUTRAL, LastApplied, State

CHECKSUM: Final = struct.Struct("<I")  # of all that follows
LENGTH: Final = struct.Struct("<I")  # of number and content, as MessagePack
HEADER_BYTES: Final = CHECKSUM.size + LENGTH.size
SLOT_BYTES: Final = 512
PAGE_BYTES: Final = 2 * SLOT_BYTES
FORMAT: Final = b"rcopterx state 6"
BOOT_ID: Final = Path("/proc/sys/kernel/random/boot_id")
NOT_FLYING: Final = LastApplied(State.DISARMED, NEUTRAL, -math.inf, lease=0, issued=0, hover_thrust=0.0)
_DECODER: Final = msgspec.msgpack.Decoder(tuple[int, LastApplied])


def encode(number: int, last: LastApplied, boot: bytes) -> bytes:
    """Encode a record; `boot` identifies the start of the computer."""
    content = msgspec.msgpack.encode((number, last))
    record = LENGTH.pack(len(content)) + content
    return CHECKSUM.pack(_checksum(record, boot)) + record


def decode(slot: bytes, boot: bytes) -> tuple[int, LastApplied] | None:
    """Decode number and content of a record; None if it was not written since this start of the computer."""
    if len(slot) < HEADER_BYTES:
        return None
    end = HEADER_BYTES + LENGTH.unpack_from(slot, CHECKSUM.size)[0]
    if CHECKSUM.unpack_from(slot)[0] != _checksum(slot[CHECKSUM.size : end], boot):
        return None
    return _DECODER.decode(slot[HEADER_BYTES:end])


def _checksum(record: bytes, boot: bytes) -> int:
    return zlib.crc32(record, zlib.crc32(FORMAT + boot))


class StatePage:
    """The page of a vehicle, with one writer; `last` is its newest valid record, None if unknown."""

    def __init__(self, memory: mmap.mmap | bytearray, boot: bytes) -> None:
        self._memory, self._boot = memory, boot
        slots = (bytes(memory[start : start + SLOT_BYTES]) for start in (0, SLOT_BYTES))
        records = [record for slot in slots if (record := decode(slot, boot)) is not None]
        self._number = 0
        self.last: LastApplied | None = None
        if records:
            self._number, self.last = max(records, key=lambda record: record[0])

    def save(self, last: LastApplied) -> None:
        """Write the next record over the older one."""
        self._number += 1
        self.last = last
        record = encode(self._number, last, self._boot)
        start = self._number % 2 * SLOT_BYTES
        self._memory[start : start + len(record)] = record

    def close(self) -> None:
        """Release the page for other processes."""
        if isinstance(self._memory, mmap.mmap):
            self._memory.close()


def open_page(path: Path) -> StatePage:
    """Map a vehicle's page, created if missing, and lock it until it is closed; raises `OSError`."""
    path.parent.mkdir(mode=0o700, exist_ok=True)
    _check_private(path.parent, path.parent.lstat(), stat.S_IFDIR)
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    try:
        _check_private(path, os.fstat(descriptor), stat.S_IFREG)
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        # Without memory behind it, writing to the page would end the process.
        os.posix_fallocate(descriptor, 0, PAGE_BYTES)
        # The map keeps a duplicate of the descriptor, and with it the lock.
        return StatePage(mmap.mmap(descriptor, PAGE_BYTES), BOOT_ID.read_bytes())
    finally:
        os.close(descriptor)


def _check_private(path: Path, status: os.stat_result, kind: int) -> None:
    if stat.S_IFMT(status.st_mode) != kind or status.st_uid != os.geteuid() or status.st_mode & 0o077:
        raise PermissionError(errno.EPERM, "is not private to this user", str(path))


def begin_page(path: Path) -> StatePage:
    """Open a page; unless it is valid, state in it that the vehicle does not fly. For before a gateway."""
    page = open_page(path)
    if page.last is None:
        page.save(NOT_FLYING)
    return page


def page_of_process() -> StatePage:
    """Return a page that no other process can read, for one that cannot be opened."""
    return StatePage(bytearray(PAGE_BYTES), b"")
