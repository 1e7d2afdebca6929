"""Record the web page of a flight as a picture and a moving picture.

Needs Chromium and `pip install playwright pillow`:

    python docs/figures/fly_for_page.py build/flight.json
    python docs/figures/record_page.py build/flight.json docs/figures/ground

The flight is replayed so slowly that a browser without a graphics card draws every picture in time.
"""

import io
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont
from playwright.sync_api import Page, sync_playwright

RCOPTERX = str(Path(sys.executable).with_name("rcopterx"))
CHROMIUM = "/usr/bin/chromium"
SOFTWARE_RENDERING = ("--no-sandbox", "--use-gl=swiftshader", "--enable-unsafe-swiftshader")
SIZE = {"width": 1100, "height": 620}
SPEED = 0.1
"""Of the replay."""
STARTED_S = 2.0
"""Until the replay publishes its first message."""
FRAME_S = 0.125
"""Between two pictures, in the time of the flight."""
SHOWN = (880, 496)
CAPTION_AT = (24, 452)
FINE = "window.__viserTestpoints.devSettings.set({ fixedDpr: 1 })"


@contextmanager
def replayed() -> Iterator[str]:
    """Replay the latest flight; yields the address of its page."""
    replay = subprocess.Popen([RCOPTERX, "replay", "--speed", str(SPEED)])
    time.sleep(STARTED_S)
    show = [RCOPTERX, "ground", "--port", "8099", "-f", "trio"]
    with subprocess.Popen(show, stdout=subprocess.PIPE, text=True) as ground:
        assert ground.stdout is not None
        try:
            yield ground.stdout.readline().split()[0]
        finally:
            for process in (ground, replay):
                process.terminate()
                process.wait()


def frames_of(page: Page, start_s: float, begin_s: float, end_s: float) -> list[tuple[float, Image.Image]]:
    """Pictures and their times [s] in the flight, which began at `start_s` of the clock."""
    frames = []
    next_s = begin_s
    while next_s < end_s:
        time.sleep(max(0.0, start_s + next_s / SPEED - time.monotonic()))
        now_s = SPEED * (time.monotonic() - start_s)
        frames.append((now_s, Image.open(io.BytesIO(page.screenshot())).convert("RGB")))
        next_s = max(now_s, next_s + FRAME_S)
    return frames


def record(begin_s: float, end_s: float) -> list[tuple[float, Image.Image]]:
    """Pictures of the page from one time of the flight to another."""
    start_s = time.monotonic() + STARTED_S
    with replayed() as address, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(SOFTWARE_RENDERING))
        page = browser.new_page(viewport=SIZE)
        page.goto(address)
        view = page.locator("iframe").element_handle().content_frame()
        assert view is not None
        # States look old in a slow replay.
        view.get_by_role("tab", name="Events").click(timeout=60_000)
        # What viser says about rendering without a graphics card is not part of the page.
        view.add_style_tag(content=".mantine-Notification-root { display: none }")
        view.evaluate(FINE)
        frames = frames_of(page, start_s, begin_s, end_s)
        browser.close()
    return frames


def captioned(frame: Image.Image, text: str) -> Image.Image:
    """The picture in its final size with a line of text."""
    small = frame.resize(SHOWN, Image.Resampling.LANCZOS)
    font = ImageFont.load_default(size=20)
    ImageDraw.Draw(small).text(CAPTION_AT, text, fill=(40, 40, 40), font=font)
    return small


def main() -> None:
    """Write `<name>.png` and `<name>.webp`."""
    captions = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    name = sys.argv[2]
    frames = record(captions[0][0], captions[-1][0])
    shown = [
        captioned(frame, next(text for at_s, text in reversed(captions) if at_s <= now_s))
        for now_s, frame in frames
    ]
    frames[len(frames) // 2][1].save(f"{name}.png", optimize=True)
    times_s = [now_s for now_s, _ in frames]
    durations = [round(1000 * (b - a)) for a, b in pairwise(times_s)] + [1500]
    shown[0].save(
        f"{name}.webp",
        save_all=True,
        append_images=shown[1:],
        duration=durations,
        loop=0,
        quality=60,
        method=4,
    )
    print(f"{len(frames)} frames of {times_s[-1] - times_s[0]:.1f} s")


if __name__ == "__main__":
    main()
