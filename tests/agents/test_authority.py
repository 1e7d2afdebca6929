"""Promises about the input range: a leader leaves its followers authority, also a promoted one."""

import numpy as np
import pytest
from support.flight import NotedController

from agents.authority import LEADER_SHARE, Authority, share_of
from agents.topology import exchanged, places
from bus.messages import Following

TREE = {
    "h1": (),
    "h2": (Following(leader="h1", offset_m=(0.5, 0, 0)),),
    "h3": (Following(leader="h2", offset_m=(0.5, 0, 0)),),
    "h4": (Following(leader="h1", offset_m=(-0.5, 0, 0)),),
}


class Sharing(NotedController):
    def __init__(self) -> None:
        super().__init__(np.zeros((1, 4)))
        self.shares: list[float] = []

    def set_input_range(self, fraction: float) -> None:
        self.shares.append(fraction)


def test_every_level_of_followers_below_takes_a_share() -> None:
    shares = {name: share_of(TREE, name) for name in TREE}
    assert shares == {"h1": LEADER_SHARE**2, "h2": LEADER_SHARE, "h3": 1.0, "h4": 1.0}


def test_the_share_changes_with_the_leader_and_is_told_once() -> None:
    authority, controller = Authority("h4"), Sharing()
    authority.tend(controller, {}, TREE)
    authority.tend(controller, {}, TREE)
    promoted = TREE | exchanged(TREE, places(TREE, {"h1": np.zeros(4)}), "h1", "h4")
    authority.tend(controller, {}, promoted)
    assert controller.shares == pytest.approx([1.0, LEADER_SHARE**2])


def test_another_controller_is_told_too() -> None:
    authority, first, second = Authority("h2"), Sharing(), Sharing()
    authority.tend(first, {}, TREE)
    authority.tend(second, {}, TREE)
    assert first.shares == second.shares == pytest.approx([LEADER_SHARE])


def test_a_fixed_range_and_an_unknown_formation_change_nothing() -> None:
    controller = Sharing()
    Authority("h1").tend(controller, {"input_range": 0.5}, TREE)
    Authority("h1").tend(controller, {}, {"h1": ()})
    Authority("h1").tend(NotedController(np.zeros((1, 4))), {}, TREE)
    assert controller.shares == []
