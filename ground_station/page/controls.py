"""Controls of the page: the whole fleet, formations, and each vehicle with its weights."""

import math
from collections.abc import Collection, Mapping, Sequence
from html import escape
from typing import Any, Final, NamedTuple

import viser

from rcopterx.bus.message import Setting
from rcopterx.control.plugins import CONTROLLERS
from rcopterx.fleet.schema import FleetFile
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.ground_station.events import LoggedEvent
from rcopterx.ground_station.geometry import on_level
from rcopterx.ground_station.page.steering import SHAPES, PageSteering
from rcopterx.ground_station.quantities import QUANTITIES, battery_low, voltage
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.state import VehicleState
from rcopterx.vehicles.state import XD_BODY, YAW, YAW_RATE, YD_BODY, ZD_BODY, X, Y, Z

NO_LEADER: Final = "(no leader)"
SPEED_M_S: Final = 0.4  # along drawn waypoints
PACE_S: Final = 1.0  # least time between two waypoints
_STATES: Final[Mapping[str, tuple[int, ...]]] = {
    "position": (X, Y, Z),
    "velocity": (XD_BODY, YD_BODY, ZD_BODY),
    "heading": (YAW, YAW_RATE),
}
EFFORT: Final = "sticks"
GROUPS: Final = (*_STATES, EFFORT)  # names of the factors on the weights of the cascade
CASCADE: Final = "cascade"


def add_formation_controls(server: viser.ViserServer, fleet: Fleet, steering: PageSteering) -> None:
    """Add the choice of a formation behind a leader."""
    names = tuple(fleet.file.vehicles)
    leader = server.gui.add_dropdown("leader", names, initial_value=names[0])
    shape = server.gui.add_dropdown("shape", tuple(SHAPES))
    spacing = server.gui.add_slider("spacing [m]", 0.5, 1.5, 0.05, 0.8)
    server.gui.add_button("Fly this formation", icon=viser.Icon.TOPOLOGY_STAR_3).on_click(
        lambda _: steering.formation(shape.value, leader.value, float(spacing.value))
    )
    server.gui.add_button("Promote it to leader of the present formation", icon=viser.Icon.CROWN).on_click(
        lambda _: steering.promote(leader.value)
    )


class VehicleControls:
    """Table, leader, controller and weights of one vehicle, in the open container of the server.

    Without `steering` there is only the table, for a page that only watches.
    """

    def __init__(
        self, server: viser.ViserServer, fleet: Fleet, name: str, steering: PageSteering | None
    ) -> None:
        self._name = name
        self.table = server.gui.add_html("")
        self._steering = steering
        if steering is None:
            return
        others = [other for other in fleet.file.vehicles if other != name]
        self.leader: Any = server.gui.add_dropdown("follows", (NO_LEADER, *others), initial_value=NO_LEADER)
        self.leader.on_update(self.on_leader)
        self.controller: Any = server.gui.add_dropdown("controller", tuple(CONTROLLERS.available()))
        self.controller.on_update(self.on_controller)
        server.gui.add_button("Land it", icon=viser.Icon.PLANE_ARRIVAL).on_click(
            lambda _: steering.land([name])
        )
        self.weights = WeightControls(server, fleet, name, steering)

    def show(self, state: VehicleState) -> None:
        """Show the present state; choices follow the vehicle, which others may have changed."""
        self.table.content = vehicle_table(state)
        if self._steering is None or state.agent is None:
            return
        links = state.assigned
        self.leader.value = links[0].leader if links else NO_LEADER
        if state.agent.diagnostics.controller in self.controller.options:
            self.controller.value = state.agent.diagnostics.controller

    def on_leader(self, event: Any) -> None:
        """Follow the chosen leader; events without a client come from this program itself."""
        if event.client is not None and self._steering is not None:
            chosen = self.leader.value
            self._steering.follow_beside(self._name, None if chosen == NO_LEADER else chosen)

    def on_controller(self, event: Any) -> None:
        """Fly with the chosen controller."""
        if event.client is not None and self._steering is not None:
            self._steering.tune(self._name, self.controller.value)


def _default_weights(fleet: Fleet, name: str) -> dict[str, tuple[float, ...]]:
    """Return the default weights of the cascade for the model with which a vehicle flies."""
    # Compiled kernels take longer to import than the rest of the page.
    from rcopterx.agents.tuning.configuration import Configuration
    from rcopterx.control.controllers.cascade.weights import default_weights

    model, agent = model_of(fleet.file, name), fleet[name].state.agent
    if agent is not None:
        model = Configuration.reported(agent.diagnostics).flown_model(model)
    default = default_weights(model, fleet.file.vehicles[name].control.period_s)
    return {"state_weights": default.states, "input_weights": default.inputs}


