"""Record the web page of a running fleet as a picture and a moving picture.

Needs Chromium and `pip install playwright pillow`; run it while `rcopterx demo` flies:

    python docs/figures/record_page.py http://127.0.0.1:8080 docs/figures/ground
"""

import io
import sys
import time

from PIL import Image
from playwright.sync_api import sync_playwright

CHROMIUM = "/usr/bin/chromium"
SOFTWARE_RENDERING = ("--no-sandbox", "--use-gl=swiftshader", "--enable-unsafe-swiftshader")
SIZE = {"width": 1200, "height": 700}
SECONDS = 20.0
FRAME_S = 0.4
SHOWN_WIDTH = 900


def record(address: str) -> list[Image.Image]:
    """Frames of the page, `FRAME_S` apart or as fast as the computer draws."""
    frames = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(SOFTWARE_RENDERING))
        page = browser.new_page(viewport=SIZE)
        page.goto(address)
        page.get_by_role("button", name="KILL: cut").wait_for(state="attached", timeout=60_000)
        # What viser says about rendering without a graphics card is not part of the page.
        page.add_style_tag(content=".mantine-Notification-root { display: none }")
        page.wait_for_timeout(8_000)
        end_s = time.monotonic() + SECONDS
        while time.monotonic() < end_s:
            next_s = time.monotonic() + FRAME_S
            frames.append(Image.open(io.BytesIO(page.screenshot())))
            time.sleep(max(0.0, next_s - time.monotonic()))
        browser.close()
    return frames


def main() -> None:
    """Write `<name>.png` and `<name>.gif`."""
    address, name = sys.argv[1:]
    frames = record(address)
    height = round(SHOWN_WIDTH * SIZE["height"] / SIZE["width"])
    small = [
        frame.convert("RGB")
        .resize((SHOWN_WIDTH, height))
        .convert("P", palette=Image.Palette.ADAPTIVE, colors=64)
        for frame in frames
    ]
    frames[-1].save(f"{name}.png", optimize=True)
    step_ms = round(1000 * SECONDS / len(small))
    small[0].save(
        f"{name}.gif", save_all=True, append_images=small[1:], duration=step_ms, loop=0, optimize=True
    )
    print(f"{len(small)} frames, {step_ms} ms apart")


if __name__ == "__main__":
    main()
