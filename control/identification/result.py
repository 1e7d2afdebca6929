"""What a fit found: parts of a model, each judged by itself."""

from dataclasses import dataclass
from itertools import chain
from typing import Final

from rcopterx.control.identification.motions import Offsets
from rcopterx.vehicles.model import Model

HORIZONTAL: Final = "horizontal motion"
HEIGHT: Final = "height"
HEADING: Final = "heading"
PARTS: Final = (HORIZONTAL, HEIGHT, HEADING)
"""Parts of a model, each fitted and judged by itself; in the order of `Uncertainty`."""


@dataclass(frozen=True)
class FittedParameter:
    """A number before and after, with its standard deviation."""

    name: str
    unit: str
    before: float
    value: float
    deviation: float


@dataclass(frozen=True)
class FittedPart:
    """Fit of one of `PARTS`, judged by itself."""

    name: str
    parameters: tuple[FittedParameter, ...]
    # root mean square errors of predictions one second ahead [m, rad], horizontal ones per axis, of the old
    # and the new model in the part of the flight that was not fitted
    before: float
    after: float
    problems: tuple[str, ...]  # why it must not be used; empty if it may be
    remarks: tuple[str, ...]  # what the flight does not show, so that the uncertainty is not narrowed

    @property
    def accepted(self) -> bool:
        """Whether the fitted model has it."""
        return not self.problems


@dataclass(frozen=True)
class Identification:
    """Result of a fit."""

    model: Model  # the accepted parts of the fitted model, with their uncertainty; else the model before
    offsets: Offsets  # trim and tilt of the markers in this flight
    parts: tuple[FittedPart, ...]  # in the order of `PARTS`

    @property
    def accepted(self) -> tuple[str, ...]:
        """Names of the parts that may be used."""
        return tuple(part.name for part in self.parts if part.accepted)

    @property
    def parameters(self) -> tuple[FittedParameter, ...]:
        """Fitted numbers of all parts."""
        return tuple(chain.from_iterable(part.parameters for part in self.parts))

    @property
    def problems(self) -> tuple[str, ...]:
        """Why parts must not be used."""
        return tuple(chain.from_iterable(part.problems for part in self.parts))

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the flight does not show."""
        return tuple(chain.from_iterable(part.remarks for part in self.parts))
