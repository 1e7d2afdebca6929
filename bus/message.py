"""Base class, arrays and limited numbers of messages."""

import struct
from typing import TYPE_CHECKING, Annotated, ClassVar

from msgspec import Meta, Struct

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

SCHEMA_VERSION = 2
MAX_POSITION_M = 100.0
MAX_MAGNITUDE = 1e6
"""Limit of trajectories, and of headings, which count turns; more would overflow in a controller."""
MAX_SETTINGS = 40

Name = Annotated[str, Meta(pattern=r"^[a-z][a-z0-9_]{0,30}$")]
Text = Annotated[str, Meta(max_length=400)]
Count = Annotated[int, Meta(ge=0)]
Seconds = Annotated[float, Meta(ge=0)]
Heading = Annotated[float, Meta(ge=-MAX_MAGNITUDE, le=MAX_MAGNITUDE)]
Stick = Annotated[float, Meta(ge=-1, le=1)]
SettingName = Annotated[str, Meta(pattern=r"^[a-zA-Z][a-zA-Z0-9_]{0,40}$")]
Setting = bool | int | float | Annotated[str, Meta(max_length=60)] | tuple[float, ...] | None
Settings = Annotated[dict[SettingName, Setting], Meta(max_length=MAX_SETTINGS)]
"""Settings of a controller or an estimator; its own type says what is allowed."""
Three = tuple[float, float, float]
Four = tuple[float, float, float, float]
Eight = tuple[float, float, float, float, float, float, float, float]
Coordinate = Annotated[float, Meta(ge=-MAX_POSITION_M, le=MAX_POSITION_M)]
Place = tuple[Coordinate, Coordinate, Coordinate]


class InvalidMessageError(ValueError):
    """A message of valid types with forbidden contents; names the field and what is allowed."""


class FloatArray(Struct, frozen=True):
    """A matrix of 64-bit little-endian floats, row by row.

    numpy is imported on first use: routers and `kill` start without it.
    """

    shape: tuple[int, int]
    data: bytes

    @classmethod
    def of(cls, values: "NDArray[np.float64]") -> "FloatArray":
        """Pack an array of shape (rows, columns)."""
        rows, columns = values.shape
        return cls((rows, columns), values.astype("<f8", copy=False).tobytes())

    def to_numpy(self) -> "NDArray[np.float64]":
        """Unpack into a read-only array of `shape`."""
        import numpy as np

        return np.frombuffer(self.data, dtype="<f8").reshape(self.shape)

    def rows(self) -> list[tuple[float, ...]]:
        """Return the rows as tuples of floats, without numpy."""
        return list(struct.iter_unpack(f"<{self.shape[1]}d", self.data))

    def check(self, field: str, columns: int, max_rows: int, min_rows: int = 0) -> None:
        """Reject wrong shapes, and values that are not finite or too large; see `Message.check`."""
        rows, actual_columns = self.shape
        if actual_columns != columns or not min_rows <= rows <= max_rows:
            raise InvalidMessageError(
                f"{field}: shape {self.shape}, allowed is ({min_rows}..{max_rows}, {columns})"
            )
        if len(self.data) != 8 * rows * columns:
            raise InvalidMessageError(
                f"{field}: {len(self.data)} bytes for shape {self.shape}, needs {8 * rows * columns}"
            )
        values = struct.unpack(f"<{rows * columns}d", self.data)
        if not all(abs(value) <= MAX_MAGNITUDE for value in values):
            raise InvalidMessageError(f"{field}: not all values are finite and at most {MAX_MAGNITUDE:g}")


class Message(Struct, frozen=True, kw_only=True):
    """Base class of all messages."""

    MAX_BYTES: ClassVar[int] = 32768

    schema_version: Annotated[int, Meta(ge=1)] = SCHEMA_VERSION

    def check(self) -> None:
        """Reject contents that the types allow but the meaning forbids.

        Raises
        ------
        InvalidMessageError
            Names the field and what is allowed.
        """
