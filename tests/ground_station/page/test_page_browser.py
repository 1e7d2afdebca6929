"""Promises of what the page shows in a real browser, light and dark, on a telephone too."""

import io
from typing import Any

import numpy as np
import pytest
from support.browsing import DESKTOP, IN_A_BROWSER, NEEDED, TELEPHONE, Browse, Vehicles, fly, row_of
from support.waiting import wait_for

from rcopterx.ground_station.scripting.fleet import Fleet

pytestmark = IN_A_BROWSER


def test_alarms_and_longer_sentences_move_nothing(browse: Browse, vehicles: Vehicles) -> None:
    fly(vehicles)
    window = browse(DESKTOP)

    def places() -> list[Any]:
        parts = ("#stage canvas", "#rows", "#time", "#kill", "#requests")
        return [window.locator(part).bounding_box() for part in parts]

    before = places()
    for vehicle in vehicles.values():
        vehicle.diagnostics["remarks"] = tuple(
            f"remark {letter} of some length, which is shown" for letter in "abcdef"
        )
        vehicle.counts = {"late": 3}
    window.locator(".alarm").nth(3).wait_for(timeout=30_000)
    vehicles["h1"].state, vehicles["h1"].phase = "land", "emergency"
    window.locator("#sentence", has_text="h1 brought down").wait_for(timeout=30_000)
    assert places() == before


def test_texts_of_the_fleet_are_no_markup(browse: Browse, vehicles: Vehicles) -> None:
    vehicles["h1"].diagnostics["remarks"] = ("<b id=evil>x</b>",)
    window = browse(DESKTOP)
    window.locator(".alarm", has_text="<b id=evil>").wait_for(timeout=30_000)
    assert window.locator("#evil").count() == 0


def test_a_fleet_that_is_down_is_told_with_the_command_that_starts_it(
    browse: Browse, vehicles: Vehicles, fleet: Fleet
) -> None:
    fly(vehicles)
    window = browse(DESKTOP)
    for vehicle in vehicles.values():
        vehicle.speaks = False
    window.get_by_text(f"start it with rcopterx up {fleet.file.name}").wait_for(timeout=30_000)
    window.locator(".handle[data-vehicle=h1]").first.wait_for(state="hidden")
    assert row_of(window, "h1").locator(".chip").inner_text() == "down"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_scene_is_drawn_in_the_colours_of_the_system(
    browse: Browse, vehicles: Vehicles, scheme: str
) -> None:
    image = pytest.importorskip("PIL.Image", reason=NEEDED)
    fly(vehicles)
    window = browse(DESKTOP, color_scheme=scheme)

    def picture() -> Any:
        shot = window.locator("#stage canvas").screenshot()
        return np.asarray(image.open(io.BytesIO(shot)).convert("RGB"), dtype=float)

    wait_for(
        lambda: float((np.ptp(picture(), axis=2) > 60.0).mean()) > 1e-4, "nothing coloured is drawn", 60.0
    )
    assert (float(np.median(picture())) > 128) is (scheme == "light")


def test_a_telephone_shows_the_scene_on_demand(browse: Browse, vehicles: Vehicles) -> None:
    fly(vehicles)
    window = browse(TELEPHONE)
    canvas = window.locator("#stage canvas")
    assert not canvas.is_visible()
    assert window.evaluate("document.documentElement.scrollWidth") <= TELEPHONE[0]
    window.get_by_role("button", name="Show the scene").click()
    canvas.wait_for()
    window.locator("html[data-drawn]").wait_for(timeout=30_000)


def test_the_page_is_fast(browse: Browse, vehicles: Vehicles) -> None:
    """Prints the figures; they are only those of an idle computer where nothing else runs."""
    fly(vehicles)
    window = browse(DESKTOP)
    window.locator("html[data-drawn]").wait_for(timeout=30_000)
    painted_ms = window.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
    first, pictures = (window.evaluate(f"window.rcopterx.{name}") for name in ("firstVehicle", "pictures"))
    window.wait_for_timeout(3000)
    rate = (window.evaluate("window.rcopterx.pictures") - pictures) / 3.0
    print(f"painted {painted_ms:.0f} ms, vehicles {first:.0f} ms, {rate:.1f} pictures a second")
    assert rate > 5.0
