"""The state of a fleet as a table for programs: what `rcopterx status --json` and `check --json` print."""

from collections.abc import Mapping
from typing import Any

from rcopterx.bus.messages import LauncherStatus, LeaderLink
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.state import VehicleState


def fleet_status(fleet: Fleet) -> dict[str, Any]:
    """Everything that is known of a running fleet at this moment.

    Parameters
    ----------
    fleet
        A running fleet, best after `Fleet.wait_for_status`.

    Returns
    -------
    dict
        JSON document: `fleet`, `ready`, `problems`, `notes`, `tracker`, `hosts` and `vehicles` by name; what
        is not known is null. Names carry the units.
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
    """What blocks take-off: `fleet`, `ready`, `problems` and `notes`, which do not block it."""
    # Margins need numerical libraries that a status does without.
    from rcopterx.ground_station.terminal.margins import flying_warnings

    problems, notes = fleet.problems(names), [*fleet.notes(), *flying_warnings(fleet)]
    notes += [
        f"host {host}: flies about {status.flies} such vehicles"
        for host, status in fleet.launchers().items()
        if status.flies is not None and len(status.running) <= status.flies
    ]
    return {"fleet": fleet.file.name, "ready": not problems, "problems": problems, "notes": notes}


def _tracker(fleet: Fleet) -> dict[str, Any] | None:
    received = fleet.tracker.latest()
    if received is None:
        return None
    status = received.message
    return {
        "state": status.state,
        "doing": status.trying,
        "address": status.address,
        "frame": status.frame,
        "rate_hz": round(1 / status.period_s, 3) if status.period_s else None,
        "latency_s": status.latency_s,
        "age_s": _rounded(fleet.session.clock() - received.arrived_s),
        "subjects": [
            {
                "subject": subject.subject,
                "vehicle": subject.vehicle,
                "listed": subject.listed,
                "ambiguous": subject.ambiguous,
                "occluded_s": _rounded(subject.occluded_s),
            }
            for subject in status.subjects
        ],
        "counters": dict(status.counters),
        "recording": status.recording,
    }


def _processes(status: LauncherStatus) -> dict[str, Any]:
    return {
        "restarts": dict(status.restarts),
        "hung": dict(status.hung),
        "spare_ready": status.spare_ready,
        "watchdog": status.watchdog,
        "longest_silence_s": {
            name: _rounded(silence_s) for name, silence_s in status.longest_silence_s.items()
        },
        "forgiven": dict(status.forgiven),
        "flies": status.flies,
    }


def vehicle_status(state: VehicleState) -> dict[str, Any]:
    """Table of one vehicle; `agent` and `transmitter` are null before their first status."""
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
        "controller": figures.controller,
        "estimator": figures.estimator,
        "horizon": figures.horizon,
        "effort_factor": figures.effort_factor,
        "following": [_link(link) for link in agent.following],
        "assigned": [_link(link) for link in agent.assigned],
        "following_mode": agent.following_mode,
        "client": figures.client or None,
        "path_left_s": agent.path_left_s,
        "set_point": {"position_m": list(agent.set_point.position_m), "yaw_rad": agent.set_point.yaw_rad},
        "position_m": None if agent.position_m is None else list(agent.position_m),
        "velocity_m_s": None if agent.velocity_m_s is None else list(agent.velocity_m_s),
        "yaw_rad": agent.yaw_rad,
        "plan_age_s": _rounded(figures.plan_age_s),
        "ticks": figures.ticks,
        "missed_ticks": figures.missed_ticks,
        "solve_ms": {"p50": figures.solve_ms_p50, "p99": figures.solve_ms_p99, "max": figures.solve_ms_max},
        "fallbacks": dict(figures.fallbacks),
        "avoiding_ticks": figures.avoiding_ticks,
        "closest_plan_m": figures.closest_plan_m,
        "estimator_events": dict(figures.estimator_events),
        "rejected": dict(figures.rejected),
        "realtime": figures.realtime,
        "process": figures.process,
        "remarks": list(figures.remarks),
    }


def _link(link: LeaderLink) -> dict[str, Any]:
    return {
        "leader": link.leader,
        "offset_m": list(link.offset_m),
        "yaw_offset_rad": link.yaw_offset_rad,
        "frame": link.frame,
        "weight": link.weight,
    }


def _transmitter(state: VehicleState) -> dict[str, Any] | None:
    transmitter = state.transmitter
    if transmitter is None:
        return None
    return {
        "age_s": _rounded(state.transmitter_age_s),
        "state": transmitter.state,
        "reason": transmitter.reason,
        "link": transmitter.link,
        "module": transmitter.module,
        "ready": transmitter.ready,
        "lease": transmitter.lease,
        "command_age_s": _rounded(transmitter.command_age_s),
        "bridging": transmitter.bridging,
        "counters": dict(transmitter.counters),
        "rejected": dict(transmitter.rejected),
        "realtime": transmitter.realtime,
    }


def readable(status: Mapping[str, Any]) -> str:
    """A line about the fleet, one about each vehicle, each problem and each note."""
    lines = [f"{status['fleet']}: {'ready' if status['ready'] else 'not ready'}"]
    for name, table in status.get("vehicles", {}).items():
        agent, transmitter = table["agent"], table["transmitter"]
        words = [table["phase"], f"transmitter {transmitter['state']}" if transmitter else "no transmitter"]
        if agent is not None:
            leaders = ", ".join(link["leader"] for link in agent["following"])
            words += [f"flown by {agent['flown_by']}", f"follows {leaders}" if leaders else "leads"]
            words.append(f"{agent['missed_ticks']} control periods missed")
        if table["error_mm"] is not None:
            words.append(f"error {table['error_mm']:.0f} mm")
        lines.append(f"  {name}: {', '.join(words)}")
    lines += [f"  - {problem}" for problem in status["problems"]]
    return "\n".join([*lines, *(f"  note: {note}" for note in status["notes"])])


def _rounded(value_s: float | None) -> float | None:
    return None if value_s is None else round(value_s, 4)
