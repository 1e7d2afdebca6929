"""Frames that are laid out like the one before: their numbers at once, without an object for each part.

Packets of a steady stream hold the same objects in the same order, and only numbers differ. What a packet
must have in common with the one before, so that these numbers mean the same, is compared byte by byte.
"""

import struct
from collections.abc import Iterable, Mapping, Sequence
from operator import itemgetter
from typing import Any, Final

from rcopterx.vicon_gateway.control_objects import ObjectType
from rcopterx.vicon_gateway.wire import HEADER, MAGIC

Numbers = tuple[Any, ...]
"""Integers, floats and bytes, as the format of a packet says."""

_CONTENTS: Final = int(ObjectType.CONTENTS)
_FRAME_INFO: Final = int(ObjectType.FRAME_INFO)
_GLOBAL_SEGMENTS: Final = int(ObjectType.GLOBAL_SEGMENTS)
_FIXED: Final = frozenset(
    int(kind)
    for kind in (
        ObjectType.CONTENTS,
        ObjectType.STREAM_INFO,
        ObjectType.SUBJECT_INFO,
        ObjectType.APPLICATION_INFO,
    )
)
"""Packets with others of these are read object by object."""
_DECODED: Final = frozenset((int(ObjectType.LATENCY_INFO), int(ObjectType.OBJECT_QUALITY)))
_CONTROL: Final = frozenset((int(ObjectType.PING), int(ObjectType.OBJECT_ENUMS)))
_SEGMENTS: Final = struct.Struct("<II")
"""Of GlobalSegments: subject, number of segments."""
MAX_BYTES: Final = 64 * 1024
"""Larger packets hardly arrive in one piece."""
_SEGMENT_BYTES: Final = 100
_ID_BYTES: Final = 4


class FrameLayout:
    """Where the numbers are in packets like one that has been read object by object.

    Parameters
    ----------
    objects : sequence of (type, payload)
        The objects of that packet, of which none was malformed.
    roots : sequence of (subject, segment)
        Subject ids and the ids of their root segments, None where they have none.

    Attributes
    ----------
    size : int
        Bytes of such a packet.
    frame : int
        Index of the frame id among its numbers.
    decoded : tuple of (type, indices)
        Where the payloads of objects are that are decoded when they change.
    roots : tuple of int or None
        Index of the first of twelve numbers (translation, rotation) of each root segment; None: occluded.

    Raises
    ------
    ValueError
        Packets like this one are read object by object.
    """

    def __init__(self, objects: Sequence[tuple[int, bytes]], roots: Iterable[tuple[int, int | None]]) -> None:
        body_bytes = sum(HEADER.size + len(payload) for _, payload in objects)
        if body_bytes > MAX_BYTES or not _CONTROL.isdisjoint(kind for kind, _ in objects):
            raise ValueError("a packet that is read object by object")
        writer = _FormatWriter(body_bytes)
        self.frame = -1
        decoded: dict[int, list[int]] = {}
        segments: dict[int, dict[int, int]] = {}
        for kind, payload in objects:
            writer.fixed(HEADER.pack(kind, len(payload)))
            if kind in _FIXED:
                writer.fixed(payload)
            elif kind in _DECODED:
                decoded.setdefault(kind, []).append(writer.varying(f"{len(payload)}s"))
            elif kind == _GLOBAL_SEGMENTS:
                subject = _SEGMENTS.unpack_from(payload)[0]
                segments[subject] = writer.segments(payload)
            elif kind == _FRAME_INFO and self.frame < 0:
                self.frame = writer.varying("I")
                writer.ignored(len(payload) - _ID_BYTES)
            else:
                writer.ignored(len(payload))
        if self.frame < 0 or not any(segments.values()):
            raise ValueError("no frame, or none with segments")
        self.decoded = tuple((kind, tuple(indices)) for kind, indices in decoded.items())
        self.roots = tuple(_root(segments, subject, segment) for subject, segment in roots)
        self._struct = struct.Struct(writer.format)
        self._common = itemgetter(*writer.constants)
        self._expected = tuple(writer.constants.values())
        self.size = self._struct.size

    def read(self, packet: bytes) -> Numbers | None:
        """Numbers of a packet of `size` bytes; None if it is not like the one that is known."""
        numbers = self._struct.unpack(packet)
        return numbers if self._common(numbers) == self._expected else None


class _FormatWriter:
    """Puts the format of a packet together; runs of bytes that must not change are one string each."""

    def __init__(self, body_bytes: int) -> None:
        self.constants: dict[int, bytes] = {}
        self._parts = ["<"]
        self._fixed = HEADER.pack(MAGIC, body_bytes)
        self._count = 0

    @property
    def format(self) -> str:
        """The format, once everything has been said."""
        self._flush()
        return "".join(self._parts)

    def _flush(self) -> None:
        if self._fixed:
            self._parts.append(f"{len(self._fixed)}s")
            self.constants[self._count] = self._fixed
            self._count += 1
            self._fixed = b""

    def fixed(self, data: bytes) -> None:
        """Bytes that must be the same."""
        self._fixed += data

    def varying(self, code: str, count: int = 1) -> int:
        """Numbers of which only the place is known; returns the index of the first."""
        self._flush()
        self._parts.append(code)
        self._count += count
        return self._count - count

    def ignored(self, count: int) -> None:
        """Bytes that nobody looks at."""
        if count:
            self._flush()
            self._parts.append(f"{count}x")

    def segments(self, payload: bytes) -> dict[int, int]:
        """One subject's segments: id to the index of the first number, the first one where ids repeat."""
        places: dict[int, int] = {}
        self.fixed(payload[: _SEGMENTS.size])
        position = _SEGMENTS.size
        for _ in range(_SEGMENTS.unpack_from(payload)[1]):
            segment = payload[position : position + _ID_BYTES]
            self.fixed(segment)
            place = self.varying("12d", 12)
            places.setdefault(int.from_bytes(segment, "little"), place)
            position += _SEGMENT_BYTES
        self.ignored(len(payload) - position)
        return places


def _root(segments: Mapping[int, Mapping[int, int]], subject: int, segment: int | None) -> int | None:
    return None if segment is None else segments.get(subject, {}).get(segment)
