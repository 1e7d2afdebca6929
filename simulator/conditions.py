"""How real the simulated laboratory is: every switch and number in one validated object, with presets."""

from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import msgspec

from rcopterx.tables import table_beside
from rcopterx.vehicles.tuples import Four, Three

FIRST_ORDER: Final = "first_order"
COAXIAL_PLANTS: Final = (FIRST_ORDER, "helicopter", "drawn_helicopter", "drawn_coax")
ADDED: Final = ":"  # in names of plants that installed packages add, PACKAGE:KIND

_RANGES: Final = table_beside(__file__, "condition_ranges")
"""Lowest and highest value of fields of `Conditions`, of each of several numbers."""


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """Differences of the simulated laboratory from equation (1); zero switches an effect off.

    The defaults are the preset `ideal`: vehicles behave exactly as their models, lag and delay included.
    Raises `ValueError` for a number that is not finite or out of range; the message names the field and what
    is allowed.
    """

    turbulence_rms: Four = (0.0, 0.0, 0.0, 0.0)
    """Coloured-noise accelerations: inertial x, y, z [m/s^2] and yaw [rad/s^2], root mean square."""
    turbulence_correlation_s: float = 0.5
    """Correlation time of the turbulence (autocorrelation exp(-t / correlation time))."""
    actuator_lag: bool = True
    """Whether inputs pass the first-order lags of the vehicle's model."""
    lag_mismatch: float = 0.0
    """True lags are drawn per vehicle within this fraction of the model's."""
    transport_delay_s: float | None = None
    """Delay of every input; None for the `delay_s` of the vehicle's model. A simulation that emulates the
    radio link needs 0, because the delay then comes from the emulated link."""
    parameter_mismatch: float = 0.0
    """Every true b and k is drawn per vehicle within this fraction of the model's."""
    trim_offset: float = 0.0
    """Every input is offset by a constant drawn per vehicle between minus and plus this value."""
    battery_sag: float = 0.0
    """Fraction of the thrust gain that is lost when the battery is empty."""
    battery_endurance_s: float = 480.0
    """Time of hover thrust that empties the battery; more thrust empties it faster."""
    charging_s: float = 0.0
    """Time in which an empty battery becomes full while the vehicle stands with its motors off; 0: never."""
    position_noise_m: float = 0.0
    """Measurement noise per position axis, root mean square."""
    angle_noise_rad: float = 0.0
    """Measurement noise of yaw, roll and pitch, root mean square."""
    volume_min_m: Three = (-2.5, -2.5, -0.1)
    """Lower corner of the flight volume."""
    volume_max_m: Three = (2.5, 2.5, 3.0)
    """Corners of the flight volume. Leaving it is flagged and has no other effect."""
    walls: bool = False
    """Whether sides and top of the volume are walls and a ceiling: within 0.2 m a wall tilts helicopters
    towards it, within 0.3 m a ceiling lifts."""
    coaxial_plant: str = FIRST_ORDER
    """Plant of a coaxial vehicle, of `COAXIAL_PLANTS`: equation (1) with its mismatches; the helicopter with
    stabilizer bar in the middle of its family; or one drawn for each vehicle, from the family or around a
    real one (docs/helicopter.md). The latter three ignore `actuator_lag`, `lag_mismatch`,
    `parameter_mismatch` and `trim_offset`."""
    attitude_plant: str = FIRST_ORDER
    """Plant of a vehicle with a closed attitude loop: `first_order` for equation (1), with its tilt, or
    `PACKAGE:KIND` for one that an installed package adds (docs/crazyflie.md). The latter may ignore
    `actuator_lag`, `lag_mismatch` and `parameter_mismatch`."""
    downwash_m_s2: float = 0.0
    """Downward acceleration of a vehicle that flies 0.1 to 0.3 m below another; further below it falls with
    1 / distance, and to the sides by e within 0.16 m, more below. Where it grows sidewards it tilts
    helicopters."""
    radio_period_s: float = 0.0
    """Inputs wait for the next radio frame, one every so many seconds; zero for none. A simulation that
    emulates the radio link needs 0."""
    gyro_hold_per_s: float = 0.0
    """Heading hold of the yaw gyros of helicopters: yaw rate that they ask for per turn that they missed."""
    gyro_drift_rad_s: float = 0.0
    """Drifting offset of these gyros, root mean square, with a correlation time of a minute."""
    brushless: bool = False
    """Whether emulated Crazyflies have motors that are armed on request and checked while they spin up."""
    dropout_fraction: float = 0.0
    """Fraction of the frames in which the Tracker misses a vehicle."""
    lever_arm_m: float = 0.0
    """Height of the origin of every subject above the centre of gravity, along the axis of the body. Measured
    heights are those of a level vehicle all the same."""
    substep_s: float = 0.002
    """Longest integration step, at most 4 ms."""

    def __post_init__(self) -> None:
        for name, (low, high) in _RANGES.items():
            _require_between(name, getattr(self, name), low, high)
        if self.coaxial_plant not in COAXIAL_PLANTS:
            allowed = ", ".join(COAXIAL_PLANTS)
            raise ValueError(f"coaxial_plant: unknown plant {self.coaxial_plant!r}; allowed: {allowed}")
        if self.attitude_plant != FIRST_ORDER and ADDED not in self.attitude_plant:
            raise ValueError(
                f"attitude_plant: unknown plant {self.attitude_plant!r}; allowed: {FIRST_ORDER}, PACKAGE:KIND"
            )
        for axis, (low, high) in enumerate(zip(self.volume_min_m, self.volume_max_m, strict=True)):
            if low >= high:
                raise ValueError(f"volume_max_m[{axis}]: {high} is not above volume_min_m[{axis}] = {low}")


def _require_between(name: str, value: float | tuple[float, ...] | None, low: float, high: float) -> None:
    if isinstance(value, tuple):
        for axis, number in enumerate(value):
            _require_between(f"{name}[{axis}]", number, low, high)
    elif value is not None and not low <= value <= high:
        raise ValueError(f"{name}: {value!r} is not a number between {low:g} and {high:g}")


def _presets() -> dict[str, Conditions]:
    found: dict[str, Conditions] = {}
    for name, table in table_beside(__file__, "presets").items():
        like = found[table.pop("like")] if "like" in table else Conditions()
        found[name] = msgspec.convert(msgspec.to_builtins(like) | table, Conditions)
    return found


PRESETS: Final = MappingProxyType(_presets())
"""Conditions by name, from `presets.toml`."""
