"""Limits how often browsers draw, so that they react to KILL however slowly they draw."""

from pathlib import Path
from typing import Final

import viser
from viser import _messages

AMBIENT: Final = 1.2
"""Intensity of the light that has no direction."""
DRAWING: Final = Path(__file__).with_name("drawing.js")


def run_once(server: viser.ViserServer, script: Path) -> None:
    """Run a script once in every browser that connects."""
    server.gui._websock_interface.queue_message(_messages.RunJavascriptMessage(script.read_text("utf-8")))


def limit_drawing(server: viser.ViserServer) -> None:
    """Limit how often browsers draw, and switch expensive lights off."""
    run_once(server, DRAWING)
    # Shadows draw everything twice; preparing reflections blocks the page for 12 s without a graphics card.
    server.scene.configure_default_lights(cast_shadow=False)
    server.scene.configure_environment_map(None)
    server.scene.add_light_ambient("/light", intensity=AMBIENT)
