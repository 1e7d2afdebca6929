"""What the messages of schemes have in common: rows of numbers, and the neighbours that they come from."""

from typing import Generic, NamedTuple, TypeVar

import numpy as np
from msgspec import Struct

from rcopterx.control.scheme import Situation
from rcopterx.vehicles.state import Array

M = TypeVar("M", bound=Struct)


class Samples(Struct, frozen=True):
    """Rows of three numbers in a message: 32-bit little-endian floats, row by row.

    Raises `ValueError` for numbers that are not finite and incomplete rows, also when it is decoded.
    """

    data: bytes

    @classmethod
    def of(cls, rows: Array) -> "Samples":
        """Pack an array of shape (n, 3)."""
        return cls(rows.astype("<f4").tobytes())

    def to_numpy(self) -> Array:
        """Unpack into an array of shape (n, 3)."""
        return np.frombuffer(self.data, "<f4").reshape(-1, 3).astype(np.float64)

    def __len__(self) -> int:
        return len(self.data) // 12  # rows

    def __post_init__(self) -> None:
        if not self.data or len(self.data) % 12 or not np.isfinite(np.frombuffer(self.data, "<f4")).all():
            raise ValueError(f"{len(self.data)} bytes, must be rows of three finite 32-bit floats")


class Linked(NamedTuple, Generic[M]):
    """A neighbour with an offset and a message, see `Neighbour`."""

    name: str
    message: M
    age_s: float
    offset_m: Array
    followed: bool


def linked(situation: Situation, kind: type[M]) -> list[Linked[M]]:
    """Return the neighbours with an offset and a message of this type, in the order of their names."""
    return [
        Linked(name, neighbour.message, neighbour.age_s, neighbour.offset_m, neighbour.followed)
        for name, neighbour in sorted(situation.neighbours.items())
        if neighbour.offset_m is not None and isinstance(neighbour.message, kind)
    ]
