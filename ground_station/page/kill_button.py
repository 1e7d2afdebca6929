"""KILL in the browser: a button and the space bar, in a script of their own, so that no press is lost.

Buttons of viser are not reliable enough: viser sends one message of its panel in 50 ms and drops the others,
sends nothing while it is not connected, and hides buttons when the panel is folded up. It sends commands at
once, by their key: the script presses that key until viser has accepted it, and shows when that is not
possible.
"""

import threading
from pathlib import Path
from typing import Any, Final

import viser

from rcopterx.ground_station.page.browser_script import run_once
from rcopterx.ground_station.page.steering import Steering

ANCHOR: Final = '<i id="rcopterx-connected"></i>'
"""The script reads from its style whether viser is connected."""
STYLE: Final = Path(__file__).with_name("kill.css")
SCRIPT: Final = Path(__file__).with_name("kill.js")


def add_kill_button(server: viser.ViserServer, steering: Steering) -> None:
    """Put KILL into every browser that connects."""

    async def on_trigger(_: Any) -> None:
        # All threads of viser may be busy with requests that wait.
        threading.Thread(target=steering.kill, name="kill").start()

    server.gui.add_html(f"<style>{STYLE.read_text('utf-8')}</style>{ANCHOR}")
    server.gui.add_command(
        "KILL: cut all motors", description="Latching; reset to fly again.", hotkey="space"
    ).on_trigger(on_trigger)
    run_once(server, SCRIPT)
