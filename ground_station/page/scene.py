"""The 3-D scene: vehicles with their tilt, trails, plans, references, followers' lines, and handles."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import viser

from rcopterx.ground_station import geometry
from rcopterx.ground_station.colours import rgb_colour
from rcopterx.ground_station.page.history import History
from rcopterx.ground_station.page.steering import PageSteering
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.state import VehicleState
from rcopterx.vehicles.state import Array

AMBIENT: Final = 1.2  # intensity of the light that has no direction
GREY: Final = (150, 150, 150)
DARK: Final = (60, 60, 60)
FUSELAGE_M: Final = (0.075, 0.035, 0.04)  # half axes
TAIL_M: Final = (0.14, 0.012, 0.012)
ROTOR_M: Final = 0.11
HANDLE_M: Final = 0.25
TRAIL_S: Final = 5.0
WIND_M: Final = 1.0  # length of an arrow for 1 m/s^2
DEVIATIONS: Final = 2.0  # half axes of an ellipsoid of uncertainty in standard deviations
ENLARGED: Final = 100.0  # magnification of ellipsoids, whose size is below a millimetre while poses arrive

Point = tuple[float, float, float]


class FleetScene:
    """The scene of a running fleet; without `steering` its handles are hidden."""

    def __init__(self, fleet: Fleet, server: viser.ViserServer, steering: PageSteering | None) -> None:
        self._server = server
        self._pictures = 0
        self.wind = server.gui.add_checkbox(
            "wind arrows", False, hint="acceleration by wind as estimated: 1 m long for 1 m/s²"
        )
        self.uncertainty = server.gui.add_checkbox(
            "uncertainty",
            False,
            hint=f"{DEVIATIONS:g} standard deviations of the positions, {ENLARGED:g} times enlarged",
        )
        server.scene.add_light_ambient("/light", intensity=AMBIENT)
        volume = fleet.file.volume
        low, high = np.array(volume.min_m), np.array(volume.max_m)
        width, depth, _ = (float(value) for value in high - low)
        server.scene.add_grid("/floor", width=width, height=depth, cell_size=0.2, section_size=1.0)
        server.scene.add_line_segments("/volume", geometry.box_edges(low, high), GREY, thickness=0.006)
        middle = (low + high) / 2
        server.initial_camera.look_at = tuple(middle)
        server.initial_camera.position = tuple(middle + width * np.array([-0.85, -0.6, 0.4]))
        self.links = server.scene.add_line_segments("/links", geometry.NOWHERE, GREY, thickness=0.006)
        self._vehicles = {
            vehicle.name: VehicleShape(server, vehicle.name, rgb_colour(index), steering)
            for index, vehicle in enumerate(fleet)
        }

    def __getitem__(self, name: str) -> "VehicleShape":
        return self._vehicles[name]

    def update(self, states: Mapping[str, VehicleState], histories: Mapping[str, History]) -> None:
        """Show the present states."""
        self._pictures += 1
        with self._server.atomic():
            for number, (name, state) in enumerate(states.items(), self._pictures):
                self._vehicles[name].show(state, states)
                # Half of the lines in each picture: they cost most of the computation and the messages.
                if number % 2:
                    self._vehicles[name].show_lines(state, histories[name])
                self._vehicles[name].show_wind(state, self.wind.value)
                self._vehicles[name].show_uncertainty(state, self.uncertainty.value)
            self.links.points = _links(states).astype(np.float32)


class VehicleShape:
    """One vehicle: body, rotor disc, name, trail, plan, reference; a handle of its set point or place."""

    def __init__(
        self,
        server: viser.ViserServer,
        name: str,
        colour: tuple[int, int, int],
        steering: PageSteering | None,
    ) -> None:
        self._name = name
        self._steering = steering
        self._dragged = False
        self._trail_s = -math.inf  # time of the newest sample in the drawn trail
        self._shown: dict[tuple[str, str], object] = {}  # properties of nodes as they were last set
        self._state: VehicleState | None = None
        self._leader: VehicleState | None = None
        self.body = server.scene.add_frame(f"/{name}", show_axes=False, visible=False)
        _add_helicopter(server, name, colour)
        self.label = server.scene.add_label(f"/{name}/name", name, position=(0.0, 0.0, 0.16))
        self.wind = server.scene.add_line_segments(
            f"/wind_{name}", geometry.NOWHERE, DARK, thickness=0.01, visible=False
        )
        self.uncertainty = server.scene.add_icosphere(
            f"/uncertainty_{name}", 1.0, colour, opacity=0.25, visible=False
        )
        self.trail = server.scene.add_line_segments(f"/trail_{name}", geometry.NOWHERE, GREY, thickness=0.005)
        self.plan = server.scene.add_line_segments(f"/plan_{name}", geometry.NOWHERE, colour, thickness=0.014)
        self.plan_end = server.scene.add_icosphere(f"/plan_end_{name}", 0.03, colour, visible=False)
        self.reference = server.scene.add_icosphere(
            f"/reference_{name}", 0.05, colour, wireframe=True, subdivisions=1, visible=False
        )
        self.handle = server.scene.add_transform_controls(
            f"/set_point_{name}", HANDLE_M, disable_rotations=True, visible=False
        )
        self.handle.on_update(self.on_drag)

    def show(self, state: VehicleState, states: Mapping[str, VehicleState]) -> None:
        """Show body, label and handle."""
        self._state = state
        self._leader = states.get(state.assigned[0].leader) if len(state.assigned) == 1 else None
        place = state.position_m
        self._set(self.body, visible=place is not None)
        if place is not None:
            self._set(self.body, position=place, wxyz=_attitude(state))
        alarm = f" · {state.transmitter_state.upper()}" if state.alarming else ""
        self._set(self.label, text=self._name + alarm)
        wanted = self._wanted()
        self._set(self.handle, visible=self._steering is not None and wanted is not None)
        if wanted is not None and not self._dragged:
            self._set(self.handle, position=wanted)

    def show_lines(self, state: VehicleState, history: History) -> None:
        """Show its trail, plan and reference."""
        if history.newest_s != self._trail_s:
            self._trail_s = history.newest_s
            self.trail.points = geometry.polyline(history.trail_m(TRAIL_S)).astype(np.float32)
        plan = state.plan if state.airborne else None
        segments = geometry.plan_segments(plan).astype(np.float32)
        self.plan.points = segments
        self._set(self.plan_end, visible=plan is not None, position=tuple(segments[-1, 1].tolist()))
        self._set(self.reference, visible=plan is not None and plan.reference is not None)
        if plan is not None and plan.reference is not None:
            self._set(self.reference, position=tuple(plan.reference[:3]))

    def _set(self, node: Any, **properties: object) -> None:
        """Set properties that have changed; viser's own comparison takes ten times as long."""
        for name, value in properties.items():
            if self._shown.get((node.name, name)) != value:
                self._shown[node.name, name] = value
                setattr(node, name, value)

    def show_wind(self, state: VehicleState, wanted: bool) -> None:
        """Show the wind at the vehicle, if that is wanted and known."""
        wind = None if state.agent is None else state.agent.diagnostics.wind_m_s2
        place = state.position_m
        self._set(self.wind, visible=wanted and wind is not None and place is not None)
        if wanted and wind is not None and place is not None:
            self.wind.points = geometry.arrow(place, [WIND_M * value for value in wind]).astype(np.float32)

    def show_uncertainty(self, state: VehicleState, wanted: bool) -> None:
        """Show the uncertainty of the position, if that is wanted and known."""
        deviation_m = None if state.agent is None else state.agent.diagnostics.position_deviation_m
        place = None if state.agent is None else state.agent.position_m
        self._set(self.uncertainty, visible=wanted and deviation_m is not None and place is not None)
        if wanted and deviation_m is not None and place is not None:
            x, y, z = (ENLARGED * DEVIATIONS * value for value in deviation_m)
            self._set(self.uncertainty, position=place, scale=(x, y, z))

    def _wanted(self) -> Point | None:
        """Place of the handle; None while there is nothing to drag."""
        state = self._state
        if state is None or state.agent is None or state.phase != "flying":
            return None
        if not state.assigned:
            return state.agent.set_point.position_m
        pose = None if self._leader is None else _pose(self._leader)
        return None if pose is None else geometry.place_beside(state.assigned[0], *pose)

    def on_drag(self, event: Any) -> None:
        """Send the vehicle to the place where its handle was released."""
        self._dragged = event.phase != "end"
        self._shown.pop((self.handle.name, "position"), None)
        state, steering = self._state, self._steering
        if self._dragged or steering is None or state is None or state.agent is None:
            return
        x, y, z = (float(value) for value in self.handle.position)
        if not state.assigned:
            steering.go_to(self._name, (x, y, z), state.agent.set_point.yaw_rad)
        elif self._leader is not None and (pose := _pose(self._leader)) is not None:
            steering.follow(self._name, (geometry.link_to(state.assigned[0], (x, y, z), *pose),))


