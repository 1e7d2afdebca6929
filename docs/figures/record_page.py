"""Record the web page of a flight as a picture and a moving picture.

Needs Chromium and `pip install playwright pillow`. Fly, then show the flight again, slowly enough for a
browser without a graphics card, and record the page:

    rcopterx demo --seconds 45
    rcopterx replay --speed 0.5 &
    rcopterx ground --watch-only --port 8099 -f trio &
    python docs/figures/record_page.py ADDRESS docs/figures/ground

ADDRESS is the one that `rcopterx ground` prints.
"""

import io
import sys
import time

from PIL import Image
from playwright.sync_api import Page, sync_playwright

CHROMIUM = "/usr/bin/chromium"
SOFTWARE_RENDERING = ("--no-sandbox", "--use-gl=swiftshader", "--enable-unsafe-swiftshader")
SIZE = {"width": 1100, "height": 620}
TAKEN_OFF_S = 12.0
"""Time from the opening of the page to the flight."""
REDRAWN_S = 2.0
"""Time from a change of the resolution to a complete scene."""
SECONDS = 24.0
FRAME_S = 0.25
FASTER = 2.0
"""Speed relative to the replay, which has half the speed of the flight."""
SHOWN = (880, 496)
FINE = "window.__viserTestpoints.devSettings.set({ fixedDpr: 1 })"


def record(address: str) -> list[Image.Image]:
    """Frames of the page, `FRAME_S` apart or as fast as the computer draws."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(SOFTWARE_RENDERING))
        page = browser.new_page(viewport=SIZE)
        page.goto(address)
        view = page.locator("iframe").element_handle().content_frame()
        view.get_by_role("tab", name="Plots").wait_for(state="attached", timeout=60_000)
        # What viser says about rendering without a graphics card is not part of the page.
        view.add_style_tag(content=".mantine-Notification-root { display: none }")
        page.wait_for_timeout(1000 * TAKEN_OFF_S)
        view.evaluate(FINE)
        page.wait_for_timeout(1000 * REDRAWN_S)
        frames = frames_of(page)
        browser.close()
    return frames


def frames_of(page: Page) -> list[Image.Image]:
    """Pictures of `SECONDS`."""
    frames = []
    end_s = time.monotonic() + SECONDS
    while time.monotonic() < end_s:
        next_s = time.monotonic() + FRAME_S
        frames.append(Image.open(io.BytesIO(page.screenshot())).convert("RGB"))
        time.sleep(max(0.0, next_s - time.monotonic()))
    return frames


def main() -> None:
    """Write `<name>.png` and `<name>.webp`."""
    address, name = sys.argv[1:]
    frames = record(address)
    small = [frame.resize(SHOWN, Image.Resampling.LANCZOS) for frame in frames]
    frames[-1].save(f"{name}.png", optimize=True)
    step_ms = round(1000 * SECONDS / FASTER / len(small))
    small[0].save(
        f"{name}.webp", save_all=True, append_images=small[1:], duration=step_ms, loop=0, quality=60, method=2
    )
    print(f"{len(small)} frames, {step_ms} ms apart")


if __name__ == "__main__":
    main()
