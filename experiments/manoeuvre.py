"""One row of the table of manoeuvres."""

from dataclasses import dataclass
from typing import Final

from rcopterx.experiments.checks import Check
from rcopterx.experiments.steps import Step

DEFAULT_FLEET: Final = "trio"


@dataclass(frozen=True)
class Manoeuvre:
    """One row of the table.

    Attributes
    ----------
    seconds
        Approximate duration of the recorded part.
    fly
        Flies it on a fleet that is in the air.
    checks
        Conditions on the recorded flight.
    height_m
        Take-off height.
    fleet
        Shipped fleet with which it can be flown.
    from_floor
        Take-off and landing are part of the manoeuvre and recorded.
    """

    name: str
    title: str
    seconds: float
    fly: Step
    checks: tuple[Check, ...]
    height_m: float = 1.0
    fleet: str = DEFAULT_FLEET
    from_floor: bool = False