def _pose(leader: VehicleState) -> tuple[Point, float] | None:
    place = leader.position_m
    if place is None or leader.agent is None:
        return None
    return place, leader.agent.yaw_rad or 0.0


def _attitude(state: VehicleState) -> tuple[float, float, float, float]:
    """Quaternion w, x, y, z of the body: as seen, or its heading alone."""
    if state.quaternion_xyzw is not None:
        x, y, z, w = state.quaternion_xyzw
        return (w, x, y, z)
    return geometry.heading_quaternion(0.0 if state.agent is None else state.agent.yaw_rad or 0.0)


def _links(states: Mapping[str, VehicleState]) -> Array:
    """Lines from vehicles to their leaders, shape (n, 2, 3) [m]."""
    places: dict[str, Sequence[float]] = {
        name: place for name, state in states.items() if (place := state.position_m) is not None
    }
    ends = [
        (places[name], places[leader])
        for name, state in states.items()
        for leader in state.leaders
        if name in places and leader in places
    ]
    return np.array(ends) if ends else geometry.NOWHERE


def _add_helicopter(server: viser.ViserServer, name: str, colour: tuple[int, int, int]) -> None:
    """Fuselage, tail and rotor of a vehicle, nose along x."""
    scene = server.scene
    scene.add_icosphere(f"/{name}/fuselage", 1.0, colour, scale=FUSELAGE_M)
    scene.add_box(f"/{name}/tail", colour, TAIL_M, position=(-0.11, 0.0, 0.01))
    scene.add_cylinder(f"/{name}/mast", 0.005, 0.06, DARK, position=(0.0, 0.0, 0.05))
    scene.add_cylinder(f"/{name}/rotor", ROTOR_M, 0.004, DARK, opacity=0.3, position=(0.0, 0.0, 0.08))
