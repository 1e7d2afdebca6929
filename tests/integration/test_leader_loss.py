"""A leader is lost in flight: its followers hold, promote one of themselves or land, and take it back."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from integration_support import (
    NAMES,
    Flying,
    Truth,
    transmitter_state,
)

pytestmark = [pytest.mark.lockstep, pytest.mark.timeout(180)]

Fly = Callable[..., None]
PLACE_M = 0.15


def vehicles(then: dict[str, str]) -> str:
    follow = {
        "h1": "",
        "h2": 'follow = [{ leader = "h1", offset_m = [-0.4, 0.5, 0.0] }]',
        "h3": 'follow = [{ leader = "h1", offset_m = [-0.4, -0.5, 0.0] }]',
    }
    return "\n".join(
        f"""
[vehicles.{name}]
subject = "heli{name[1]}"
transmitter = {{ port = "radio-{name}", model_match = {name[1]} }}
leader_lost = {{ then = "{then.get(name, "hold")}", after_s = 1.0 }}
{follow[name]}
"""
        for name in NAMES
    )


def take_off(flying: Flying) -> Truth:
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.8, timeout_s=40)
    wait_for_stances(flying, {"h2": "follow", "h3": "follow"})
    flying.fleet.wait_until(
        lambda: followed(flying, "h2") == followed(flying, "h3") == ("h1",), 30, "no leader"
    )
    return truth


@contextmanager
def cut_off(flying: Flying, name: str) -> Iterator[None]:
    """The agent's host hangs; its vehicle is brought down by its transmitter gateway meanwhile."""
    with flying.stopped(f"agent-{name}"):
        yield


@contextmanager
def gone(flying: Flying, name: str) -> Iterator[None]:
    """The agent is killed and not started again for a while."""
    flying.want(f"agent-{name}", False)
    yield
    flying.want(f"agent-{name}", True)


def followed(flying: Flying, name: str) -> tuple[str, ...]:
    plan = flying.fleet[name].plan
    return () if plan is None else tuple(link.leader for link in plan.following)


def following_mode(flying: Flying, name: str) -> str:
    status = flying.fleet.state_of(name).agent
    return "unknown" if status is None else status.following_mode


def counted(flying: Flying, name: str, kind: str) -> int:
    status = flying.fleet.state_of(name).agent
    return 0 if status is None else status.diagnostics.fallbacks.get(kind, 0)


def wait_for_stances(flying: Flying, modes: dict[str, str], timeout_s: float = 10) -> None:
    flying.fleet.wait_until(
        lambda: all(following_mode(flying, name) == wanted for name, wanted in modes.items()),
        timeout_s,
        f"modes are not {modes}",
        modes,
    )


def place(truth: Truth, name: str) -> np.ndarray:
    vehicle = truth(name)
    assert vehicle is not None
    return np.array(vehicle.position_m)


def wait_until_down(flying: Flying, name: str) -> None:
    """Its transmitter gateway brings a vehicle without commands down and switches it off."""
    flying.fleet.wait_until(
        lambda: transmitter_state(flying, name) in ("cut", "disarmed"), 30, "not brought down", [name]
    )


def recover(flying: Flying, names: tuple[str, ...]) -> None:
    """The lost leader stands on the floor by now; it takes off again."""
    flying.fleet.wait_until(
        lambda: all(flying.fleet.state_of(name).phase in ("ground", "armed") for name in names),
        30,
        "not down",
        names,
    )
    flying.fleet.take_off(names, height_m=0.8, timeout_s=40)
    flying.fleet.wait_until(
        lambda: followed(flying, "h2") == followed(flying, "h3") == ("h1",),
        30,
        "the leader is not taken back",
    )
    wait_for_stances(flying, {"h2": "follow", "h3": "follow"})


def test_followers_of_a_lost_leader_agree_on_a_successor_and_take_the_leader_back(fly: Fly) -> None:
    fly(agree_on_a_successor, vehicles=vehicles({"h2": "promote", "h3": "promote"}))


def agree_on_a_successor(flying: Flying) -> None:
    truth = take_off(flying)
    before = {name: place(truth, name) for name in ("h2", "h3")}
    with cut_off(flying, "h1"):
        wait_for_stances(flying, {"h2": "lead", "h3": "follow_successor"})
        flying.fleet.wait_until(
            lambda: followed(flying, "h3") == ("h2",), 30, "the successor is not followed"
        )
        for name, where in before.items():
            assert np.linalg.norm(place(truth, name) - where) < PLACE_M
        assert counted(flying, "h2", "leader_lost_lead") == 1
        x, y, z = before["h2"]
        flying.fleet["h2"].go_to((x + 0.2, y, z + 0.2))
        flying.fleet.wait_until(
            lambda: np.linalg.norm(place(truth, "h3") - before["h3"] - [0.2, 0.0, 0.2]) < PLACE_M,
            30,
            "the formation does not follow its successor",
        )
        wait_until_down(flying, "h1")
    recover(flying, ("h1",))
    assert min(truth.height_m(name) for name in ("h2", "h3")) > 0.4


@pytest.mark.campaign
def test_one_follower_of_a_lost_leader_holds_and_another_one_lands_as_the_file_says(fly: Fly) -> None:
    fly(hold_and_land, vehicles=vehicles({"h2": "hold", "h3": "land"}))


def hold_and_land(flying: Flying) -> None:
    truth = take_off(flying)
    before = place(truth, "h2")
    with gone(flying, "h1"):
        wait_for_stances(flying, {"h2": "hold"})
        flying.fleet.wait_until(
            lambda: flying.fleet.state_of("h3").phase in ("armed", "ground"), 30, "h3 does not land", ["h3"]
        )
        assert np.linalg.norm(place(truth, "h2") - before) < PLACE_M
        assert flying.fleet.state_of("h2").phase == "flying"
        wait_until_down(flying, "h1")
    recover(flying, ("h1", "h3"))
