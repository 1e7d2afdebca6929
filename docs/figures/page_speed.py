"""Measure the web page with a real fleet of three, in Chromium without a graphics card, on an idle computer.

Needs Chromium and `pip install 'rcopterx[browser]'`:

    python docs/figures/page_speed.py
"""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from statistics import median

import numpy as np
from playwright.sync_api import Browser, sync_playwright

from rcopterx import launched
from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.recorder import FlightSampler
from rcopterx.ground_station.scripting.fleet import Fleet

CHROMIUM = "/usr/bin/chromium"
SOFTWARE_RENDERING = ("--no-sandbox", "--disable-gpu")
SIZE = {"width": 1280, "height": 760}
ROUNDS, FLOWN_S = 5, 12.0
FLEET = "trio"


@contextmanager
def ground() -> Iterator[str]:
    """Serve the page of the fleet; yields its address."""
    command = (sys.executable, "-u", "-m", "rcopterx", "ground", "-f", FLEET)
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as page:
        assert page.stdout is not None
        try:
            yield next(line.split()[0] for line in page.stdout if line.startswith("http"))
        finally:
            page.terminate()


def latency_ms(fleet: Fleet) -> float:
    """Fly for some seconds; return the 99th percentile from pose to command."""
    recorder = FlightSampler(fleet.session)
    recorder.start()
    fleet.wait(FLOWN_S)
    figures = FlightFigures(recorder.stop(), list(fleet.file.vehicles))
    return float(np.percentile(figures.pose_to_command_ms(), 99))


def opened(browser: Browser, address: str, fleet: Fleet) -> dict[str, float]:
    """Open the page, fly, and return its figures."""
    page = browser.new_page(viewport=SIZE)
    page.add_init_script(
        "new MutationObserver((_, observer) => {"
        " const sentence = document.querySelector('#sentence');"
        " if (!sentence || !document.querySelector('#kill') || !sentence.textContent.includes('fly')) return;"
        " window.ready = performance.now(); observer.disconnect();"
        "}).observe(document, {subtree: true, childList: true, characterData: true})"
    )
    page.goto(address)
    page.wait_for_function("window.rcopterx?.firstVehicle && window.ready")
    before = page.evaluate("window.rcopterx.pictures")
    p99_ms = latency_ms(fleet)
    pictures = (page.evaluate("window.rcopterx.pictures") - before) / FLOWN_S
    shown = {
        "state_ms": page.evaluate("window.ready"),
        "drawn_ms": page.evaluate("window.rcopterx.firstVehicle"),
    }
    page.close()
    return shown | {"pictures_per_s": pictures, "p99_open_ms": p99_ms}


def main() -> None:
    """Print the median of each figure, and the ratio of the latencies with the page open and closed."""
    rows: list[dict[str, float]] = []
    with launched(FLEET, record=False) as fleet, ground() as address, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(SOFTWARE_RENDERING))
        fleet.arm()
        fleet.take_off(height_m=1.0)
        for _ in range(ROUNDS):
            closed_ms = latency_ms(fleet)
            rows.append(opened(browser, address, fleet) | {"p99_closed_ms": closed_ms})
            print({name: round(value, 2) for name, value in rows[-1].items()}, flush=True)
        browser.close()
    found = {name: median(row[name] for row in rows) for name in rows[0]}
    print({name: round(value, 2) for name, value in found.items()})
    print(f"p99 open over closed: {found['p99_open_ms'] / found['p99_closed_ms']:.2f}")


if __name__ == "__main__":
    main()