class Tuned(NamedTuple):
    """Powers of 2 of the sliders, and what flies with them."""

    powers: Mapping[str, float]
    controller: str
    settings: Mapping[str, Setting]


class WeightControls:
    """Sliders for factors on the default weights of the cascade, with undo."""

    def __init__(self, server: viser.ViserServer, fleet: Fleet, name: str, steering: PageSteering) -> None:
        self._fleet = fleet
        self._name = name
        self._steering = steering
        self._powers: Mapping[str, float] = dict.fromkeys(GROUPS, 0.0)
        self._history: list[Tuned] = []  # before each change
        with server.gui.add_folder("weights of the cascade, × default", expand_by_default=False):
            self.sliders: dict[str, Any] = {
                group: server.gui.add_slider(f"{group} [powers of 2]", -3.0, 3.0, 0.25, 0.0)
                for group in GROUPS
            }
            self.apply = server.gui.add_button("Apply", icon=viser.Icon.CHECK)
            self.undo = server.gui.add_button("Undo", icon=viser.Icon.ARROW_BACK_UP)
        self.apply.on_click(lambda _: self.on_apply())
        self.undo.on_click(lambda _: self.on_undo())

    def on_apply(self) -> None:
        """Fly with the weights of the sliders."""
        powers = {group: float(slider.value) for group, slider in self.sliders.items()}
        default = _default_weights(self._fleet, self._name)
        before, states = self._tuned(default), list(default["state_weights"])
        for group, indices in _STATES.items():
            for index in indices:
                states[index] *= 2.0 ** powers[group]
        inputs = tuple(weight * 2.0 ** powers[EFFORT] for weight in default["input_weights"])
        if self._steering.tune(self._name, CASCADE, state_weights=tuple(states), input_weights=inputs):
            self._powers = powers
            self._history.append(before)

    def _tuned(self, default: Mapping[str, Setting]) -> Tuned:
        """Return what flies now; weights that no setting gives are the default ones."""
        agent = self._fleet[self._name].state.agent
        if agent is None:
            return Tuned(self._powers, CASCADE, default)
        flown = agent.diagnostics
        missing = default if flown.controller == CASCADE else {}
        return Tuned(self._powers, flown.controller, {**missing, **flown.controller_settings})

    def on_undo(self) -> None:
        """Fly as before the last change."""
        if not self._history:
            return
        powers, controller, settings = self._history[-1]
        if not self._steering.tune(self._name, controller, **settings):
            return
        self._history.pop()
        self._powers = powers
        for group, value in powers.items():
            self.sliders[group].value = value


class Waypoints:
    """Waypoints, clicked on a horizontal plane of the scene, for one vehicle."""

    def __init__(self, server: viser.ViserServer, fleet: Fleet, steering: PageSteering) -> None:
        self._server = server
        self._fleet = fleet
        self._steering = steering
        self.places: list[tuple[float, float, float]] = []
        self._marks: list[Any] = []
        names = tuple(fleet.file.vehicles)
        self.vehicle = server.gui.add_dropdown("vehicle", names, initial_value=names[0])
        low_m, high_m = fleet.file.volume.min_m[2], fleet.file.volume.max_m[2]
        self.height = server.gui.add_slider(
            "height [m]", max(0.3, low_m), high_m, 0.05, min(1.0, high_m), hint="of the next waypoints"
        )
        self.drawing = server.gui.add_checkbox("click waypoints in the scene", False)
        self.drawing.on_update(lambda _: self._listen())
        server.gui.add_button("Fly through them", icon=viser.Icon.ROUTE).on_click(lambda _: self.fly())
        server.gui.add_button("Clear", icon=viser.Icon.TRASH).on_click(lambda _: self.clear())

    def _listen(self) -> None:
        if not self.drawing.value:
            self._server.scene.remove_pointer_callback()
            return

        @self._server.scene.on_pointer_event("click")
        def _(event: Any) -> None:
            self.add(event.ray_origin, event.ray_direction)

    def add(self, origin_m: Sequence[float], direction: Sequence[float]) -> None:
        """Add the point where a ray from the camera meets the height of the slider."""
        place = on_level(origin_m, direction, float(self.height.value))
        if place is None:
            return
        self.places.append(place)
        mark = self._server.scene.add_icosphere(
            f"/waypoints/{len(self.places)}", 0.04, (230, 180, 30), position=place
        )
        self._marks.append(mark)

    def clear(self) -> None:
        """Remove the waypoints."""
        for mark in self._marks:
            mark.remove()
        self.places, self._marks = [], []

    def fly(self) -> None:
        """Fly through the waypoints from the present position."""
        # Numerical libraries take longer to import than the rest of the page.
        from rcopterx.control.references.path_shapes import through

        name = self.vehicle.value
        state = self._fleet[name].state
        place = state.position_m
        if place is None or not self.places:
            self._steering.refuse("click waypoints in the scene first")
            return
        yaw_rad = 0.0 if state.agent is None else state.agent.set_point.yaw_rad
        rows, time_s, before = [(0.0, *place, yaw_rad)], 0.0, place
        for after in self.places:
            time_s += max(PACE_S, math.dist(before, after) / SPEED_M_S)
            rows.append((time_s, *after, yaw_rad))
            before = after
        self._steering.run(f"waypoints of {name}", lambda: self._fleet[name].fly(through(rows)))


