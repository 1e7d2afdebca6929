"""Promises of KILL in a real browser: by mouse and space bar, on a telephone, without a connection."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from support.browsing import (
    DESKTOP,
    IN_A_BROWSER,
    SIZES,
    Browse,
    Vehicles,
    all_killed,
    row_of,
    selected,
    served,
)
from support.bus import free_port
from support.waiting import wait_for

from rcopterx.ground_station.scripting.fleet import Fleet

pytestmark = IN_A_BROWSER
PRESSES = 20


@SIZES
def test_the_kill_button_is_always_there_and_cuts_everybody(
    browse: Browse, vehicles: Vehicles, size: tuple[int, int]
) -> None:
    window = browse(size)
    window.locator("#panel").evaluate("(panel) => panel.scrollTo(0, panel.scrollHeight)")
    window.mouse.wheel(0, 2000)
    button = window.get_by_role("button", name="KILL: cut")
    box = button.bounding_box()
    assert box["x"] >= 0.0
    assert box["y"] >= 0.0
    assert box["x"] + box["width"] <= size[0]
    assert box["width"] > 250.0
    assert box["height"] > 40.0
    window.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    wait_for(lambda: all_killed(vehicles), "not killed", 30.0)


def test_the_space_bar_cuts_everybody_every_time(browse: Browse, vehicles: Vehicles) -> None:
    window = browse(DESKTOP)
    window.mouse.click(600, 300)
    pressed_ms = []
    for _ in range(PRESSES):
        for vehicle in vehicles.values():
            vehicle.state = "armed"
        from_s = time.monotonic()
        window.keyboard.press("Space")
        wait_for(lambda: all_killed(vehicles), "not killed", 30.0)
        pressed_ms.append(1000.0 * (time.monotonic() - from_s))
    print(f"space bar to killed: median {np.median(pressed_ms):.0f} ms, largest {max(pressed_ms):.0f} ms")


@SIZES
def test_kill_state_take_off_and_landing_need_no_scrolling(browse: Browse, size: tuple[int, int]) -> None:
    window = browse(size)
    wanted = [window.get_by_role("button", name=name, exact=True) for name in ("Take off", "Land")]
    for one in (window.get_by_role("button", name="KILL: cut"), *wanted, window.locator("#sentence")):
        box = one.bounding_box()
        assert box["x"] >= 0.0
        assert box["y"] >= 0.0
        assert box["x"] + box["width"] <= size[0]
        assert box["y"] + box["height"] <= size[1] / 3
    assert row_of(window, "h2").bounding_box()["y"] < size[1] / 2


def test_kill_is_obeyed_in_the_same_moment_as_other_buttons(browse: Browse, vehicles: Vehicles) -> None:
    window = browse(DESKTOP)
    window.evaluate(
        """() => {
          const named = (text) => [...document.querySelectorAll('button')].find(
            (button) => button.textContent.trim().startsWith(text));
          for (const text of ['Land', 'KILL', 'Land']) named(text).click();
        }"""
    )
    wait_for(lambda: all_killed(vehicles), "not killed", 30.0)


@pytest.mark.parametrize(
    "focused",
    [
        "#requests [value=take_off]",
        "#formation [name=fly]",
        "#tune input",
        "#goto [name=x]",
        "#rows tbody tr",
    ],
)
def test_the_space_bar_is_kill_wherever_the_focus_is(
    browse: Browse, vehicles: Vehicles, focused: str
) -> None:
    window = browse(DESKTOP)
    selected(window, "h1")
    for part in ("#formation", "#tune"):
        window.locator(f"{part} > summary").click()
    window.locator(focused).first.focus()
    window.keyboard.press("Space")
    wait_for(lambda: all_killed(vehicles), "not killed", 30.0)
    assert {verb for vehicle in vehicles.values() for verb in vehicle.verbs} <= {"Reset"}


def test_kill_that_is_pressed_without_a_connection_is_sent_once_there_is_one(
    fleet: Fleet, vehicles: Vehicles, open_window: Callable[..., Any]
) -> None:
    port = free_port()
    with served(fleet, port) as address:
        window = open_window(address, DESKTOP)
    window.get_by_role("button", name="KILL does not reach the fleet").wait_for(timeout=30_000)
    window.get_by_text("The page is not connected").wait_for()
    window.keyboard.press("Space")
    window.get_by_role("button", name="KILL waits").wait_for(timeout=5_000)
    assert not all_killed(vehicles)
    with served(fleet, port):
        wait_for(lambda: all_killed(vehicles), "not killed", 60.0)
        window.get_by_role("button", name="KILL: cut").wait_for(timeout=30_000)


def test_answers_are_shown_also_after_the_page_has_been_started_again(
    fleet: Fleet, vehicles: Vehicles, open_window: Callable[..., Any]
) -> None:
    port = free_port()
    with served(fleet, port) as address:
        window = open_window(address, DESKTOP)
        for _ in range(3):
            window.get_by_role("button", name="Land", exact=True).click()
            window.locator(".notice").first.wait_for(timeout=30_000)
            window.locator(".notice").first.wait_for(state="detached", timeout=30_000)
    with served(fleet, port):
        window.get_by_role("button", name="KILL: cut").wait_for(timeout=30_000)
        window.get_by_role("button", name="Land", exact=True).click()
        window.locator(".notice").first.wait_for(timeout=10_000)


def test_after_kill_the_page_goes_on_and_a_reset_lets_the_fleet_fly_again(
    browse: Browse, vehicles: Vehicles
) -> None:
    window = browse(DESKTOP)
    reset = window.get_by_role("button", name="Reset", exact=True)
    assert not reset.is_visible()
    window.keyboard.press("Space")
    window.locator("#sentence", has_text="KILLED").wait_for(timeout=30_000)
    window.locator("#alarms", has_text="Reset when everybody is clear").wait_for()
    reset.click()
    wait_for(lambda: {one.state for one in vehicles.values()} == {"disarmed"}, "not reset", 30.0)
    window.locator("#sentence", has_text="ready to take off").wait_for()
    reset.wait_for(state="hidden")
    window.get_by_role("button", name="Take off").click()
    wait_for(lambda: {one.phase for one in vehicles.values()} == {"flying"}, "not flying", 30.0)
