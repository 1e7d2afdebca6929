"""Fly three helicopters from the web page, and record it as a moving picture.

Needs Chromium, `pip install 'rcopterx[browser]'`, and an idle computer, since it flies in real time:

    python docs/figures/record_page.py docs/figures/ground.webp

The leader is dragged; `h3` follows another leader; the agent of `h2` is killed and nothing happens.
"""

import io
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont
from playwright.sync_api import Page, sync_playwright

from rcopterx import Fleet, launched

RCOPTERX = str(Path(sys.executable).with_name("rcopterx"))
CHROMIUM = "/usr/bin/chromium"
SOFTWARE_RENDERING = ("--no-sandbox", "--disable-gpu")
SIZE = {"width": 1280, "height": 720}
FRAME_S = 0.125
SHOWN = (896, 504)
CAPTION_AT = (356, 66)
DRAGGED_PX = (-40, 12)


class Film:
    """Pictures of a page with their times and captions."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self.frames: list[tuple[float, Image.Image, str]] = []

    def take(self, caption: str, seconds: float, act: Callable[[float], object] = lambda _: None) -> None:
        """Take pictures for a time; before each, `act` gets the share of the time that has passed."""
        begin_s = time.monotonic()
        while (passed_s := time.monotonic() - begin_s) < seconds:
            act(passed_s / seconds)
            picture = Image.open(io.BytesIO(self._page.screenshot())).convert("RGB")
            self.frames.append((time.monotonic(), picture, caption))
            self._page.wait_for_timeout(max(0.0, 1000 * (FRAME_S - (time.monotonic() - begin_s - passed_s))))


@contextmanager
def page_of() -> Iterator[str]:
    """Serve the page of the fleet; yields its address."""
    show = [RCOPTERX, "ground", "--port", "8099", "-f", "trio"]
    with subprocess.Popen(show, stdout=subprocess.PIPE, text=True) as ground:
        assert ground.stdout is not None
        try:
            yield ground.stdout.readline().split()[0]
        finally:
            ground.terminate()


def drag(film: Film, page: Page, caption: str, by: tuple[float, float]) -> None:
    """Drag the handle of the leader, release it, and watch."""
    box = page.locator(".handle:not(.lift)[data-vehicle=h1]").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    film.take(caption, 1.2, lambda share: page.mouse.move(x + share * by[0], y + share * by[1]))
    page.mouse.up()
    film.take(caption, 3.0)


def fly(film: Film, page: Page, fleet: Fleet) -> None:
    """What the moving picture shows."""
    drag(film, page, "h1 is dragged; h2 and h3 anticipate: they know its plan", DRAGGED_PX)
    page.locator("#rows tr[data-vehicle=h3]").click()
    page.locator("#selected [name=leader]").select_option("h2")
    film.take("h3 follows h2 from now on", 2.0)
    agent = fleet.state_of("h2").agent
    assert agent is not None
    os.kill(agent.diagnostics.process, signal.SIGKILL)
    drag(film, page, "kill -9 of the agent of h2", (-DRAGGED_PX[0], -DRAGGED_PX[1]))


def captioned(frame: Image.Image, text: str) -> Image.Image:
    """The picture in its final size with a line of text."""
    small = frame.resize(SHOWN, Image.Resampling.LANCZOS)
    font = ImageFont.load_default(size=20)
    ImageDraw.Draw(small).text(CAPTION_AT, text, fill=(40, 40, 40), font=font)
    return small


def main() -> None:
    """Write the moving picture."""
    with launched("trio") as fleet, page_of() as address, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(SOFTWARE_RENDERING))
        page = browser.new_page(viewport=SIZE)
        page.goto(address)
        fleet.take_off()
        fleet.wait_for_formation()
        film = Film(page)
        fly(film, page, fleet)
        browser.close()
    frames = film.frames
    durations = [round(1000 * (after - before)) for (before, *_), (after, *_) in pairwise(frames)]
    shown = [captioned(frame, text) for _, frame, text in frames]
    shown[0].save(
        sys.argv[1],
        save_all=True,
        append_images=shown[1:],
        duration=[*durations, 1500],
        loop=0,
        quality=60,
        method=4,
    )
    print(f"{len(frames)} frames of {frames[-1][0] - frames[0][0]:.1f} s")


if __name__ == "__main__":
    main()
