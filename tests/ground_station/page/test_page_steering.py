"""Promises of KILL on the page, whatever else is under way."""

import threading
from types import SimpleNamespace
from typing import Any

from support.waiting import wait_for

from rcopterx.ground_station.page.steering import Steering
from rcopterx.ground_station.waiting import NotReachedError


class Kills:
    """Stands for the fleet: counts kills, which are confirmed as a test wants it."""

    def __init__(self, unconfirmed: int = 0) -> None:
        self.count = 0
        self.confirmed = threading.Event()
        self.confirmed.set()
        self._unconfirmed = unconfirmed

    def kill(self, reason: str) -> None:
        self.count += 1
        self.confirmed.wait(10.0)
        if self.count <= self._unconfirmed:
            raise NotReachedError("h2 is not killed")

    def __iter__(self) -> Any:
        return iter([SimpleNamespace(state=SimpleNamespace(transmitter_state="armed"))])


def steering_of(fleet: Kills) -> tuple[Steering, list[tuple[str, bool]]]:
    told: list[tuple[str, bool]] = []
    return Steering(fleet, lambda text, refused: told.append((text, refused))), told


def test_a_press_while_an_earlier_kill_waits_for_its_confirmation_is_published_as_well() -> None:
    fleet = Kills()
    fleet.confirmed.clear()
    steering, told = steering_of(fleet)
    presses = [threading.Thread(target=steering.kill) for _ in range(2)]
    for press in presses:
        press.start()
    wait_for(lambda: fleet.count == 2, "the second press is lost")
    fleet.confirmed.set()
    for press in presses:
        press.join()
    assert told == 2 * [("all motors are cut; reset to fly again", False)]


def test_a_kill_that_is_not_confirmed_is_told_once_and_repeated_until_it_is() -> None:
    fleet = Kills(unconfirmed=3)
    steering, told = steering_of(fleet)
    steering.kill()
    assert fleet.count == 4
    assert told == [
        ("h2 is not killed; it is repeated", True),
        ("all motors are cut; reset to fly again", False),
    ]


def test_a_kill_is_not_repeated_for_ever() -> None:
    fleet = Kills(unconfirmed=100)
    steering, told = steering_of(fleet)
    steering.kill(insists_s=0.0)
    assert fleet.count == 1
    assert told == [("h2 is not killed; it is repeated", True)]


def test_a_reset_ends_a_kill_that_is_repeated() -> None:
    fleet = Kills(unconfirmed=100)
    fleet.confirmed.clear()
    steering, _ = steering_of(fleet)
    press = threading.Thread(target=steering.kill)
    press.start()
    wait_for(lambda: fleet.count == 1, "not pressed")
    steering.reset()
    fleet.confirmed.set()
    press.join(10.0)
    assert not press.is_alive()
    assert fleet.count == 1
