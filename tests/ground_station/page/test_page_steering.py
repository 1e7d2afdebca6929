"""Promises of KILL on the page, whatever else is under way."""

import threading
from types import SimpleNamespace

from support.waiting import wait_for

from rcopterx.ground_station.page.steering import PageSteering
from rcopterx.ground_station.scripting.waiting import NotReachedError


class Kills:
    """Stands for the fleet: counts kills, which are confirmed as a test wants it."""

    file = SimpleNamespace(vehicles={})

    def __init__(self, unconfirmed: int = 0) -> None:
        self.count = 0
        self.confirmed = threading.Event()
        self.confirmed.set()
        self._unconfirmed = unconfirmed

    def kill(self, reason: str) -> None:
        self.count += 1
        self.confirmed.wait(60.0)
        if self.count <= self._unconfirmed:
            raise NotReachedError("h2 is not killed")


def steering_of(fleet: Kills) -> tuple[PageSteering, list[tuple[str, bool]]]:
    told: list[tuple[str, bool]] = []
    return PageSteering(fleet, lambda text, refused: told.append((text, refused))), told


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


def test_a_kill_that_is_not_confirmed_is_told() -> None:
    fleet = Kills(unconfirmed=1)
    steering, told = steering_of(fleet)
    steering.kill()
    assert told == [("h2 is not killed", True)]
