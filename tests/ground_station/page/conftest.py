"""A browser, and the page of a scripted fleet in it."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from support.browsing import CHROMIUM, NEEDED, SOFTWARE_RENDERING, Browse, row_of, served

from rcopterx.ground_station.scripting.fleet import Fleet


@pytest.fixture
def open_window() -> Iterator[Callable[..., Any]]:
    """Open an address in a window of a size; the test fails if a script of the page does."""
    sync_api = pytest.importorskip("playwright.sync_api", reason=NEEDED)
    failures: list[str] = []
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE_RENDERING)

        def opened(address: str, size: tuple[int, int], **options: Any) -> Any:
            window = browser.new_page(viewport={"width": size[0], "height": size[1]}, **options)
            window.on("pageerror", lambda error: failures.append(str(error)))
            window.goto(address)
            window.get_by_role("button", name="KILL: cut").wait_for(state="visible", timeout=20_000)
            return window

        yield opened
        browser.close()
    assert failures == []


@pytest.fixture
def browse(fleet: Fleet, open_window: Callable[..., Any]) -> Iterator[Browse]:
    """Open the page in a window of a size, and wait until it shows the vehicles."""
    with served(fleet) as address:

        def opened(size: tuple[int, int], **options: Any) -> Any:
            window = open_window(address, size, **options)
            row_of(window, "h2").wait_for(timeout=30_000)
            return window

        yield opened