EVENTS_SHOWN: Final = 30
_ALARM: Final = "color:#fff;background:#c81e1e;border-radius:4px;padding:2px 6px;font-weight:600"
_SMALL: Final = "font-size:0.85em;padding:0 0.5em"
_TABLE: Final = "font-size:0.8em;line-height:1.45;border-spacing:0;width:100%;overflow-wrap:anywhere"
_CELL: Final = "color:#777;padding:0 0.8em 0 0.6em;vertical-align:top"
_NAME: Final = f"{_CELL};width:42%"
_SHORT: Final = f"{_CELL};white-space:nowrap;width:1%"


def banner(fleet_name: str, states: Collection[VehicleState], problems: Sequence[str]) -> str:
    """Fleet and phases of its vehicles, and below them alarms and the problems that block take-off."""
    alarms = [
        f"{state.name}: {state.transmitter_state}: {state.reason}" for state in states if state.alarming
    ]
    alarms += [
        f"{state.name}: {remark}"
        for state in states
        if state.agent is not None
        for remark in state.agent.diagnostics.remarks
    ]
    alarms += [
        f"{state.name}: low voltage: {voltage(state.transmitter)}"
        for state in states
        if state.transmitter is not None and state.airborne and battery_low(state)
    ]
    lines = [f'<div style="{_ALARM};margin:3px 0">{escape(line)}</div>' for line in alarms]
    lines += [f'<div style="color:#b45309">{escape(line)}</div>' for line in problems if line not in alarms]
    phases = " · ".join(f"{escape(state.name)} {escape(state.phase)}" for state in states)
    return f'<div style="{_SMALL}"><b>{escape(fleet_name)}</b> {phases}{"".join(lines)}</div>'


def suggestions(fleet: FleetFile) -> str:
    """What to try in flight, in one sentence."""
    leaders = [name for name, vehicle in fleet.vehicles.items() if not vehicle.follow]
    ideas = [f"drag the handle of <b>{leaders[0]}</b>"]
    if followers := [name for name in fleet.vehicles if name not in leaders]:
        ideas.append(f"choose another leader in the tab of <b>{followers[-1]}</b>")
    ideas.append(f"kill an agent: <code>pkill -9 -xf &quot;rcopterx agent {leaders[0]}&quot;</code>")
    return f'<div style="{_SMALL}">In flight: {", ".join(ideas[:-1])}, or {ideas[-1]}</div>'


def vehicle_table(state: VehicleState) -> str:
    """State of one vehicle, a row for each quantity that it has."""
    rows = "".join(
        f'<tr><td style="{_NAME}">{escape(quantity.name)}</td>'
        f'<td style="{_ALARM if quantity.alarming(state) else ""}">{escape(text)}</td></tr>'
        for quantity in QUANTITIES[1:]
        if (text := quantity.text(state))
    )
    return f'<table style="{_TABLE}">{rows}</table>'


def event_list(events: Sequence[LoggedEvent], now_s: float) -> str:
    """Newest events first, with their age."""
    rows = "".join(
        f'<tr><td style="{_SHORT}">{_ago(now_s - event.time_s)}</td>'
        f'<td style="{_SHORT}">{escape(event.vehicle)}</td>'
        f'<td style="{_ALARM if event.alarming else ""}">{escape(event.words)}</td></tr>'
        for event in list(events)[: -EVENTS_SHOWN - 1 : -1]
    )
    return f'<table style="{_TABLE}">{rows or "<tr><td>nothing has happened yet</td></tr>"}</table>'


def _ago(age_s: float) -> str:
    return f"{age_s:.0f} s" if age_s < 120.0 else f"{age_s / 60.0:.0f} min"
