"""Leaders leave input range to their followers (control.md section 6), whoever these are at the moment."""

from collections.abc import Mapping

from agents.interfaces import Controller, SharesAuthority
from agents.topology import Links, levels_below

LEADER_SHARE = 0.8
"""Share of its input range a leader plans with, once for every level of followers below it."""


def share_of(links: Links, name: str) -> float:
    """Share of its input range a vehicle may plan with, given who follows whom."""
    return share_above(levels_below(links, name))


def share_above(levels: int) -> float:
    """Share of a vehicle with so many levels of followers below it."""
    return LEADER_SHARE**levels


class Authority:
    """Keeps a controller's input range in step with the vehicles that follow.

    Parameters
    ----------
    vehicle
        Own name.
    """

    def __init__(self, vehicle: str) -> None:
        self._vehicle = vehicle
        self._told: tuple[Controller, float] | None = None

    def tend(self, controller: Controller, settings: Mapping[str, object], links: Links) -> None:
        """Tell the controller its share if that, or the controller, is another one than before.

        Parameters
        ----------
        controller
            Present controller.
        settings
            Its settings; a fixed `input_range` among them is left alone.
        links
            Who follows whom; where nobody is heard of, nothing is known and nothing changes.
        """
        fixed = "input_range" in settings
        if fixed or not isinstance(controller, SharesAuthority) or not links.keys() - {self._vehicle}:
            return
        share = share_of(links, self._vehicle)
        if self._told is None or self._told[0] is not controller or self._told[1] != share:
            controller.set_input_range(share)
            self._told = (controller, share)
