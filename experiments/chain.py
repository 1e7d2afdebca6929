"""Chains, trees and formations with several leaders: how errors grow with the generations below the head.

The head flies set points in laboratory conditions; the error of each follower is its distance from where its
own leaders truly are plus the offset, so that errors that add up along a chain show.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final

import numpy as np

from rcopterx.agents.formation.topology import ancestors, places
from rcopterx.bus.messages import LeaderLink
from rcopterx.experiments.events import Event, GoTo
from rcopterx.experiments.figures import finish_figure
from rcopterx.experiments.record import rms_and_max_mm
from rcopterx.experiments.rig import SETTLED_S, Progress, Rig, RigVehicle
from rcopterx.experiments.runner import Cases, Experiment, Options, Result
from rcopterx.experiments.schemes import CASCADE, HORIZON
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import Pose
from rcopterx.vehicles.state import Array

SLOT_S: Final = 5.0
QUICK_HORIZON: Final = 20
HEAD: Final = "h1"
START: Final = (0.8, 0.0, 1.0, 0.5)
"""Where the head hovers at first: x, y, z [m], yaw [rad]."""
STEPS_M: Final = ((0.0, 0.3, 0.2), (0.3, 0.0, 0.0), (-0.3, -0.2, -0.2), (0.0, 0.0, 0.3), (0.1, 0.1, -0.3))
"""Set points of the head relative to its start, one after the other."""

FormationGraph = dict[str, tuple[LeaderLink, ...]]


def _behind(leader: str, x: float, y: float, frame: str, weight: float = 1.0) -> LeaderLink:
    return LeaderLink(leader=leader, offset_m=(x, y, 0.0), frame=frame, weight=weight)


def shapes() -> dict[str, FormationGraph]:
    """Formations by name: a chain of five in both offset frames, a tree, and several leaders per vehicle."""
    found: dict[str, FormationGraph] = {}
    for frame in ("inertial", "heading"):
        found[f"chain_{frame}"] = {HEAD: ()} | {
            f"h{number}": (_behind(f"h{number - 1}", -0.4, 0.0, frame),) for number in range(2, 6)
        }
    found["tree"] = {HEAD: ()} | {
        f"h{number}": (
            _behind(f"h{number // 2}", -0.4, 1.2 / number * (1 if number % 2 else -1), "inertial"),
        )
        for number in range(2, 8)
    }
    found["several_leaders"] = {
        HEAD: (),
        "h2": (_behind(HEAD, -0.4, 0.4, "heading"),),
        "h3": (_behind(HEAD, -0.4, -0.4, "heading"),),
        "h4": (_behind("h2", -0.4, -0.4, "heading"), _behind("h3", -0.4, 0.4, "heading")),
        "h5": (_behind("h4", -0.4, 0.0, "inertial", 2.0), _behind(HEAD, -1.0, 0.0, "inertial", 1.0)),
    }
    return found


SHAPES: Final = shapes()


def vehicles(
    links: FormationGraph, conditions: Conditions, seed: int, horizon: int = HORIZON
) -> list[RigVehicle]:
    """Vehicles of a formation in the air, each at its place."""
    where = places(links, {HEAD: np.array(START)})
    found = []
    for name, following in links.items():
        x, y, z, yaw = where[name].tolist()
        found.append(CASCADE.vehicle(name, Pose((x, y, z), yaw), conditions, seed, horizon, following))
    return found


def fly_shape(
    links: FormationGraph,
    quick: bool,
    conditions: Conditions,
    seed: int,
    progress: Progress | None = None,
) -> dict[str, Array]:
    """Fly a formation; returns the errors of every follower in every settled control period [m]."""
    steps = STEPS_M[: 2 if quick else None]
    x, y, z, yaw = START
    events: Sequence[Event] = [
        GoTo((number + 1) * SLOT_S, HEAD, (x + dx, y + dy, z + dz), yaw)
        for number, (dx, dy, dz) in enumerate(steps)
    ]
    rig = Rig(vehicles(links, conditions, seed, QUICK_HORIZON if quick else HORIZON), conditions, seed)
    record = rig.fly((len(steps) + 1) * SLOT_S, events, progress)
    return {name: record[name].formation_error_m(SETTLED_S) for name, own in links.items() if own}


def cases(options: Options) -> Cases[dict[str, Array]]:
    """Every formation."""
    return {name: partial(fly_shape, links, options.quick) for name, links in SHAPES.items()}


def figures(shape: str, flights: Mapping[int, Mapping[str, Array]]) -> dict[str, dict[str, float]]:
    """Generation of each follower, and the errors of all flights together."""
    links = SHAPES[shape]
    return {
        name: {
            "generation": generation(links, name),
            **rms_and_max_mm(np.concatenate([errors[name] for errors in flights.values()])),
        }
        for name, own in links.items()
        if own
    }


def generation(links: FormationGraph, name: str) -> int:
    """Longest way up to a head; 0 for a head."""
    own = [link.leader for link in links[name]]
    return 0 if not ancestors(links, name) else 1 + max(generation(links, leader) for leader in own)


def draw_chain(result: Result[Any], figure: Any) -> None:
    """Draw errors against the generation."""
    figure.set_size_inches(8, 4.5)
    axes = figure.subplots()
    for name, table in result.document.items():
        rows = sorted((row["generation"], row["rms_mm"], row["max_mm"]) for row in table.values())
        generations, rms_mm, max_mm = zip(*rows, strict=True)
        (line,) = axes.plot(generations, rms_mm, "o-", label=f"{name}, rms")
        axes.plot(generations, max_mm, "^:", color=line.get_color(), label=f"{name}, max")
    axes.set(xlabel="generation below the head", ylabel="distance from the place beside the own leaders [mm]")
    axes.set_ylim(bottom=0.0)
    axes.set_xticks(range(1, 5))
    axes.legend(fontsize="small", ncols=2)
    finish_figure(figure, "Errors along a chain, a tree and with several leaders, laboratory conditions")


EXPERIMENT: Final = Experiment(
    "chain",
    "Errors along chains, trees and with several leaders",
    {"laboratory": 3},
    cases,
    figures,
    draw_chain,
)
