"""The page: builds its parts and keeps them up to date."""

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Final

import viser
from viser import _messages

from rcopterx.bus import channels
from rcopterx.ground_station.events import Timeline
from rcopterx.ground_station.page import controls
from rcopterx.ground_station.page.guard import PageServer
from rcopterx.ground_station.page.history import History
from rcopterx.ground_station.page.plots import Plots
from rcopterx.ground_station.page.scene import FleetScene
from rcopterx.ground_station.page.steering import PageSteering
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.state import VehicleState

HERE: Final = Path(__file__).parent


def _text(name: str) -> str:
    """Content of a file of this folder."""
    return (HERE / name).read_text("utf-8")


def run_once(server: viser.ViserServer, script: str) -> None:
    """Run a script of this folder once in every browser that connects."""
    server.gui._websock_interface.queue_message(_messages.RunJavascriptMessage(_text(script)))


TEXT_S: Final = 0.25
PLOT_S: Final = 0.5
NOTICE_S: Final = 6.0


class PageFrame:
    """The part of the page that loads while the fleet starts, for `FleetPage`; `steers` if not watching.

    It begins with a header, the state of the fleet, KILL, take-off and landing, above the frame of viser.
    Buttons of viser are not reliable enough for KILL: viser loads for seconds, sends one message of its panel
    in 50 ms and drops the others, sends nothing while it is not connected, and hides buttons when the panel
    is folded up. The header is complete before viser begins to load, and sends its requests by itself.
    """

    def __init__(self, server: PageServer, name: str, steers: bool = True) -> None:
        self.server, self.steers = server, steers
        self.state = controls.banner(name, (), ["waiting for the fleet to come up"])  # HTML
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
        if steers:
            run_once(server, "space.js")
        # Browsers draw less often, without expensive lights, so that the panel reacts: shadows draw
        # everything twice; preparing reflections blocks the page for 12 s without a graphics card.
        run_once(server, "drawing.js")
        server.scene.configure_default_lights(cast_shadow=False)
        server.scene.configure_environment_map(None)
        server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        server.gui.set_panel_label(f"rcopterx {name}")


class FleetPage:
    """A running fleet in the browser."""

    def __init__(self, fleet: Fleet, frame: PageFrame) -> None:
        self._fleet = fleet
        self._server = server = frame.server
        self._frame = frame
        self._applied = fleet.session.subscribe_all(channels.APPLIED)
        fleet.watch_latency()
        fleet.watch_motion()
        self.histories = {name: History() for name in fleet.file.vehicles}
        self.timeline = Timeline()
        self.steering = steering = PageSteering(fleet, self.notify) if frame.steers else None
        self._next_text_s = self._next_plot_s = 0.0
        if steering is not None:
            server.requests.update(
                kill=steering.kill, take_off=steering.take_off, land=steering.land, reset=steering.reset
            )
            server.gui.add_html(controls.suggestions(fleet.file))
        # Browsers build what they receive first: the panel before the scene.
        self._add_tabs(server)
        self.scene = FleetScene(fleet, server, self.steering)

    def _add_tabs(self, server: PageServer) -> None:
        names = list(self._fleet.file.vehicles)
        tabs = server.gui.add_tab_group()
        self.vehicles = {}
        for name in names:
            with tabs.add_tab(name):
                self.vehicles[name] = controls.VehicleControls(server, self._fleet, name, self.steering)
        if self.steering is not None:
            with tabs.add_tab("Formation"):
                controls.add_formation_controls(server, self._fleet, self.steering)
            with tabs.add_tab("Path"):
                self.waypoints = controls.Waypoints(server, self._fleet, self.steering)
        with tabs.add_tab("Plots"):
            self.plots = Plots(server, names)
        with tabs.add_tab("Events"):
            self.events = server.gui.add_html("")

    def notify(self, text: str, refused: bool) -> None:
        """Show an answer in every browser."""
        for client in self._server.get_clients().values():
            client.add_notification(
                "Refused" if refused else "Done",
                text,
                color="red" if refused else "green",
                auto_close_seconds=NOTICE_S,
            )

    def update(self, now_s: float) -> None:
        """Show the present state; `now_s` is the time of the fleet."""
        speed = self._fleet.file.clock.speed
        states = {vehicle.name: vehicle.state for vehicle in self._fleet}
        for name, state in states.items():
            self.histories[name].add(now_s, state, self._sticks(name))
        self.timeline.compare(now_s, states)
        self.scene.update(states, self.histories)
        if now_s >= self._next_text_s:
            self._next_text_s = now_s + speed * TEXT_S
            self._update_text(now_s, states)
        if now_s >= self._next_plot_s:
            self._next_plot_s = now_s + speed * PLOT_S
            self.plots.update(self.histories)

    def _update_text(self, now_s: float, states: Mapping[str, VehicleState]) -> None:
        grounded = not any(state.airborne for state in states.values())
        problems = self._fleet.problems() if grounded else []
        self._frame.state = controls.banner(self._fleet.file.title, states.values(), problems)
        with self._server.atomic():
            for name, state in states.items():
                self.vehicles[name].show(state)
            self.events.content = controls.event_list(self.timeline.events, now_s)

    def _sticks(self, name: str) -> tuple[float, ...] | None:
        inbox = self._applied.inboxes.get(name)
        received = None if inbox is None else inbox.latest()
        return None if received is None else received.message.input
