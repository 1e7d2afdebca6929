"""Promises of a saved flight in a real browser, opened as a file: it plays, and nothing can be requested."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.browsing import CHROMIUM, DESKTOP, IN_A_BROWSER, NEEDED, SOFTWARE_RENDERING, TELEPHONE, row_of
from support.filmed_flight import LANDED_S, filmed_flight

from rcopterx.ground_station.report.logged_flight import LoggedFlight
from rcopterx.ground_station.report.page import report_page

pytestmark = IN_A_BROWSER

HIGHEST_PX = 2000  # of the report with everything folded
Open = Callable[..., Any]


@pytest.fixture(scope="module")
def flight() -> LoggedFlight:
    return filmed_flight()


@pytest.fixture(scope="module")
def saved(flight: LoggedFlight, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(report_page(flight), encoding="utf-8")
    return path


@pytest.fixture
def opened(saved: Path) -> Iterator[Open]:
    """Open a saved flight; the test fails if a script fails or something outside the file is requested."""
    sync_api = pytest.importorskip("playwright.sync_api", reason=NEEDED)
    failures: list[str] = []
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE_RENDERING)

        def open_file(path: Path = saved, size: tuple[int, int] = DESKTOP) -> Any:
            window = browser.new_page(viewport={"width": size[0], "height": size[1]})
            window.on("pageerror", lambda error: failures.append(str(error)))
            window.on("request", lambda request: failures.extend(_outside(request.url, path)))
            window.goto(path.as_uri())
            row_of(window, "h2").locator(".chip.off", has_text="floor").wait_for(timeout=30_000)
            return window

        yield open_file
        browser.close()
    assert failures == []


def _outside(address: str, path: Path) -> list[str]:
    return [] if address == path.as_uri() or address.startswith(("data:", "blob:")) else [address]


def shown_s(window: Any) -> float:
    return float(window.locator("#time output").inner_text().removesuffix(" s"))


def play(window: Any) -> Any:
    return window.locator("#time").get_by_role("button", name="Play")


def scrub(window: Any, share: float) -> None:
    slider = window.locator("#time [name=scrub]")
    slider.fill(str(round(share * int(slider.get_attribute("max")))))


def test_a_flight_is_played_at_its_speed_paused_and_played_faster(opened: Open) -> None:
    window = opened()
    window.locator("html[data-drawn]").wait_for(timeout=30_000)
    began_s, began_ms = shown_s(window), window.evaluate("performance.now()")
    play(window).click()
    window.wait_for_timeout(2000)
    window.locator("#time").get_by_role("button", name="Pause").click()
    paused_s = shown_s(window)
    passed_s = (window.evaluate("performance.now()") - began_ms) / 1000.0
    assert 1.0 < paused_s - began_s <= passed_s
    window.wait_for_timeout(500)
    assert shown_s(window) == paused_s
    window.locator("#time [name=speed]").select_option("8")
    play(window).click()
    window.wait_for_timeout(1000)
    assert shown_s(window) - paused_s > 2.0


def test_scrubbing_shows_rows_words_and_scene_of_a_moment(opened: Open) -> None:
    window = opened()
    canvas, before = window.locator("#stage canvas"), window.locator("#stage canvas").screenshot()
    scrub(window, 0.5)
    row_of(window, "h2").locator(".chip", has_text="flies").wait_for()
    row_of(window, "h2").locator("td", has_text="h1").wait_for()
    assert "2 fly" in window.locator("#sentence").inner_text()
    window.wait_for_timeout(300)
    assert canvas.screenshot() != before
    scrub(window, 0.0)
    row_of(window, "h2").locator(".chip", has_text="on the floor").wait_for()


def test_a_click_in_a_plot_shows_that_moment(opened: Open) -> None:
    window = opened()
    over = window.locator("#plots .u-over").first
    box = over.bounding_box()
    over.click(position={"x": box["width"] * 0.5, "y": box["height"] / 2})
    row_of(window, "h1").locator(".chip", has_text="flies").wait_for()
    assert 4.0 < shown_s(window) < 6.0


def test_a_flight_that_has_ended_is_played_from_its_beginning(opened: Open) -> None:
    window = opened()
    scrub(window, 1.0)
    ended_s = shown_s(window)
    play(window).click()
    window.wait_for_timeout(500)
    assert shown_s(window) < ended_s / 2 < LANDED_S / 2 + 1.0


def test_details_of_a_vehicle_are_those_of_the_moment(opened: Open) -> None:
    window = opened()
    row_of(window, "h1").click()
    window.locator("#details > summary").click()
    phase = window.locator("#details tr", has_text="phase").locator("td").nth(1)
    phase.get_by_text("ground").wait_for()
    scrub(window, 0.5)
    phase.get_by_text("flying").wait_for()


def test_a_signal_can_be_added_to_the_plots_of_a_recording(opened: Open) -> None:
    window = opened()
    window.locator("#time [name=signal]").select_option("thrust")
    plot = window.locator(".plot", has_text="thrust stick")
    plot.wait_for()
    window.wait_for_timeout(300)
    coloured = """canvas => {
        const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
        return data.some((value, at) => at % 4 === 0 && Math.abs(value - data[at + 2]) > 60);
    }"""
    assert plot.locator("canvas").evaluate(coloured), "nothing is drawn"


def test_the_bar_says_that_it_is_a_recording_and_nothing_can_be_requested(opened: Open) -> None:
    window = opened()
    assert window.locator("#bar").get_by_text("Recording of 2026-11-29 08:04").is_visible()
    for name in ("KILL", "Take off", "Land", "Reset", "Go to", "Apply", "Fly"):
        assert window.get_by_role("button", name=name).count() == 0
    row_of(window, "h1").click()
    assert window.locator("#selected select, #selected form").count() == 0
    assert window.locator(".handle").count() == 0


def test_figures_are_seen_first_and_events_are_folded(opened: Open) -> None:
    window = opened()
    box = window.get_by_text("formation error rms").bounding_box()
    assert box["y"] + box["height"] < DESKTOP[1], "figures need no scrolling"
    assert window.evaluate("document.documentElement.scrollHeight") < HIGHEST_PX
    assert window.evaluate("document.documentElement.scrollWidth") <= DESKTOP[0]
    events = window.locator("details.report", has=window.locator("summary", has_text="Events"))
    assert not events.locator("table").is_visible()
    events.locator("summary").click()
    assert events.get_by_text("take_off").first.is_visible()


def test_places_beside_the_leaders_are_drawn_on_demand(opened: Open) -> None:
    window = opened()
    places = window.locator("#places")
    assert places.locator(".plot").count() == 0
    places.locator("summary").click()
    places.get_by_text("h2 beside h1").wait_for()
    assert places.locator("canvas").count() == 1


def test_two_flights_are_played_one_at_a_time(opened: Open, flight: LoggedFlight, tmp_path: Path) -> None:
    both = tmp_path / "both.html"
    both.write_text(report_page(flight, replace(flight, name="other")), encoding="utf-8")
    window = opened(both)
    scrub(window, 0.5)
    row_of(window, "h1").locator(".chip", has_text="flies").wait_for()
    window.get_by_label("flight", exact=True).select_option("other")
    row_of(window, "h1").locator(".chip", has_text="on the floor").wait_for()
    scrub(window, 0.5)
    row_of(window, "h1").locator(".chip", has_text="flies").wait_for()


def test_a_telephone_shows_a_recording_without_scrolling_sideways(opened: Open) -> None:
    window = opened(size=TELEPHONE)
    assert window.evaluate("document.documentElement.scrollWidth") <= TELEPHONE[0]
    play(window).click()
    window.wait_for_timeout(1500)
    assert shown_s(window) > 0.5
