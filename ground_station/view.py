"""A running fleet in the browser: vehicles, their plans, and set points of leaders to drag. Needs viser."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import viser
from numpy.typing import NDArray

from bus.messages import Plan
from bus.session import RequestFailedError
from ground_station.fleet import Fleet
from ground_station.state import VehicleState
from ground_station.vehicle import RefusedError

Array = NDArray[np.float64]

COLOURS: Final = (
    (31, 119, 180), (255, 127, 14), (44, 160, 44), (214, 39, 40), (148, 103, 189), (140, 86, 75),
)  # fmt: skip
GREY: Final = (150, 150, 150)
DARK: Final = (60, 60, 60)
FUSELAGE_M: Final = (0.075, 0.035, 0.04)
"""Half axes."""
TAIL_M: Final = (0.14, 0.012, 0.012)
ROTOR_M: Final = 0.11
HANDLE_M: Final = 0.25
NOWHERE: Final = np.zeros((1, 2, 3))


def heading_quaternion(yaw_rad: float) -> tuple[float, float, float, float]:
    """Quaternion w, x, y, z of a heading."""
    return (math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2))


def plan_segments(plan: Plan | None) -> Array:
    """Line of a plan as segments, shape (stages - 1, 2, 3) [m]; a point without one."""
    if plan is None:
        return NOWHERE
    places = plan.trajectory.to_numpy()[:, :3]
    return np.stack((places[:-1], places[1:]), axis=1)


def box_edges(low: Array, high: Array) -> Array:
    """Edges of a box, shape (12, 2, 3) [m]."""
    corners = [np.where([i & 1, i & 2, i & 4], high, low) for i in range(8)]
    return np.array([(corners[i], corners[i | bit]) for bit in (1, 2, 4) for i in range(8) if not i & bit])


class FleetView:
    """Keeps a browser scene like the fleet.

    Parameters
    ----------
    fleet
        A running fleet.
    server
        Where browsers connect.
    """

    def __init__(self, fleet: Fleet, server: viser.ViserServer) -> None:
        self._fleet = fleet
        self._words = server.gui.add_markdown("")
        self._answer = server.gui.add_markdown(
            "Drag the handle of a vehicle that leads to send it somewhere."
        )
        volume = fleet.file.volume
        low, high = np.array(volume.min_m), np.array(volume.max_m)
        width, depth, _ = (float(value) for value in high - low)
        server.scene.add_grid("/floor", width=width, height=depth, cell_size=0.2, section_size=1.0)
        server.scene.add_line_segments("/volume", box_edges(low, high), GREY, thickness=0.006)
        middle = (low + high) / 2
        server.initial_camera.look_at = tuple(middle)
        server.initial_camera.position = tuple(middle + width * np.array([-1.1, -0.75, 0.5]))
        self.links = server.scene.add_line_segments("/links", NOWHERE, GREY, thickness=0.006)
        self._vehicles = {
            vehicle.name: _VehicleView(self, server, vehicle.name, COLOURS[index % len(COLOURS)])
            for index, vehicle in enumerate(fleet)
        }

    def __getitem__(self, name: str) -> "_VehicleView":
        return self._vehicles[name]

    @property
    def answer(self) -> str:
        """What came of the last thing that was asked."""
        return str(self._answer.content)

    def update(self) -> None:
        """Show the present."""
        states = [vehicle.state for vehicle in self._fleet]
        for state in states:
            self._vehicles[state.name].show(state)
        places = {state.name: place for state in states if (place := _place(state)) is not None}
        self.links.points = _links(states, places).astype(np.float32)
        lines = [f"- **{state.name}** {_words(state)}" for state in states]
        self._words.content = "\n".join([f"## {self._fleet.file.name}", *lines])

    def send(self, name: str, position_m: Sequence[float], yaw_rad: float) -> None:
        """Give a vehicle a set point, and show its answer."""
        try:
            self._fleet[name].go_to(position_m, yaw_rad)
        except (RefusedError, RequestFailedError) as error:
            self._answer.content = f"**Refused:** {error}"
            return
        place = ", ".join(f"{value:.2f}" for value in position_m)
        self._answer.content = f"{name}: on its way to {place} m"


class _VehicleView:
    """One vehicle: body, name, plan with its end, and the handle of its set point."""

    def __init__(
        self, view: FleetView, server: viser.ViserServer, name: str, colour: tuple[int, int, int]
    ) -> None:
        self._view = view
        self._name = name
        self._dragged = False
        self._yaw_rad = 0.0
        self.body = server.scene.add_frame(f"/{name}", show_axes=False, visible=False)
        _add_helicopter(server, name, colour)
        server.scene.add_label(f"/{name}/name", name, position=(0.0, 0.0, 0.16))
        self.plan = server.scene.add_line_segments(f"/plan_{name}", NOWHERE, colour, thickness=0.014)
        self.plan_end = server.scene.add_icosphere(f"/plan_end_{name}", 0.03, colour, visible=False)
        self.handle = server.scene.add_transform_controls(
            f"/set_point_{name}", HANDLE_M, disable_rotations=True, visible=False
        )
        self.handle.on_update(self.on_drag)

    def show(self, state: VehicleState) -> None:
        """Show the present of the vehicle."""
        agent = state.agent
        place = _place(state)
        self.body.visible = place is not None
        if agent is not None and place is not None:
            self.body.position = place
            self.body.wxyz = heading_quaternion(agent.yaw_rad or 0.0)
        flies = state.phase == "flying"
        plan = state.plan if state.airborne else None
        self.plan.points = plan_segments(plan).astype(np.float32)
        self.plan_end.visible = plan is not None
        self.plan_end.position = tuple(self.plan.points[-1, 1])
        self.handle.visible = flies and not state.leaders
        if agent is not None and not self._dragged:
            self._yaw_rad = agent.set_point.yaw_rad
            self.handle.position = agent.set_point.position_m

    def on_drag(self, event: Any) -> None:
        """Send the vehicle where its handle was let go."""
        self._dragged = event.phase != "end"
        if not self._dragged:
            x, y, z = (float(value) for value in self.handle.position)
            self._view.send(self._name, (x, y, z), self._yaw_rad)


def _words(state: VehicleState) -> str:
    words = [state.phase, *(f"follows {leader}" for leader in state.leaders)]
    if state.error_m is not None:
        words.append(f"error {1000 * state.error_m:.0f} mm")
    return ", ".join(words)


def _place(state: VehicleState) -> tuple[float, float, float] | None:
    return None if state.agent is None else state.agent.position_m


def _links(states: Sequence[VehicleState], places: Mapping[str, Sequence[float]]) -> Array:
    """Lines from vehicles to their leaders, shape (n, 2, 3) [m]."""
    ends = [
        (places[state.name], places[leader])
        for state in states
        for leader in state.leaders
        if state.name in places and leader in places
    ]
    return np.array(ends) if ends else NOWHERE


def _add_helicopter(server: viser.ViserServer, name: str, colour: tuple[int, int, int]) -> None:
    """Fuselage, tail and rotor of a vehicle, nose along x."""
    scene = server.scene
    scene.add_icosphere(f"/{name}/fuselage", 1.0, colour, scale=FUSELAGE_M)
    scene.add_box(f"/{name}/tail", colour, TAIL_M, position=(-0.11, 0.0, 0.01))
    scene.add_cylinder(f"/{name}/mast", 0.005, 0.06, DARK, position=(0.0, 0.0, 0.05))
    scene.add_cylinder(f"/{name}/rotor", ROTOR_M, 0.004, DARK, opacity=0.3, position=(0.0, 0.0, 0.08))
