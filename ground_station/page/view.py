"""What a browser draws, from the states of the vehicles: pure functions, in SI units."""

import math
from collections.abc import Mapping, Reversible, Sequence
from itertools import cycle
from typing import Final

import msgspec
import numpy as np

from rcopterx.bus.messages import LeaderLink, Plan
from rcopterx.control.plugins import CONTROLLERS
from rcopterx.fleet.schema import FleetFile
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.formation.shapes import SHAPES
from rcopterx.formation.topology import station
from rcopterx.ground_station.events import EventLine
from rcopterx.ground_station.page.history import SIGNALS
from rcopterx.ground_station.page.sentences import battery, chip, learned, radio, suggestions
from rcopterx.ground_station.page.weights import GROUPS
from rcopterx.ground_station.quantities import QUANTITIES
from rcopterx.ground_station.scripting.state import VehicleState, shown_heading_deg
from rcopterx.vehicles.state import three, turned_about_z

PLAN_POINTS: Final = 25
COLOURS: Final = ("#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2")  # in turn
Point = tuple[float, float, float]
Shown = dict[str, object]  # by names that the scripts of the page read


def place_beside(
    link: LeaderLink, leader_m: Sequence[float], leader_yaw_rad: float
) -> tuple[float, float, float]:
    """Place of a follower in the inertial frame [m]."""
    return three(station([link], [np.array([*leader_m, leader_yaw_rad])])[:3])


def link_to(
    link: LeaderLink, place_m: Sequence[float], leader_m: Sequence[float], leader_yaw_rad: float
) -> LeaderLink:
    """Link that puts its follower at a place [m]; the inverse of `place_beside`."""
    away = np.array(place_m, dtype=float) - np.array(leader_m, dtype=float)
    x, y, z = turned_about_z(away, -leader_yaw_rad if link.frame == "heading" else 0.0)
    offset_m = (round(float(x), 3), round(float(y), 3), round(float(z), 3))
    return msgspec.structs.replace(link, offset_m=offset_m)


def fleet_shown(file: FleetFile, steers: bool) -> Shown:
    """What does not change of a fleet."""
    leaders = [name for name, vehicle in file.vehicles.items() if not vehicle.follow]
    vehicles = [
        {"name": name, "colour": colour, "airframe": model_of(file, name).airframe}
        for name, colour in zip(file.vehicles, cycle(COLOURS), strict=False)
    ]
    return {
        "name": file.title,
        "steers": steers,
        "vehicles": vehicles,
        "subjects": list(file.subjects),
        "volume_m": (file.volume.min_m, file.volume.max_m),
        "controllers": list(CONTROLLERS.available()),
        "shapes": list(SHAPES),
        "groups": GROUPS,
        "signals": SIGNALS,
        "suggestion": suggestions(leaders, [name for name in file.vehicles if name not in leaders]),
    }


def motion_of(state: VehicleState, states: Mapping[str, VehicleState]) -> Shown:
    """What moves of a vehicle, as far as it is known; nothing of a silent one, so that it looks dead."""
    place, agent = state.place_m, state.agent
    if agent is None or place is None or state.silent:
        return {}
    plan = state.plan if state.airborne else None
    reference = None if plan is None or plan.reference is None else plan.reference[:3]
    yaw_rad = agent.yaw_rad or 0.0
    attitude = state.quaternion_xyzw or (0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2))
    found: Shown = {
        "place": _rounded(place),
        "attitude": [round(value, 3) for value in attitude],
        "plan": None if plan is None else _line(plan),
        "reference": None if reference is None else _rounded(reference),
        "handle": handle_of(state, states),
        "following": state.leaders,
        "wind_m_s2": agent.diagnostics.wind_m_s2,
        "deviation_m": agent.diagnostics.position_deviation_m,
    }
    return {name: value for name, value in found.items() if value is not None}


def handle_of(state: VehicleState, states: Mapping[str, VehicleState]) -> Point | None:
    """Place of the handle of a vehicle; None while there is nothing to drag."""
    if state.agent is None or state.phase != "flying":
        return None
    if not state.assigned:
        return _rounded(state.agent.set_point.position_m)
    leader = states.get(state.assigned[0].leader) if len(state.assigned) == 1 else None
    if leader is None or leader.agent is None or (place := leader.place_m) is None:
        return None
    return _rounded(place_beside(state.assigned[0], place, leader.agent.yaw_rad or 0.0))


def _line(plan: Plan) -> list[list[float]]:
    """At most `PLAN_POINTS` points of a plan, with both ends."""
    places = plan.trajectory.to_numpy()[:, :3]
    chosen = np.linspace(0, len(places) - 1, min(PLAN_POINTS, len(places))).round().astype(int)
    points: list[list[float]] = np.round(places[chosen].astype(float), 3).tolist()
    return points


def _rounded(place: Sequence[float]) -> Point:
    x, y, z = (round(float(value), 3) for value in place)
    return x, y, z


def row_of(state: VehicleState) -> Shown:
    """One vehicle in the table, and what the panel shows of it; set points as x, y, z [m], heading [deg]."""
    agent = state.agent
    goal = None if agent is None else agent.set_point
    return {
        "chip": chip(state),
        "battery": battery(state),
        "radio": radio(state),
        "leader": state.assigned[0].leader if state.assigned else "",
        "following": ", ".join(state.leaders),
        "error_mm": None if state.error_m is None else round(1000 * state.error_m, 1),
        "controller": "" if agent is None else agent.diagnostics.controller,
        "silent": state.silent,
        "set_point": None if goal is None else (*_rounded(goal.position_m), shown_heading_deg(goal.yaw_rad)),
        "details": [
            (quantity.name, text, quantity.alarming(state))
            for quantity in QUANTITIES[1:]
            if (text := quantity.text(state))
        ],
        "learned": learned(state),
    }


def events_shown(lines: Reversible[EventLine]) -> list[tuple[float, str, str, bool]]:
    """Newest events first: time [s], vehicles, text with the largest count, whether it is an alarm."""
    shown = []
    for line in reversed(lines):
        most = max(line.counts.values())
        text = line.text.replace("_", " ") + (f", {most} times" if most > 1 else "")
        shown.append((line.newest_s, ", ".join(line.counts), text, line.alarming))
    return shown
