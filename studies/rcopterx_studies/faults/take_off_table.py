"""Rows of the table of fault flights: every fault at every moment of a take-off of every type."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Final

from rcopterx.agents.assembly import LIFT_OFF_TURN_S, LIFT_OFF_TURNS
from rcopterx.simulator.faults import (
    BreakRadio,
    BreakVehicle,
    DisplacePose,
    Fault,
    Freeze,
    FreezePose,
    Millimetres,
    Occlude,
    Silence,
    StandIn,
    SwapSubjects,
    TurnPose,
    YUp,
)
from rcopterx_studies.faults.bench import FaultFlight, TakeOff
from rcopterx_studies.faults.laboratory_injectors import LaboratoryFault
from rcopterx_studies.faults.promise import Promise, PromisedLimits

FLEET: Final = Path(__file__).with_name("types.toml")
BESIDE: Final = {
    "coaxial": "crazyflie",
    "crazyflie": "coaxial",
    "betaflight": "mavlink_quadrotor",
    "mavlink_quadrotor": "betaflight",
    "ardupilot_quadrotor": "crazyflie",
}
"""Types, which are the names of their vehicles, and another vehicle for each."""
ON_FLOOR: Final = "on-floor"
MOMENTS: Final[dict[str, tuple[str, float | None]]] = {
    ON_FLOOR: ("on the floor", None),
    "at-start": ("0.2 s after its rotor begins to turn", 0.2),
    "lifting": ("0.8 s after its rotor begins to turn", 0.8),
}
IN_LIFT_OFF: Final = frozenset({"jumped", "raised"})  # on the floor, another place is as good as the true one
IN_PROOF: Final = PromisedLimits(None, touchdown_m_s=1.0, silence_ms=None, height_m=0.3)
"""Of sticks that act the wrong way, which only a vehicle that has lifted can show."""
SIGNS: Final = frozenset({"pitch-reversed", "roll-reversed", "yaw-reversed", "exchanged", "nose-backwards"})
POSE: Final = "pose|position|see"
RADIO: Final = "radio|transmitter|link|port"
STICK: Final = "pitch|roll|yaw|nose|stick|axis"
FAULTS: Final[dict[str, tuple[str, Callable[[str], Fault], str]]] = {
    "frozen": ("its pose stands still, frames go on", FreezePose, "frozen|repeat"),
    "stand-in": ("its subject is another body, which stands", StandIn, "subject|radio"),
    "swapped": (
        "it and another vehicle are taken for one another",
        lambda name: SwapSubjects(name, other=BESIDE[name]),
        "subject|radio|pose jumped",
    ),
    "jumped": ("it is shown 0.5 m beside its place", partial(DisplacePose, offset_m=(0.5, 0.0, 0.0)), POSE),
    "raised": ("it is shown 0.1 m higher", partial(DisplacePose, offset_m=(0.0, 0.0, 0.1)), POSE),
    "y-up": ("the stream has Y up and does not report it", lambda _: YUp(), "Y up|pose"),
    "millimetres": ("the stream is in millimetres", lambda _: Millimetres(), "millimetres|pose"),
    "occluded": ("it is not seen", Occlude, POSE),
    "tracker-frozen": ("the Tracker repeats a frame", lambda _: Freeze(), POSE + "|Tracker"),
    "tracker-silent": ("the Tracker is silent", lambda _: Silence(), POSE + "|Tracker"),
    "radio-cable": ("the cable of its radio is pulled", BreakRadio, RADIO),
    "radio-power": ("its radio has no power", partial(BreakRadio, condition="off"), RADIO),
    "pitch-reversed": ("its pitch stick acts the wrong way", partial(BreakVehicle, reversed="pitch"), STICK),
    "roll-reversed": ("its roll stick acts the wrong way", partial(BreakVehicle, reversed="roll"), STICK),
    "yaw-reversed": ("its yaw stick acts the wrong way", partial(BreakVehicle, reversed="yaw"), STICK),
    "exchanged": ("its pitch and roll sticks are exchanged", partial(BreakVehicle, exchanged=True), STICK),
    "nose-backwards": ("its object has the nose backwards", TurnPose, STICK + "|heading jumped"),
    "weak": ("it has three tenths of its thrust", partial(BreakVehicle, thrust_factor=0.3), "lift|battery"),
}
"""What is wrong: in words, as a fault of a vehicle, and the pattern of its cause."""


def moments_of(kind: str) -> dict[str, tuple[str, float | None]]:
    """Moments at which a fault can be noticed."""
    left_out = ON_FLOOR if kind in IN_LIFT_OFF else ""
    return {name: moment for name, moment in MOMENTS.items() if name != left_out}


def _rows() -> Iterator[FaultFlight]:
    for kind, (title, fault, cause) in FAULTS.items():
        for moment, (when, after_s) in moments_of(kind).items():
            for place, vehicle in enumerate(BESIDE):
                turn_s = LIFT_OFF_TURN_S * (place % LIFT_OFF_TURNS)
                yield FaultFlight(
                    f"take-off-{kind}-{moment}-{vehicle}",
                    f"Take-off of {vehicle}: {title}, {when}",
                    (LaboratoryFault(fault(vehicle)),),
                    Promise.STAYS_DOWN,
                    limits=IN_PROOF if kind in SIGNS else None,
                    page_row=(
                        f"take-off-{kind}-*",
                        f"Take-off of each type: {title}, from the floor on or later",
                    ),
                    take_off=TakeOff(vehicle, None if after_s is None else turn_s + after_s, cause),
                    fleet=FLEET,
                )


TAKE_OFF_ROWS: Final = tuple(_rows())
