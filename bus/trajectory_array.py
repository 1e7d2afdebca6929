"""A trajectory as it travels and is recorded: rounded, and without what follows from the rest of it.

Planned velocities are those that move the positions from stage to stage, accelerations those that move the
velocities. So velocities travel, and of positions and accelerations what differs from that: zeros but for
the first position and the last acceleration, in plans of our controllers. Flight logs hold a plan of 50
stages in a tenth of a kilobyte.
"""

from functools import lru_cache
from typing import TYPE_CHECKING, ClassVar, Final

from msgspec import Struct

from rcopterx.bus.message import InvalidMessageError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_MOST: Final = 2**31 - 1


class TrajectoryArray(Struct, frozen=True):
    """Rounded samples of a trajectory; numpy is imported on first use.

    Rounding is finer than what is measured: 0.1 mm and mrad, 1 mm/s or less (0.4 mm/s at 50 Hz), 2 cm/s^2,
    upwards 5 mm/s^2: followers feed that forward through the lags of both rotors, and steps of it would be
    steps of their thrust and yaw sticks.

    Attributes
    ----------
    shape
        Stages and columns: position and heading, their rates and their accelerations, four columns each.
    data
        Whole numbers, shape (3, stages, 4). First the velocities: second differences from stage to stage, in
        units of `rate_units`. Then the positions: the first ones, and what differs from these moved by the
        velocities. Then the accelerations: what differs from the differences of the velocities.
        Signs are folded in (0, -1, 1, -2 become 0, 1, 2, 3). The lowest bytes of all numbers come first, then
        the next ones, up to the highest that are not all zero.
    """

    shape: tuple[int, int]
    data: bytes

    COLUMNS: ClassVar[int] = 12
    POSITION_UNIT: ClassVar[float] = 1e-4
    ACCELERATION_UNITS: ClassVar[tuple[float, float, float, float]] = (2e-2, 2e-2, 5e-3, 2e-2)
    RATE_UNITS: ClassVar[tuple[float, float]] = (1e-5, 1e-3)
    """Finest and coarsest unit of the velocities."""
    LARGEST: ClassVar[float] = 2e4
    """Of any value; more is cut off when a trajectory is packed and when it is unpacked."""
    TOLERANCE: ClassVar[int] = 1
    """Positions and accelerations that differ by so many units from what the velocities say are not told."""

    @classmethod
    def rate_units(cls, period_s: float) -> tuple[float, ...]:
        """Units of the velocities: what one unit of the accelerations makes of them in a period."""
        finest, coarsest = cls.RATE_UNITS
        return tuple([min(max(unit * period_s, finest), coarsest) for unit in cls.ACCELERATION_UNITS])

    @classmethod
    def of(cls, values: "NDArray[np.float64]", period_s: float) -> "TrajectoryArray":
        """Round and pack finite values of shape (stages, 12), `period_s` apart."""
        import numpy as np

        stages = len(values)
        within = np.minimum(np.maximum(values, -cls.LARGEST), cls.LARGEST).reshape(stages, 3, 4)
        # Whole numbers, but floats: exact up to 2^53.
        position, rate, acceleration = np.rint((within / cls.units(period_s)).transpose(1, 0, 2))
        whole = np.empty((3, stages, 4))
        whole[0] = rate
        whole[0, 1:] -= rate[:-1]
        whole[0, 2:] -= rate[1:-1] - rate[:-2]
        whole[0, 1] -= rate[0]
        told = whole[1:]
        cls._follow(rate, period_s, told)
        told[0] += position[0]
        np.rint(np.subtract((position, acceleration), told, out=told), out=told)
        told[np.abs(told) <= cls.TOLERANCE] = 0.0
        told[0, 0] = position[0]
        narrow = np.minimum(np.maximum(whole, -_MOST), _MOST).astype("<i4").ravel()
        folded = ((narrow << 1) ^ (narrow >> 31)).view("<u4")
        width = max(1, (int(folded.max()).bit_length() + 7) // 8)
        return cls((stages, cls.COLUMNS), folded.view(np.uint8).reshape(-1, 4).T[:width].tobytes())

    def to_numpy(self, period_s: float) -> "NDArray[np.float64]":
        """Unpack into an array of `shape`, stages `period_s` apart."""
        import numpy as np

        stages, _ = self.shape
        count = self.COLUMNS * stages
        planes = np.frombuffer(self.data, dtype=np.uint8).reshape(-1, count)
        octets = np.zeros((count, 4), dtype=np.uint8)
        octets[:, : len(planes)] = planes.T
        folded = octets.view("<i4")
        whole = (((folded >> 1) & _MOST) ^ -(folded & 1)).reshape(3, stages, 4)
        samples = np.empty((3, stages, 4))
        rate = samples[1] = whole[0].cumsum(axis=0).cumsum(axis=0)
        follow = samples[::2]
        self._follow(rate, period_s, follow)
        follow += whole[1:]
        samples[0, 1:] += whole[1, 0]
        values = (samples.transpose(1, 0, 2) * self.units(period_s)).reshape(stages, self.COLUMNS)
        return np.minimum(np.maximum(values, -self.LARGEST), self.LARGEST)

    @classmethod
    @lru_cache(maxsize=64)
    def units(cls, period_s: float) -> "NDArray[np.float64]":
        """Units of positions, velocities and accelerations, shape (3, 4)."""
        import numpy as np

        return np.array((4 * (cls.POSITION_UNIT,), cls.rate_units(period_s), cls.ACCELERATION_UNITS))

    @classmethod
    @lru_cache(maxsize=64)
    def scales(cls, period_s: float) -> "NDArray[np.float64]":
        """How far a velocity moves in a period, and its acceleration by a difference, in units: (2, 4)."""
        units = cls.units(period_s)
        _, rate, acceleration = units
        scales = units[:2].copy()
        scales[0] = rate * period_s / cls.POSITION_UNIT
        # A shorter period would make accelerations without bounds of absurd velocities.
        scales[1] = rate / (rate.clip(min=period_s) * acceleration)
        return scales

    @classmethod
    def _follow(cls, rate: "NDArray[np.float64]", period_s: float, out: "NDArray[np.float64]") -> None:
        """How far velocities move, and their accelerations, in units: shape (2, stages, 4).

        Not rounded: whoever interpolates between stages would see positions that do not go with their
        velocities as accelerations. The last stage accelerates like the one before it.
        """
        import numpy as np

        moves, accelerates = cls.scales(period_s)
        out[0, 0] = 0.0
        np.multiply(rate[:-1].cumsum(axis=0), moves, out=out[0, 1:])
        np.multiply(rate[1:] - rate[:-1], accelerates, out=out[1, :-1])
        out[1, -1] = out[1, -2]

    def check(self, field: str, max_stages: int, min_stages: int) -> None:
        """Refuse wrong shapes; whatever is in the right shape unpacks to bounded numbers.

        Raises
        ------
        InvalidMessageError
            Names `field` and what is allowed.
        """
        stages, columns = self.shape
        if columns != self.COLUMNS or not min_stages <= stages <= max_stages:
            raise InvalidMessageError(
                f"{field}: shape {self.shape}, allowed is ({min_stages}..{max_stages}, {self.COLUMNS})"
            )
        plane = stages * columns
        if len(self.data) not in (plane, 2 * plane, 3 * plane, 4 * plane):
            raise InvalidMessageError(
                f"{field}: {len(self.data)} bytes for shape {self.shape}, needs 1 to 4 times {plane}"
            )
