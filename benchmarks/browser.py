"""The web page of a running fleet in a browser without a window, for measurements."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

NEEDED: Final = "Chromium, playwright and viser"
CHROMIUM: Final = ("chromium", "chromium-browser")
ARGUMENTS: Final = ("--no-sandbox", "--use-gl=swiftshader", "--enable-unsafe-swiftshader")
PAGE_S: Final = 60.0


def browser_there() -> bool:
    """Whether everything in `NEEDED` is installed."""
    return _chromium() is not None and all(find_spec(name) is not None for name in ("playwright", "viser"))


def _chromium() -> str | None:
    return next(filter(None, map(shutil.which, CHROMIUM)), None)


@contextmanager
def browser() -> Iterator["Browser"]:
    """Chromium, until the block is left."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=_chromium(), args=list(ARGUMENTS))


@contextmanager
def served(fleet: str) -> Iterator[str]:
    """The process of the page of a fleet, until the block is left; yields its address.

    Raises
    ------
    OSError
        The process ended before it had an address.
    """
    process = subprocess.Popen(
        [sys.executable, "-u", "-m", "rcopterx", "ground", "-f", fleet],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"RCOPTERX_PARENT": str(os.getpid())},
    )
    try:
        assert process.stdout is not None
        address = next((line.split()[0] for line in process.stdout if line.startswith("http")), None)
        if address is None:
            raise OSError(f"the page has ended with exit code {process.wait()}")
        yield address
    finally:
        process.terminate()
        process.wait()


def opened(chromium: "Browser", address: str) -> "Page":
    """The page, once it can be used: KILL is connected, and the first vehicle is shown."""
    window = chromium.new_page()
    window.goto(address)
    window.get_by_role("button", name="KILL: cut").wait_for(state="visible", timeout=1000 * PAGE_S)
    window.get_by_text("command age").first.wait_for(state="visible", timeout=1000 * PAGE_S)
    return window
