"""The header of the page: state of the fleet, KILL, take-off and landing, above the frame of viser.

Buttons of viser are not reliable enough for KILL: viser loads for seconds, sends one message of its panel in
50 ms and drops the others, sends nothing while it is not connected, and hides buttons when the panel is
folded up. The header is complete before the frame begins to load, and sends its requests by itself.
"""

from html import escape
from pathlib import Path
from typing import Final

from rcopterx.ground_station.page.guard import PageServer
from rcopterx.ground_station.page.steering import Steering

HERE: Final = Path(__file__).parent


def _text(name: str) -> str:
    return (HERE / name).read_text("utf-8")


class Header:
    """The document that browsers load first, with the HTML `state`; without `steers` it has no buttons."""

    def __init__(self, server: PageServer, name: str, steers: bool, state: str) -> None:
        self.state = state
        self._server = server
        parts = {
            "name": escape(name),
            "style": _text("header.css"),
            "script": (_text("space.js") if steers else "") + _text("header.js"),
            "requests": _text("requests.html") if steers else "",
        }
        document = _text("header.html")
        for part, text in parts.items():
            document = document.replace(f"{{{part}}}", text)
        server.pages[""] = lambda: document.replace("{state}", self.state)
        server.pages["state"] = lambda: self.state

    def connect(self, steering: Steering) -> None:
        """Carry out requests from now on."""
        self._server.requests.update(
            kill=steering.kill, take_off=steering.take_off, land=steering.land, reset=steering.reset
        )
