"""The state of a fleet as a JSON document, as `rcopterx status --json` and `check --json` print it."""

from collections.abc import Iterable, Mapping
from typing import Any, Final

import msgspec

from rcopterx.bus.host_messages import LauncherStatus
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.state import VehicleState

SUBJECT_FIELDS: Final = ("subject", "vehicle", "listed", "ambiguous")
LAUNCHER_FIELDS: Final = ("restarts", "hung", "spare_ready", "watchdog", "forgiven", "flies")
AGENT_FIELDS: Final = (
    "following", "assigned", "following_mode", "path_left_s", "set_point", "position_m", "velocity_m_s",
    "yaw_rad",
)  # fmt: skip
DIAGNOSTICS_FIELDS: Final = (
    "controller", "estimator", "horizon", "effort_factor", "ticks", "missed_ticks", "fallbacks",
    "avoiding_ticks", "closest_plan_m", "estimator_events", "rejected", "realtime", "process", "remarks",
)  # fmt: skip
TRANSMITTER_FIELDS: Final = (
    "state", "reason", "link", "module", "ready", "lease", "bridging", "counters", "rejected", "realtime",
)  # fmt: skip


def fleet_status(fleet: Fleet) -> dict[str, Any]:
    """Present state of a running fleet, best after `Fleet.wait_for_status`.

    Keys are `fleet`, `ready`, `problems`, `notes`, `tracker`, `hosts` and `vehicles` by name; unknown values
    are null.
    """
    problems = fleet.problems()
    return {
        "fleet": fleet.file.name,
        "ready": not problems,
        "problems": problems,
        "notes": fleet.notes(),
        "tracker": _tracker(fleet),
        "hosts": {host: _processes(status) for host, status in fleet.launchers().items()},
        "vehicles": {vehicle.name: vehicle_status(vehicle.state) for vehicle in fleet},
    }


def fleet_check(fleet: Fleet, names: list[str] | None = None) -> dict[str, Any]:
    """Problems that block take-off, and notes that do not: `fleet`, `ready`, `problems` and `notes`."""
    # Margins need numerical libraries that a status does without.
    from rcopterx.ground_station.terminal.margins import flying_warnings

    problems, notes = fleet.problems(names), [*fleet.notes(), *flying_warnings(fleet)]
    notes += [
        f"host {host}: can fly about {status.flies} such vehicles"
        for host, status in fleet.launchers().items()
        if status.flies is not None and len(status.running) <= status.flies
    ]
    return {"fleet": fleet.file.name, "ready": not problems, "problems": problems, "notes": notes}


def _fields(source: object, names: tuple[str, ...]) -> dict[str, Any]:
    """Attributes of a message as they are in a JSON document."""
    fields: dict[str, Any] = msgspec.json.decode(
        msgspec.json.encode({name: getattr(source, name) for name in names})
    )
    return fields


def _tracker(fleet: Fleet) -> dict[str, Any] | None:
    received = fleet.tracker.latest()
    if received is None:
        return None
    status = received.message
    return _fields(status, ("state", "address", "frame", "latency_s", "counters", "recording")) | {
        "doing": status.trying,
        "rate_hz": round(1 / status.period_s, 3) if status.period_s else None,
        "age_s": _rounded(fleet.session.clock() - received.arrived_s),
        "subjects": [
            _fields(subject, SUBJECT_FIELDS) | {"occluded_s": _rounded(subject.occluded_s)}
            for subject in status.subjects
        ],
    }


def _processes(status: LauncherStatus) -> dict[str, Any]:
    longest_s = {name: _rounded(silence_s) for name, silence_s in status.longest_silence_s.items()}
    return _fields(status, LAUNCHER_FIELDS) | {"longest_silence_s": longest_s}


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
        "transmitter": _transmitter(state),
    }


def _agent(state: VehicleState) -> dict[str, Any] | None:
    agent = state.agent
    if agent is None:
        return None
    figures = agent.diagnostics
    return {
        "age_s": _rounded(state.agent_age_s),
        "flown_by": state.flown_by,
        "client": figures.client or None,
        "plan_age_s": _rounded(figures.plan_age_s),
        "solve_ms": {"p50": figures.solve_ms_p50, "p99": figures.solve_ms_p99, "max": figures.solve_ms_max},
        **_fields(agent, AGENT_FIELDS),
        **_fields(figures, DIAGNOSTICS_FIELDS),
    }


def _transmitter(state: VehicleState) -> dict[str, Any] | None:
    transmitter = state.transmitter
    if transmitter is None:
        return None
    return {
        "age_s": _rounded(state.transmitter_age_s),
        "command_age_s": _rounded(transmitter.command_age_s),
        **_fields(transmitter, TRANSMITTER_FIELDS),
    }


def readable(status: Mapping[str, Any], vehicles: Iterable[object] = ()) -> str:
    """A line about the fleet, one about each vehicle, each problem and each note."""
    lines = [f"{status['fleet']}: {'ready' if status['ready'] else 'not ready'}"]
    lines += [f"  {vehicle}" for vehicle in vehicles]
    lines += [f"  - {problem}" for problem in status["problems"]]
    return "\n".join([*lines, *(f"  note: {note}" for note in status["notes"])])


def _rounded(value_s: float | None) -> float | None:
    return None if value_s is None else round(value_s, 4)
