"""Helicopters beyond the family: how far a vehicle may differ for the default configuration to fly it.

Vehicles of the tuning seeds, each time with one thing, or several, further off than any member of the family.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import Any, Final

from rcopterx.experiments.family import Flown, Programme, TrueVehicle, distribution, fly_member
from rcopterx.experiments.rig import GUARDED, Progress, RigOptions
from rcopterx.experiments.runner import Cases, Experiment, Options
from rcopterx.experiments.schemes import CASCADE
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.helicopter import helicopter_of
from rcopterx.simulator.helicopter_parameters import DEGREE, HelicopterParameters
from rcopterx.simulator.laboratory import Particulars
from rcopterx.simulator.oscillating_tilt_plant import TiltOscillator
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.types import COAXIAL_LAG

PROGRAMME: Final = Programme(settled_s=4.0, hover_s=11.0, slot_s=3.5, rest_s=1.0)
QUICK_PROGRAMME: Final = Programme(settled_s=3.0, hover_s=5.0, slot_s=1.0, rest_s=0.5)

Change = Callable[[HelicopterParameters], HelicopterParameters]


@dataclass(frozen=True)
class Departure:
    """How vehicles or laboratory differ from the family's.

    Attributes
    ----------
    change
        Makes the true parameters from drawn ones.
    plant_type, oscillator
        What flies instead of a helicopter: the type, and the tilt unless it is the type's lag.
    conditions
        Fields of the conditions that differ.
    options
        How the loop is closed.
    """

    change: Change = field(default=lambda drawn: drawn)
    conditions: Mapping[str, Any] = field(default_factory=dict)
    plant_type: Model | None = None
    oscillator: TiltOscillator | None = None
    options: RigOptions = GUARDED


def times(**factors: float) -> Change:
    """Parameters multiplied, every number of a tuple alike."""

    def change(drawn: HelicopterParameters) -> HelicopterParameters:
        return replace(drawn, **{name: _times(getattr(drawn, name), by) for name, by in factors.items()})

    return change


def _times(value: Any, factor: float) -> Any:
    return tuple(factor * number for number in value) if isinstance(value, tuple) else factor * value


def rotors(factor: float) -> dict[str, float]:
    """Both rotors slower."""
    return {"rotor_lag_upper_s": factor, "rotor_lag_lower_s": factor}


def oscillating(frequency_rad_s: float, damping_ratio: float) -> Departure:
    """No stabilizer bar: a tilt that answers the stick as a plain oscillator."""
    return Departure(plant_type=COAXIAL_LAG, oscillator=TiltOscillator(frequency_rad_s, damping_ratio))


def lagging(lag_s: float) -> Departure:
    """A tilt that follows the stick with a first-order lag."""
    _, _, thrust_s, yaw_s = COAXIAL_LAG.lag_s
    return Departure(plant_type=replace(COAXIAL_LAG, lag_s=(lag_s, lag_s, thrust_s, yaw_s)))


OSCILLATORS: Final = (
    (25.0, 0.7), (20.0, 0.7), (14.0, 0.7), (10.0, 0.6), (8.0, 0.6), (18.0, 0.5), (12.0, 0.3), (22.0, 0.2),
    (9.0, 0.2), (12.0, 0.15), (18.0, 0.1),
)  # fmt: skip
"""Frequency [rad/s] and damping ratio."""
LAGS_S: Final = (0.05, 0.1, 0.2, 0.3)

DEPARTURES: Final = MappingProxyType(
    {
        "none": Departure(),
        "40 ms more delay": Departure(conditions={"transport_delay_s": 0.06}),
        "added damping 0.05": Departure(lambda drawn: replace(drawn, added_damping=0.05)),
        "servos twice as slow": Departure(times(servo_lag_s=2.0)),
        "servos twice as slow, 20 ms more delay, added damping 0.1": Departure(
            lambda drawn: replace(times(servo_lag_s=2.0)(drawn), added_damping=0.1),
            {"transport_delay_s": 0.04},
        ),
        "bar 1.5 times as slow": Departure(times(bar_time_constant_s=1.5)),
        "gain of pitch and roll 1.5": Departure(times(swash_gain_rad=1.5)),
        "gain of pitch and roll 0.6": Departure(times(swash_gain_rad=0.6)),
        "gain of pitch and roll 0.5": Departure(times(swash_gain_rad=0.5)),
        "gain of pitch and roll 2": Departure(times(swash_gain_rad=2.0)),
        "rotors twice as slow": Departure(times(**rotors(2.0))),
        "rotors 1.5 times as slow, 20 ms more delay, gains 1.2 and 1.3": Departure(
            times(swash_gain_rad=1.3, yaw_rate_gain_rad_s=1.2, **rotors(1.5)), {"transport_delay_s": 0.04}
        ),
        "gyro of a tenth": Departure(times(yaw_gyro_gain_per_s=0.1, yaw_rate_gain_rad_s=10.0)),
        "gyro of twice the gain": Departure(times(yaw_gyro_gain_per_s=2.0)),
        "thrust gain 1.3": Departure(times(thrust_gain_m_s2=1.3)),
        "thrust gain 0.75": Departure(times(thrust_gain_m_s2=0.75)),
        "servos of half the resolution": Departure(times(servo_step=2.0)),
        "twice the inertia": Departure(times(inertia_kg_m2=2.0)),
        "markers 8 degrees off": Departure(
            lambda drawn: replace(drawn, marker_roll_rad=5.7 * DEGREE, marker_pitch_rad=-5.7 * DEGREE)
        ),
        "markers 5 degrees off, a tenth of the stick as trim": Departure(
            lambda drawn: replace(
                drawn,
                marker_roll_rad=3.5 * DEGREE,
                marker_pitch_rad=-3.5 * DEGREE,
                trim=(0.1, -0.1, 0.0, 0.03),
            )
        ),
        "markers 5 cm above the centre of gravity": Departure(
            lambda drawn: replace(drawn, marker_height_m=0.05)
        ),
        "markers 5 cm below it": Departure(lambda drawn: replace(drawn, marker_height_m=-0.05)),
        "twice the drag": Departure(times(drag_per_s=2.0)),
        "ground effect ten times as high": Departure(times(ground_effect_height_m=10.0)),
        "one pose of a hundred off by 5 cm": Departure(conditions={"outlier_fraction": 0.01}),
        "trim twice as large": Departure(times(trim=2.0)),
        "Tracker of 100 Hz": Departure(options=RigOptions(frame_period_s=0.01, guard=True)),
        "Tracker of 200 Hz": Departure(options=RigOptions(frame_period_s=0.005, guard=True)),
        "twice the turbulence": Departure(conditions={"turbulence_rms": (0.3, 0.3, 0.2, 1.0)}),
        "three times the noise": Departure(conditions={"position_noise_m": 0.001, "angle_noise_rad": 0.006}),
        "noise of 2 mm and 10 mrad": Departure(
            conditions={"position_noise_m": 0.002, "angle_noise_rad": 0.01}
        ),
        **{f"no bar: {w:g} rad/s, damping {zeta:g}": oscillating(w, zeta) for w, zeta in OSCILLATORS},
        **{f"no bar: lag of {lag_s:g} s": lagging(lag_s) for lag_s in LAGS_S},
    }
)
"""By name. The guard against oscillation is active, as in agents."""


def fly_departure(
    name: str, programme: Programme, conditions: Conditions, seed: int, progress: Progress | None = None
) -> Flown:
    """Fly one vehicle of a departure by the default configuration."""
    departure = DEPARTURES[name]
    true = replace(conditions, **departure.conditions)
    flown: Particulars | None = departure.oscillator
    if departure.plant_type is None:
        flown = departure.change(helicopter_of("h1", conditions, seed))
    vehicle = TrueVehicle(flown, departure.plant_type)
    return fly_member(CASCADE, programme, true, seed, progress, vehicle, departure.options)


def cases(options: Options) -> Cases[Flown]:
    """Every departure."""
    programme = QUICK_PROGRAMME if options.quick else PROGRAMME
    return {name: partial(fly_departure, name, programme) for name in DEPARTURES}


EXPERIMENT: Final = Experiment(
    "beyond",
    "Helicopters further off than any of the family",
    {"helicopters": 3},
    cases,
    lambda _, flights: distribution(flights),
    first_seed=0,
)
