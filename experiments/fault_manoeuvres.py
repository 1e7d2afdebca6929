"""Manoeuvres in which something breaks: processes are killed or hang in flight."""

import signal
from typing import Final

from rcopterx.experiments import steps
from rcopterx.experiments.checks import (
    agents_started_again,
    distance_kept,
    ends_at,
    in_the_air,
    longest_silence,
    played_in_state,
    position_kept,
    transmitters_undisturbed,
)
from rcopterx.experiments.manoeuvre import Manoeuvre
from rcopterx.experiments.steps import Say, Step, Wait, go_to, in_order, pause
from rcopterx.ground_station.fleet import Fleet
from rcopterx.simulator.faults import Occlude


def _broken(process: str, how: signal.Signals = signal.SIGKILL) -> Step:
    """Kill or stop a process in flight, and fly on."""
    return in_order(
        steps.spare_ready,
        pause(1.0),
        steps.killed(process, how),
        steps.everybody_commanded,
        steps.formed(),
        go_to((0.2, 0.0, 1.1)),
        pause(1.0),
    )


def _hidden(vehicle: str) -> Step:
    """Take a vehicle out of the Tracker's sight for a moment."""

    def fly(fleet: Fleet, say: Say, wait: Wait) -> None:
        subject = fleet.file.vehicles[vehicle].subject
        steps.injected(Occlude(subject=subject, duration_s=0.06))(fleet, say, wait)

    return fly


FAULT_ROWS: Final = (
    Manoeuvre(
        "follower-killed",
        "The agent of a follower is killed in flight; its successor flies on",
        8.0,
        _broken("agent-h2"),
        (
            *in_the_air(), agents_started_again("h2"), agents_started_again("h3", 0),
            longest_silence("h2", 0.2), position_kept("h2", 150.0), distance_kept(),
        ),
        launched=True,
    ),
    Manoeuvre(
        "leader-killed",
        "The agent of the leader is killed in flight; its followers do not notice",
        8.0,
        _broken("agent-h1"),
        (
            *in_the_air(), agents_started_again("h1"), agents_started_again("h2", 0),
            longest_silence("h1", 0.2), position_kept("h2", 150.0), distance_kept(),
        ),
        launched=True,
    ),
    Manoeuvre(
        "agent-hangs",
        "An agent hangs: its plan's inputs bridge, the transmitter gateway holds, a successor flies on",
        8.0,
        _broken("agent-h2", signal.SIGSTOP),
        (
            *in_the_air(), agents_started_again("h2"), agents_started_again("h3", 0),
            longest_silence("h2", 0.4), position_kept("h2", 150.0), distance_kept(),
        ),
        launched=True,
    ),
    Manoeuvre(
        "vicon-gateway-hangs",
        "The Vicon gateway hangs: agents predict, transmitter gateways hold, a successor continues",
        8.0,
        _broken("tracker", signal.SIGSTOP),
        (
            *in_the_air(), longest_silence("h2", 0.6), position_kept("h2", 150.0), distance_kept(),
            played_in_state("h1", "hold"),
            ends_at("h1", (0.2, 0.0, 1.1)),
        ),
        launched=True,
    ),
    Manoeuvre(
        "transmitter-gateway-hangs",
        "The transmitter gateway hangs; receivers hold, its successor takes over in flight",
        8.0,
        _broken("transmitters", signal.SIGSTOP),
        (
            *in_the_air(), longest_silence("h2", 0.6), position_kept("h2", 150.0), distance_kept(),
            ends_at("h1", (0.2, 0.0, 1.1)),
        ),
        launched=True,
    ),
    Manoeuvre(
        "router-hangs",
        "The bus router hangs; its successor continues and everybody flies on",
        8.0,
        _broken("router", signal.SIGSTOP),
        (
            *in_the_air(), longest_silence("h2", 0.6), position_kept("h2", 150.0), distance_kept(),
            ends_at("h1", (0.2, 0.0, 1.1)),
        ),
        launched=True,
    ),
    Manoeuvre(
        "occlusion",
        "The Tracker does not see a follower for 60 ms, twice: its agent predicts, nobody notices",
        6.0,
        in_order(
            pause(1.0), _hidden("h2"), pause(1.5), _hidden("h2"), pause(1.5), steps.formed(),
        ),
        (*in_the_air(), distance_kept(), transmitters_undisturbed(), position_kept("h2", 60.0)),
    ),
    Manoeuvre(
        "vicon-gateway-killed",
        "The Vicon gateway is killed in flight; its successor continues and everybody flies on",
        8.0,
        _broken("tracker"),
        (*in_the_air(), distance_kept(), ends_at("h1", (0.2, 0.0, 1.1)), ends_at("h2", (-0.2, 0.5, 1.1))),
        launched=True,
    ),
    Manoeuvre(
        "transmitter-gateway-killed",
        "The transmitter gateway is killed in flight; receivers hold, its successor takes over in flight",
        8.0,
        _broken("transmitters"),
        (*in_the_air(), distance_kept(), ends_at("h1", (0.2, 0.0, 1.1)), ends_at("h2", (-0.2, 0.5, 1.1))),
        launched=True,
    ),
    Manoeuvre(
        "router-killed",
        "The bus router is killed in flight; its successor continues and everybody flies on",
        8.0,
        _broken("router"),
        (*in_the_air(), distance_kept(), ends_at("h1", (0.2, 0.0, 1.1)), ends_at("h2", (-0.2, 0.5, 1.1))),
        launched=True,
    ),
)  # fmt: skip
