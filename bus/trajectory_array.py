"""A trajectory on the wire and in flight logs: scaled 16-bit integers, column by column."""

from typing import TYPE_CHECKING, Annotated, ClassVar, Final

from msgspec import Meta, Struct

from rcopterx.bus.message import MAX_MAGNITUDE, InvalidMessageError, Number

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Twelve = Annotated[tuple[Number, ...], Meta(min_length=12, max_length=12)]

PLAN_COLUMNS: Final = 12
MAX_COUNT: Final = 2**15 - 1
_BYTES: Final = 2 * PLAN_COLUMNS


class TrajectoryArray(Struct, frozen=True):
    """Samples of a trajectory. In Python: `np.frombuffer(data, "<i2").reshape(12, -1).T * scale + offset`."""

    offset: Twelve
    """Added to each column."""
    scale: Twelve
    """Factor of each column: its resolution."""
    data: bytes
    """16-bit little-endian integers, column by column."""

    RESOLUTION: ClassVar[Twelve] = (
        *(2.0**-13, 2.0**-13, 2.0**-13, 2.0**-13),
        *(2.0**-10, 2.0**-10, 2.0**-10, 2.0**-10),
        *(2.0**-7, 2.0**-7, 2.0**-8, 2.0**-7),
    )
    """Finest scale of each column: 0.12 mm and mrad, 1 mm/s and mrad/s, 0.8 cm/s^2 and crad/s^2.

    Upwards it is 0.4 cm/s^2, because followers feed that acceleration forward to the thrust and yaw sticks.
    Powers of two leave the last bits of offsets zero, which compresses well."""

    @classmethod
    def of(cls, samples: "NDArray[np.float64]") -> "TrajectoryArray":
        """Pack finite samples of shape (stages, 12); a column of large range is rounded more coarsely."""
        import numpy as np

        resolution = np.array(cls.RESOLUTION)
        offset = np.rint(samples[0] / resolution) * resolution
        away = samples - offset
        scale = np.maximum(resolution, np.abs(away).max(axis=0) / MAX_COUNT)
        counts = np.rint(away / scale).T.astype("<i2")
        return cls(tuple(offset.tolist()), tuple(scale.tolist()), counts.tobytes())

    def to_numpy(self) -> "NDArray[np.float64]":
        """Unpack into an array of shape (stages, 12)."""
        import numpy as np

        counts = np.frombuffer(self.data, "<i2").reshape(PLAN_COLUMNS, -1).T
        return np.ascontiguousarray(counts * np.array(self.scale) + np.array(self.offset))

    @property
    def stages(self) -> int:
        """Number of stages."""
        return len(self.data) // _BYTES

    def check(self, field: str, max_stages: int, min_stages: int) -> None:
        """Reject wrong lengths, and scales and offsets that allow absurd samples; see `Message.check`."""
        stages, rest = divmod(len(self.data), _BYTES)
        if rest or not min_stages <= stages <= max_stages:
            raise InvalidMessageError(
                f"{field}: {len(self.data)} bytes, allowed are {min_stages} to {max_stages} times {_BYTES}"
            )
        if not all(scale > 0 for scale in self.scale):
            raise InvalidMessageError(f"{field}: scale {self.scale}, must be positive")
        extremes = [abs(offset) + 2**15 * s for offset, s in zip(self.offset, self.scale, strict=True)]
        if not all(extreme <= MAX_MAGNITUDE for extreme in extremes):
            raise InvalidMessageError(f"{field}: samples up to {extremes}, allowed is {MAX_MAGNITUDE:g}")
