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
    name, title
        For the command line and for reports.
    seconds
        About how long the recorded part takes.
    fly
        Flies it on a fleet that is in the air; waits through the given function.
    checks
        What must be true of the recorded flight.
    height_m
        Take-off height.
    fleet
        Shipped fleet it is made for.
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
