"""Promises of the page in a real browser: KILL by mouse and space bar, on a telephone too; a drawn scene."""

import io
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from support.bus import free_port
from support.scripted import ScriptedVehicle
from support.waiting import wait_for

from rcopterx.ground_station.page.guard import PageServer
from rcopterx.ground_station.page.page import FleetPage, PageFrame
from rcopterx.ground_station.scripting.fleet import Fleet

NEEDED = "pip install playwright pillow"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = [
    pytest.mark.campaign,
    pytest.mark.timeout(300),
    pytest.mark.skipif(CHROMIUM is None, reason="apt-get install chromium"),
]
SOFTWARE_RENDERING = ["--no-sandbox", "--use-gl=swiftshader", "--enable-unsafe-swiftshader"]
DESKTOP = (1200, 700)
TELEPHONE = (390, 800)
PRESSES = 20

Vehicles = dict[str, ScriptedVehicle]
Browse = Callable[[tuple[int, int]], Any]


@contextmanager
def kept_up_to_date(page: FleetPage) -> Iterator[None]:
    """The page's loop, in a thread: the browser's calls block this one."""
    end = threading.Event()

    def run() -> None:
        while not end.wait(0.05):
            page.update(time.monotonic())

    loop = threading.Thread(target=run)
    loop.start()
    try:
        yield
    finally:
        end.set()
        loop.join()


@contextmanager
def served(fleet: Fleet, port: int = 0) -> Iterator[PageServer]:
    """The page, kept up to date."""
    server = PageServer(port or free_port(), fleet.file.name, "key-of-this-test")
    with kept_up_to_date(FleetPage(fleet, PageFrame(server, fleet.file.name))):
        yield server
    server.stop()


@pytest.fixture
def open_window() -> Iterator[Callable[[str, tuple[int, int]], Any]]:
    """Open an address in a window of a size."""
    sync_api = pytest.importorskip("playwright.sync_api", reason=NEEDED)
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE_RENDERING)

        def opened(address: str, size: tuple[int, int]) -> Any:
            window = browser.new_page(viewport={"width": size[0], "height": size[1]})
            window.goto(address)
            window.get_by_role("button", name="KILL: cut").wait_for(state="visible", timeout=60_000)
            return window

        yield opened
        browser.close()


@pytest.fixture
def browse(fleet: Fleet, open_window: Callable[[str, tuple[int, int]], Any]) -> Iterator[Browse]:
    """Open the page in a window of a size."""
    with served(fleet) as server:
        yield lambda size: open_window(server.address, size)


def view_of(window: Any) -> Any:
    """The frame with viser's panel and scene."""
    return window.frame_locator("iframe")


def all_killed(vehicles: Vehicles) -> bool:
    return all(vehicle.state == "killed" for vehicle in vehicles.values())


@pytest.mark.parametrize("size", [DESKTOP, TELEPHONE], ids=["desktop", "telephone"])
def test_the_kill_button_is_always_there_and_cuts_everybody(
    browse: Browse, vehicles: Vehicles, size: tuple[int, int]
) -> None:
    window = browse(size)
    button = window.get_by_role("button", name="KILL: cut")
    view_of(window).get_by_role("tab", name="Events").click(force=True, timeout=60_000)
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
    window.mouse.click(100, 500)
    pressed_ms = []
    for _ in range(PRESSES):
        for vehicle in vehicles.values():
            vehicle.state = "armed"
        from_s = time.monotonic()
        window.keyboard.press("Space")
        wait_for(lambda: all_killed(vehicles), "not killed", 30.0)
        pressed_ms.append(1000.0 * (time.monotonic() - from_s))
    print(f"space bar to killed: median {np.median(pressed_ms):.0f} ms, largest {max(pressed_ms):.0f} ms")


@pytest.mark.parametrize("size", [DESKTOP, TELEPHONE], ids=["desktop", "telephone"])
def test_kill_state_take_off_and_landing_need_no_scrolling(browse: Browse, size: tuple[int, int]) -> None:
    window = browse(size)
    wanted = [window.get_by_role("button", name=name, exact=True) for name in ("Take off", "Land")]
    for one in (window.get_by_role("button", name="KILL: cut"), *wanted, window.get_by_text("h1 ground")):
        box = one.bounding_box()
        assert box["x"] >= 0.0
        assert box["y"] >= 0.0
        assert box["x"] + box["width"] <= size[0]
        assert box["y"] + box["height"] <= size[1] / 3


def test_the_panel_is_in_the_window_as_soon_as_it_is_there(browse: Browse) -> None:
    tab = view_of(browse(DESKTOP)).get_by_role("tab", name="Events")
    tab.wait_for(state="visible", timeout=60_000)
    wait_for(lambda: (box := tab.bounding_box()) and box["y"] < DESKTOP[1] / 2, "outside", 5.0)


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


@pytest.mark.parametrize("focused", ["Take off", "Fly this formation"])
def test_the_space_bar_is_kill_wherever_the_focus_is(
    browse: Browse, vehicles: Vehicles, focused: str
) -> None:
    window = browse(DESKTOP)
    view = view_of(window)
    view.get_by_role("tab", name="Formation").click(force=True, timeout=60_000)
    within = window if focused == "Take off" else view
    within.get_by_role("button", name=focused, exact=True).focus()
    window.keyboard.press("Space")
    wait_for(lambda: all_killed(vehicles), "not killed", 30.0)
    assert {verb for vehicle in vehicles.values() for verb in vehicle.verbs} <= {"Reset"}


def test_kill_that_is_pressed_without_a_connection_is_sent_once_there_is_one(
    fleet: Fleet, vehicles: Vehicles, open_window: Callable[[str, tuple[int, int]], Any]
) -> None:
    port = free_port()
    with served(fleet, port) as server:
        window = open_window(server.address, DESKTOP)
    window.get_by_role("button", name="KILL does not reach the fleet").wait_for(timeout=30_000)
    window.keyboard.press("Space")
    window.get_by_role("button", name="KILL waits").wait_for(timeout=5_000)
    assert not all_killed(vehicles)
    with served(fleet, port):
        wait_for(lambda: all_killed(vehicles), "not killed", 60.0)
        window.get_by_role("button", name="KILL: cut").wait_for(timeout=30_000)


def test_buttons_do_what_they_say(browse: Browse, vehicles: Vehicles) -> None:
    window = browse(DESKTOP)
    window.get_by_role("button", name="Take off").click(force=True)
    wait_for(lambda: all(vehicle.phase == "flying" for vehicle in vehicles.values()), "not flying", 30.0)
    window.get_by_role("button", name="Land", exact=True).click(force=True)
    wait_for(lambda: all(vehicle.phase == "ground" for vehicle in vehicles.values()), "not landed", 30.0)


def test_the_scene_is_not_blank(browse: Browse, vehicles: Vehicles) -> None:
    image = pytest.importorskip("PIL.Image", reason=NEEDED)
    for vehicle in vehicles.values():
        vehicle.phase = "flying"
        vehicle.plan_at((0.0, 0.0, 1.0))
    window = browse(DESKTOP)

    def drawn() -> bool:
        picture = np.asarray(image.open(io.BytesIO(window.screenshot())).convert("RGB"), dtype=float)
        scene = picture[150:, :800]
        return float((np.ptp(scene, axis=2) > 60.0).mean()) > 1e-4 and float(scene.std()) > 3.0

    wait_for(drawn, "nothing coloured is drawn", 60.0)
