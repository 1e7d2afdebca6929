"""The page in a real browser."""

import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from msgspec.structs import replace

from rcopterx.ground_station.page.page import FleetPage, PageFrame
from rcopterx.ground_station.scripting.fleet import Fleet
from support.bus import free_port
from support.scripted import ScriptedVehicle

NEEDED = "pip install playwright pillow"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
IN_A_BROWSER = [
    pytest.mark.campaign,
    pytest.mark.timeout(300),
    pytest.mark.skipif(CHROMIUM is None, reason="apt-get install chromium"),
]
SOFTWARE_RENDERING = ["--no-sandbox", "--disable-gpu"]
DESKTOP = (1200, 700)
TELEPHONE = (400, 800)
SIZES = pytest.mark.parametrize("size", [DESKTOP, TELEPHONE], ids=["desktop", "telephone"])

Vehicles = dict[str, ScriptedVehicle]
Browse = Callable[..., Any]


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
def served(fleet: Fleet, port: int = 0) -> Iterator[str]:
    """The page, kept up to date; yields its address."""
    frame = PageFrame(port or free_port(), fleet.file.name, "key-of-this-test")
    with kept_up_to_date(FleetPage(fleet, frame)):
        yield frame.server.address
    frame.server.stop()


def row_of(window: Any, name: str) -> Any:
    return window.locator(f"#rows tr[data-vehicle={name}]")


def all_killed(vehicles: Vehicles) -> bool:
    return all(vehicle.state == "killed" for vehicle in vehicles.values())


def fly(vehicles: Vehicles) -> None:
    for index, vehicle in enumerate(vehicles.values()):
        vehicle.phase, vehicle.state = "flying", "armed"
        vehicle.plan_at((0.0, 0.6 - 1.2 * index, 1.0))
        vehicle.set_point = replace(vehicle.set_point, position_m=vehicle.position_m)


def selected(window: Any, name: str) -> Any:
    """The panel of a vehicle, after a click on its row."""
    row_of(window, name).click()
    panel = window.locator("#selected")
    panel.get_by_text(name, exact=True).wait_for()
    return panel


def requests_of(vehicle: ScriptedVehicle, kind: type) -> list[Any]:
    return [request for request in vehicle.requests if isinstance(request, kind)]
