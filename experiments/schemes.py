"""Control schemes that the experiments compare, by name."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

NO_HURRY: Final[dict[str, object]] = {"time_limit_s": 1.0}
"""A solver that stops by the clock would make a flight depend on the machine; the rig's time can wait."""


@dataclass(frozen=True)
class Scheme:
    """A controller with settings.

    Attributes
    ----------
    name, title
        For documents and for figures.
    controller, settings
        As in a fleet file.
    previous_frame
        Followers get their leaders' plans one control period late.
    """

    name: str
    title: str
    controller: str
    settings: Mapping[str, object] = field(default_factory=dict)
    previous_frame: bool = False


KUNZ: Final = Scheme(
    "kunz_2013",
    "Implementation of [11]",
    "paper",
    {**NO_HURRY, "terminal_cost": False, "z_integrator": False, "integral_limit_m_s": 20.0},
)
PAPER: Final = Scheme("paper", "Paper's scheme", "paper", NO_HURRY)
CASCADE: Final = Scheme("cascade", "Cascade", "cascade")

SCHEMES: Final = MappingProxyType(
    {
        scheme.name: scheme
        for scheme in (
            PAPER,
            CASCADE,
            Scheme(
                "cascade_previous_frame", "Cascade, previous frame's plan", "cascade", previous_frame=True
            ),
            Scheme("cascade_no_feed_forward", "Cascade, no feed-forward", "cascade", {"feed_forward": False}),
            Scheme("lqr", "LQR", "lqr"),
            Scheme("pid", "PID", "pid"),
        )
    }
)
"""Schemes of the formation experiment."""
