"""Base class, arrays and limited numbers of messages."""

import struct
from typing import TYPE_CHECKING, Annotated, ClassVar

from msgspec import Meta, Struct

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

SCHEMA_VERSION = 2
MAX_POSITION_M = 100.0
MAX_MAGNITUDE = 1e6  # of quantities in SI units; more would overflow in a controller
MAX_COUNT = 2**53  # up to here a 64-bit float is exact, and so is a program in any language
MAX_RESUMED_COUNT = MAX_COUNT // 2  # up to here a process counts on from another one's counter
MAX_DURATION_S = 1e9
MAX_CLOCK_S = 1e10
MAX_FLOAT = 1e300
MAX_SETTINGS = 40
SHORTEST_PERIOD_S = 0.002
LONGEST_PERIOD_S = 0.05
"""Of control: the time that planned inputs bridge has at most `MAX_NEXT_INPUTS` short ones, and commands with
longer ones would be late each time.
"""

Name = Annotated[str, Meta(pattern=r"^[a-z][a-z0-9_]{0,30}$")]
Text = Annotated[str, Meta(max_length=400)]
Parts = Annotated[tuple[Text, ...], Meta(max_length=8)]  # of a model
ColourPart = Annotated[int, Meta(ge=0, le=255)]
Colour = tuple[ColourPart, ColourPart, ColourPart]  # red, green, blue
Count = Annotated[int, Meta(ge=0, le=MAX_COUNT)]
Seconds = Annotated[float, Meta(ge=0, le=MAX_DURATION_S)]  # a duration or an age
Clock = Annotated[float, Meta(ge=-MAX_CLOCK_S, le=MAX_CLOCK_S)]
"""A time on some clock, or a difference of clocks [s]."""
Period = Annotated[float, Meta(ge=SHORTEST_PERIOD_S, le=LONGEST_PERIOD_S)]
Number = Annotated[float, Meta(ge=-MAX_MAGNITUDE, le=MAX_MAGNITUDE)]
"""A quantity in SI units; headings count turns."""
Amount = Annotated[float, Meta(ge=0, le=MAX_MAGNITUDE)]
Weight = Annotated[float, Meta(ge=1e-6, le=MAX_MAGNITUDE)]
Finite = Annotated[float, Meta(ge=-MAX_FLOAT, le=MAX_FLOAT)]
"""Any number; unlike these limits, msgspec's `float` includes NaN and infinity."""
Stick = Annotated[float, Meta(ge=-1, le=1)]
SettingName = Annotated[str, Meta(pattern=r"^[a-zA-Z][a-zA-Z0-9_]{0,40}$")]
Whole = Annotated[int, Meta(ge=-MAX_COUNT, le=MAX_COUNT)]
Setting = bool | Whole | Finite | Annotated[str, Meta(max_length=60)] | tuple[Finite, ...] | None
Settings = Annotated[dict[SettingName, Setting], Meta(max_length=MAX_SETTINGS)]
"""Settings of a controller or an estimator; its own type says what is allowed."""
Parameters = Annotated[dict[SettingName, Setting | Settings], Meta(max_length=MAX_SETTINGS)]
"""Parameters of a model that were identified, as in the table `model` of a fleet file."""
Three = tuple[Number, Number, Number]
Four = tuple[Number, Number, Number, Number]
Eight = tuple[Number, Number, Number, Number, Number, Number, Number, Number]
Coordinate = Annotated[float, Meta(ge=-MAX_POSITION_M, le=MAX_POSITION_M)]
Place = tuple[Coordinate, Coordinate, Coordinate]


class InvalidMessageError(ValueError):
    """A message of valid types with forbidden contents; names the field and what is allowed."""


class FloatArray(Struct, frozen=True):
    """A matrix of 64-bit little-endian floats, row by row; routers and `kill` start without numpy."""

    shape: tuple[Count, Count]
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

    schema_version: Annotated[int, Meta(ge=1, le=MAX_COUNT)] = SCHEMA_VERSION

    def check(self) -> None:
        """Raise `InvalidMessageError`, naming the field, for what types allow but the meaning forbids."""
