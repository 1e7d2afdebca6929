"""The state of a fleet as a JSON document, as `rcopterx status --json` and `check --json` print it."""

from collections.abc import Iterable, Mapping
from typing import Any

import msgspec

from rcopterx.bus.message import Message
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.state import VehicleState


def fleet_status(fleet: Fleet) -> dict[str, Any]:
    """Present state of a running fleet, best after `Fleet.wait_for_status`; unknown values are null."""
    problems = fleet.problems()
    return {
        "fleet": fleet.file.name,
        "speed": fleet.file.clock.speed,
        "ready": not problems,
        "problems": problems,
        "notes": fleet.notes(),
        "tracker": _tracker(fleet),
        "hosts": {host: _fields(status) for host, status in fleet.launchers().items()},
        "vehicles": {vehicle.name: vehicle_status(vehicle.state) for vehicle in fleet},
    }


def fleet_check(fleet: Fleet, names: list[str] | None = None) -> dict[str, Any]:
    """Problems that block take-off, and notes that do not: `fleet`, `ready`, `problems` and `notes`."""
    # Margins need numerical libraries that a status does without.
    from rcopterx.ground_station.terminal.margins import flying_warnings

    problems, notes = fleet.problems(names), [*fleet.notes(), *flying_warnings(fleet)]
    notes += [
        f"host {host}: can fly about {status.flies[0]} such vehicles"
        for host, status in fleet.launchers().items()
        if status.flies and status.control_every == 1
    ]
    return {"fleet": fleet.file.name, "ready": not problems, "problems": problems, "notes": notes}


def _fields(message: Message) -> dict[str, Any]:
    fields: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(message))
    return fields


def _tracker(fleet: Fleet) -> dict[str, Any] | None:
    if (received := fleet.tracker.latest()) is None:
        return None
    status = received.message
    return _fields(status) | {
        "doing": status.trying,
        "rate_hz": round(1 / status.period_s, 3) if status.period_s else None,
        "age_s": _rounded(fleet.session.clock() - received.arrived_s),
    }


def vehicle_status(state: VehicleState) -> dict[str, Any]:
    """State of one vehicle; `agent` and `transmitter` are null before their first status."""
    return {
        "phase": state.phase,
        "airborne": state.airborne,
        "problems": state.problems(),
        "pose_age_s": _rounded(state.pose_age_s),
        "seen_age_s": _rounded(state.seen_age_s),
        "error_mm": None if state.error_m is None else round(1000 * state.error_m, 1),
        "agent": _agent(state),
        "transmitter": None
        if state.transmitter is None
        else _fields(state.transmitter) | {"age_s": _rounded(state.transmitter_age_s)},
    }


def _agent(state: VehicleState) -> dict[str, Any] | None:
    if state.agent is None:
        return None
    fields, figures = _fields(state.agent), state.agent.diagnostics
    return {
        **fields.pop("diagnostics"),
        **fields,
        "age_s": _rounded(state.agent_age_s),
        "flown_by": state.flown_by,
        "client": figures.client or None,
        "solve_ms": {"p50": figures.solve_ms_p50, "p99": figures.solve_ms_p99, "max": figures.solve_ms_max},
    }


def readable(status: Mapping[str, Any], vehicles: Iterable[object] = ()) -> str:
    """A line about the fleet, one about each vehicle, each problem and each note."""
    lines = [f"{status['fleet']}: {'ready' if status['ready'] else 'not ready'}"]
    lines += [f"  {vehicle}" for vehicle in vehicles]
    lines += [f"  - {problem}" for problem in status["problems"]]
    return "\n".join([*lines, *(f"  note: {note}" for note in status["notes"])])


def _rounded(value_s: float | None) -> float | None:
    return None if value_s is None else round(value_s, 4)
