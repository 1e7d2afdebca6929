"""Promises to people at the page: what they want to do takes no more presses than these.

A press is a click, a key, or a choice in a list, which is two clicks.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from support.browsing import (
    CHROMIUM,
    DESKTOP,
    IN_A_BROWSER,
    NEEDED,
    SOFTWARE_RENDERING,
    Browse,
    Vehicles,
    fly,
    requests_of,
    row_of,
)
from support.filmed_flight import filmed_flight
from support.waiting import wait_for

from rcopterx.bus.requests import Follow, SetLight, SetZones, Tune
from rcopterx.ground_station.report.page import report_page

pytestmark = IN_A_BROWSER


class Hand:
    """Presses in a window, counted."""

    def __init__(self, window: Any) -> None:
        self.window, self.presses = window, 0

    def click(self, place: Any) -> None:
        """Click an element."""
        self.presses += 1
        place.click()

    def choose(self, choices: Any, value: str) -> None:
        """Open a list, and click one of its choices."""
        self.presses += 2
        choices.select_option(value)

    def slide(self, slider: Any, value: str) -> None:
        """Drag a slider."""
        self.presses += 1
        slider.fill(value)

    def press(self, key: str) -> None:
        """Press a key."""
        self.presses += 1
        self.window.keyboard.press(key)

    def row(self, name: str) -> Any:
        """The row of a vehicle."""
        return row_of(self.window, name)

    def button(self, name: str) -> Any:
        """A button by its whole name."""
        return self.window.get_by_role("button", name=name, exact=True)


@pytest.fixture
def hand(browse: Browse, vehicles: Vehicles) -> Hand:
    """A hand on the page of two vehicles that fly."""
    fly(vehicles)
    return Hand(browse(DESKTOP))


def done(condition: Callable[[], object], what: str) -> None:
    wait_for(condition, what, 60.0)


def test_a_follower_gets_another_leader_with_three_clicks(hand: Hand, vehicles: Vehicles) -> None:
    hand.click(hand.row("h2"))
    hand.choose(hand.window.locator("#selected [name=leader]"), "h1")
    done(lambda: requests_of(vehicles["h2"], Follow), "does not follow")
    assert requests_of(vehicles["h2"], Follow)[0].following[0].leader == "h1"
    assert hand.presses <= 3


def test_why_a_vehicle_landed_is_read_with_one_click_at_most(hand: Hand, vehicles: Vehicles) -> None:
    vehicles["h2"].state, vehicles["h2"].phase = "cut", "ground"
    vehicles["h2"].reason = "cut: landed: no commands for 300 ms"
    alarm = hand.window.locator(".alarm", has_text="h2: was landed")
    alarm.wait_for(timeout=30_000)
    assert "no commands for 300 ms" in alarm.inner_text()
    assert hand.presses <= 1


def test_one_vehicle_is_landed_with_two_clicks(hand: Hand, vehicles: Vehicles) -> None:
    hand.click(hand.row("h2"))
    hand.click(hand.button("Land it"))
    done(lambda: "Land" in vehicles["h2"].verbs, "does not land")
    assert "Land" not in vehicles["h1"].verbs
    assert hand.presses <= 2


def test_all_motors_are_cut_with_one_key_and_reset_with_one_click(hand: Hand, vehicles: Vehicles) -> None:
    hand.press("Space")
    done(lambda: {one.state for one in vehicles.values()} == {"killed"}, "not killed")
    hand.click(hand.button("Reset"))
    done(lambda: {one.state for one in vehicles.values()} == {"disarmed"}, "not reset")
    assert hand.presses <= 2


def test_a_weight_is_doubled_with_four_presses(hand: Hand, vehicles: Vehicles) -> None:
    hand.click(hand.row("h1"))
    hand.click(hand.window.locator("#tune > summary"))
    hand.slide(hand.window.locator("#tune [data-group=position]"), "1")
    hand.click(hand.button("Apply"))
    done(lambda: requests_of(vehicles["h1"], Tune), "not tuned")
    assert hand.presses <= 4


def test_a_leader_is_sent_elsewhere_with_one_drag(hand: Hand, vehicles: Vehicles) -> None:
    handle = hand.window.locator(".handle:not(.lift)[data-vehicle=h1]")
    handle.wait_for(timeout=30_000)
    box = handle.bounding_box()
    hand.window.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    hand.window.mouse.down()
    hand.window.mouse.move(box["x"] + 30, box["y"] - 10, steps=5)
    hand.window.mouse.up()
    done(lambda: "GoTo" in vehicles["h1"].verbs, "does not go")
    assert hand.presses == 0


def test_a_zone_is_drawn_with_two_clicks_in_the_scene_and_removed_with_one(
    hand: Hand, vehicles: Vehicles
) -> None:
    hand.click(hand.window.locator("#zone > summary"))
    hand.click(hand.window.locator("#zone [name=drawing]"))
    box = hand.window.locator("#stage canvas").bounding_box()
    for across, down in ((0.5, 0.62), (0.62, 0.72)):
        hand.window.mouse.click(box["x"] + across * box["width"], box["y"] + down * box["height"])
        hand.presses += 1
    done(lambda: requests_of(vehicles["h2"], SetZones), "no zone")
    (sent,) = requests_of(vehicles["h1"], SetZones)
    zone = sent.zones.zones["zone1"]
    assert sent == requests_of(vehicles["h2"], SetZones)[0]
    assert all(low < high for low, high in zip(zone.min_m, zone.max_m, strict=True))
    assert max(*map(abs, (*zone.min_m[:2], *zone.max_m[:2]))) <= 1.0
    assert (zone.min_m[2], zone.max_m[2]) == (0.0, 2.0)
    assert not hand.window.locator("#zone [name=drawing]").is_checked()
    hand.click(hand.button("Remove zone1"))
    done(lambda: len(requests_of(vehicles["h1"], SetZones)) == 2, "not removed")
    assert requests_of(vehicles["h1"], SetZones)[1].zones.zones == {}
    assert hand.window.locator("#zone [name=name]").input_value() == "zone2"
    assert hand.presses <= 5


def test_the_light_of_a_vehicle_is_chosen_with_two_clicks(hand: Hand, vehicles: Vehicles) -> None:
    hand.click(hand.row("h2"))
    hand.click(hand.window.locator("#selected [name=light]"))
    hand.window.locator("#selected [name=light]").fill("#ff8000")
    done(lambda: requests_of(vehicles["h2"], SetLight), "no light")
    assert requests_of(vehicles["h2"], SetLight)[-1].colour == (255, 128, 0)
    assert hand.presses <= 2


def test_which_radio_is_late_is_read_with_two_clicks(hand: Hand) -> None:
    hand.click(hand.row("h1"))
    hand.click(hand.window.locator("#details > summary"))
    hand.window.locator("#details tr", has_text="radio").first.wait_for(timeout=30_000)
    assert hand.presses <= 2


def test_a_recorded_flight_is_played_with_one_click(tmp_path: Path) -> None:
    sync_api = pytest.importorskip("playwright.sync_api", reason=NEEDED)
    report = tmp_path / "report.html"
    report.write_text(report_page(filmed_flight()), encoding="utf-8")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE_RENDERING)
        hand = Hand(browser.new_page())
        hand.window.goto(report.as_uri())
        hand.click(hand.button("Play"))
        hand.row("h2").locator(".chip", has_text="flies").wait_for(timeout=30_000)
        browser.close()
    assert hand.presses <= 1
