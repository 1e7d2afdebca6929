"""Scripts in the frame of viser: the space bar is KILL there too, and a limit of how often browsers draw."""

from pathlib import Path
from typing import Final

import viser
from viser import _messages

HERE: Final = Path(__file__).parent


def run_once(server: viser.ViserServer, script: str) -> None:
    """Run a script of this folder once in every browser that connects."""
    text = (HERE / script).read_text("utf-8")
    server.gui._websock_interface.queue_message(_messages.RunJavascriptMessage(text))


def limit_drawing(server: viser.ViserServer) -> None:
    """Limit how often browsers draw, and switch expensive lights off, so that the panel reacts."""
    run_once(server, "drawing.js")
    # Shadows draw everything twice; preparing reflections blocks the page for 12 s without a graphics card.
    server.scene.configure_default_lights(cast_shadow=False)
    server.scene.configure_environment_map(None)
