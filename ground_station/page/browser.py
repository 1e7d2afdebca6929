"""Scripts in the browser: KILL as a button and the space bar, and a limit of how often browsers draw.

Buttons of viser are not reliable enough: viser sends one message of its panel in 50 ms and drops the others,
sends nothing while it is not connected, and hides buttons when the panel is folded up. It sends commands at
once, by their key: the script presses that key until viser has accepted it, and shows when that is not
possible.
"""

import threading
from pathlib import Path
from typing import Any, Final

import viser
from viser import _messages

from rcopterx.ground_station.page.steering import Steering

ANCHOR: Final = '<i id="rcopterx-connected"></i>'
"""The script reads from its style whether viser is connected."""
HERE: Final = Path(__file__).parent
AMBIENT: Final = 1.2
"""Intensity of the light that has no direction."""


def _run_once(server: viser.ViserServer, script: str) -> None:
    """Run a script once in every browser that connects."""
    text = (HERE / script).read_text("utf-8")
    server.gui._websock_interface.queue_message(_messages.RunJavascriptMessage(text))


def limit_drawing(server: viser.ViserServer) -> None:
    """Limit how often browsers draw, and switch expensive lights off, so that they react to KILL."""
    _run_once(server, "drawing.js")
    # Shadows draw everything twice; preparing reflections blocks the page for 12 s without a graphics card.
    server.scene.configure_default_lights(cast_shadow=False)
    server.scene.configure_environment_map(None)
    server.scene.add_light_ambient("/light", intensity=AMBIENT)


def add_kill_button(server: viser.ViserServer, steering: Steering) -> None:
    """Put KILL into every browser that connects."""

    async def on_trigger(_: Any) -> None:
        # All threads of viser may be busy with requests that wait.
        threading.Thread(target=steering.kill, name="kill").start()

    server.gui.add_html(f"<style>{(HERE / 'kill.css').read_text('utf-8')}</style>{ANCHOR}")
    server.gui.add_command(
        "KILL: cut all motors", description="Latching; reset to fly again.", hotkey="space"
    ).on_trigger(on_trigger)
    _run_once(server, "kill.js")
