"""Chains, trees and formations with several leaders: how errors grow with the generations below the head.

In laboratory conditions the error of each follower is its distance from where its own leaders truly are plus
the offset. Chains of helicopters, drawn one by one, are measured by their absolute errors: rms in hover, and
the overshoot after a step of the head, so that what grows with the depth shows.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np

from rcopterx.bus.messages import LeaderLink
from rcopterx.formation.topology import FormationGraph, places
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import BodyPose
from rcopterx.vehicles.state import Array
from rcopterx_studies.experiments.events import GoToEvent, PilotEvent
from rcopterx_studies.experiments.knowledge import COAXIAL_LAG, LEVELS, Knowledge, plant_type
from rcopterx_studies.experiments.record import rms, rms_and_max_mm
from rcopterx_studies.experiments.rig import ROOM_M, SETTLED_S, Progress, Rig, RigVehicle
from rcopterx_studies.experiments.runner import Cases, Experiment, FlightResult, Options
from rcopterx_studies.experiments.schemes import CASCADE, FlownScheme
from rcopterx_studies.figures import finish_figure

SLOT_S: Final = 5.0
QUICK_HORIZON: Final = 20
HEAD: Final = "h1"
START: Final = (0.8, 0.0, 1.0, 0.5)  # where the head hovers at first: x, y, z [m], yaw [rad]
STEPS_M: Final = ((0.0, 0.3, 0.2), (0.3, 0.0, 0.0), (-0.3, -0.2, -0.2), (0.0, 0.0, 0.3), (0.1, 0.1, -0.3))
"""Set points of the head relative to its start, one after the other."""

LENGTHS: Final = (5, 10, 20)
SHARES: Final = (0.25, 1.0)
"""Of a leader's deviation that its follower copies: the default, and the paper's plan alone."""
DEEP_HORIZON: Final = 30
DEEP_START: Final = (1.0, 0.0, 1.0, 0.0)
HOVER_FROM_S: Final = 4.0
"""Horizon of chains of helicopters, where their head begins, and from when on their hovering counts."""
APART_M: Final = 0.6  # distance of the vehicles of such a chain; nearer ones are in each other's wake
STEPPED_S: Final = 12.0
STEP_S: Final = 8.0
STEP_M: Final = 0.4
"""When the head of a chain of helicopters steps, for how long it is observed, and how far the step is."""


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
    links: FormationGraph,
    conditions: Conditions,
    seed: int,
    scheme: FlownScheme = CASCADE,
    start: tuple[float, float, float, float] = START,
) -> list[RigVehicle]:
    """Vehicles of a formation in the air, each at its place."""
    where = places(links, {HEAD: np.array(start)})
    found = []
    for name, following in links.items():
        x, y, z, yaw = where[name].tolist()
        found.append(scheme.vehicle(name, BodyPose((x, y, z), yaw), conditions, seed, following))
    return found


def fly_shape(
    links: FormationGraph, quick: bool, conditions: Conditions, seed: int, progress: Progress | None = None
) -> dict[str, Array]:
    """Fly a formation; returns the errors of every follower in every settled control period [m]."""
    steps = STEPS_M[: 2 if quick else None]
    x, y, z, yaw = START
    events: Sequence[PilotEvent] = [
        GoToEvent((number + 1) * SLOT_S, HEAD, (x + dx, y + dy, z + dz), yaw)
        for number, (dx, dy, dz) in enumerate(steps)
    ]
    scheme = replace(CASCADE, horizon=QUICK_HORIZON) if quick else CASCADE
    rig = Rig(vehicles(links, conditions, seed, scheme), conditions, seed)
    record = rig.fly((len(steps) + 1) * SLOT_S, events, progress)
    return {name: record[name].formation_error_m(SETTLED_S) for name, own in links.items() if own}


class Absolute(NamedTuple):
    """Errors of the vehicles of a chain from the head on, shape (n,): not relative to their leaders [m]."""

    hover_m: Array  # rms per horizontal axis in hover
    overshoot_m: Array  # beyond the end of the step, gusts included
    step_overshoot_m: Array  # the same of the difference to a flight in the same gusts without the step


def fly_helicopters(
    length: int,
    knowledge: Knowledge,
    share: float,
    quick: bool,
    conditions: Conditions,
    seed: int,
    progress: Progress | None = None,
) -> Absolute:
    """Fly a chain of helicopters twice: hover, then a step of the head across the chain, or none."""
    names = [f"h{number}" for number in range(1, length + 1)]
    links: FormationGraph = {HEAD: ()} | {
        name: (_behind(leader, -APART_M, 0.0, "inertial"),) for leader, name in pairwise(names)
    }
    scheme = replace(CASCADE, knowledge=knowledge, horizon=QUICK_HORIZON if quick else DEEP_HORIZON)
    x, y, z, yaw = DEEP_START
    stepped_s, end_s = (HOVER_FROM_S + 1.0, HOVER_FROM_S + 3.0) if quick else (STEPPED_S, STEPPED_S + STEP_S)
    step = GoToEvent(stepped_s, HEAD, (x, y + STEP_M, z), yaw)
    records = [
        _chain_rig(links, scheme, share, conditions, seed).fly(end_s, events, progress)
        for events in ([step], [])
    ]
    where = places(links, {HEAD: np.array(DEEP_START)})
    hover, overshoot, step_overshoot = [], [], []
    for name in names:
        time_s = records[0][name].time_s
        stepped, still = (record[name].motion[:, :2] - where[name][:2] for record in records)
        hover.append(rms(still[(time_s > HOVER_FROM_S) & (time_s < stepped_s)]))
        after = time_s >= stepped_s
        overshoot.append(stepped[after, 1].max() - STEP_M)
        step_overshoot.append((stepped - still)[after, 1].max() - STEP_M)
    return Absolute(np.array(hover), np.array(overshoot), np.array(step_overshoot))


def _chain_rig(
    links: FormationGraph, scheme: FlownScheme, share: float, conditions: Conditions, seed: int
) -> Rig:
    """Rig of a chain of helicopters in a volume with as much room on every side as others have."""
    x, y, z, _ = DEEP_START
    low_m, high_m = (x - ROOM_M, y - ROOM_M, 0.0), (x + ROOM_M, y + ROOM_M, 2.0 * z)
    found = [
        replace(vehicle, model=vehicle.model.within(low_m, high_m), deviation_share=share)
        for vehicle in vehicles(links, conditions, seed, scheme, DEEP_START)
    ]
    return Rig(found, replace(conditions, volume_min_m=low_m, volume_max_m=high_m), seed)


def cases(options: Options) -> Cases[Any]:
    """Every formation; chains of helicopters in their conditions."""
    if plant_type(options.conditions) is COAXIAL_LAG:
        return {name: partial(fly_shape, links, options.quick) for name, links in SHAPES.items()}
    return {
        f"{length} vehicles / {knowledge} / copies {share:g}": partial(
            fly_helicopters, length, knowledge, share, options.quick
        )
        for length in LENGTHS[: 1 if options.quick else None]
        for knowledge in options.knowledge
        for share in SHARES
    }


def figures(case: str, flights: Mapping[int, Any]) -> dict[str, Any]:
    """Figures of the flights of a case together."""
    return errors_by_generation(case, flights) if case in SHAPES else absolute_errors(flights)


def absolute_errors(flights: Mapping[int, Absolute]) -> dict[str, Any]:
    """Absolute errors [mm] from the head on: rms in hover of all flights, largest overshoots."""
    found = {
        "hover_mm": np.sqrt(np.mean([flown.hover_m**2 for flown in flights.values()], axis=0)),
        "overshoot_mm": np.max([flown.overshoot_m for flown in flights.values()], axis=0),
        "step_overshoot_mm": np.max([flown.step_overshoot_m for flown in flights.values()], axis=0),
    }
    return {name: np.round(1000 * values, 1).tolist() for name, values in found.items()}


def errors_by_generation(
    shape: str, flights: Mapping[int, Mapping[str, Array]]
) -> dict[str, dict[str, float]]:
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
    return 1 + max((generation(links, link.leader) for link in links[name]), default=-1)


def draw_chain(result: FlightResult[Any], figure: Any) -> None:
    """Draw errors against the generation, in chains of helicopters of the longest one."""
    if plant_type(result.options.conditions) is not COAXIAL_LAG:
        draw_depth(list(result.document.values())[-1], figure)
        return
    figure.set_size_inches(8, 4.5)
    axes = figure.subplots()
    for name, table in result.document.items():
        rows = sorted((row["generation"], row["rms_mm"], row["max_mm"]) for row in table.values())
        generations, rms_mm, max_mm = zip(*rows, strict=True)
        (line,) = axes.plot(generations, rms_mm, "o-", label=f"{name}, rms")
        axes.plot(generations, max_mm, "^:", color=line.get_color(), label=f"{name}, max")
    label = "distance from the place beside the own leaders [mm]"
    axes.set(xlabel="generation below the head", ylabel=label, xticks=range(1, 5), ylim=(0.0, None))
    axes.legend(fontsize="small", ncols=2)
    finish_figure(figure, "Errors along a chain, a tree and with several leaders, laboratory conditions")


def draw_depth(chain: Mapping[str, Mapping[str, Mapping[str, list[float]]]], figure: Any) -> None:
    """Draw absolute errors of a chain of helicopters against the generation."""
    figure.set_size_inches(8, 9)
    rows = figure.subplots(3, sharex=True)
    for knowledge, by_share in chain.items():
        for share, errors in by_share.items():
            for axes, values in zip(rows, errors.values(), strict=True):
                axes.plot(values, "o-", label=f"{knowledge}, {share}")
    rows[0].set(ylabel="rms in hover [mm]", ylim=(0, None))
    rows[1].set(ylabel="overshoot in gusts [mm]")
    rows[2].set(ylabel="overshoot by the step [mm]", xlabel="generation below the head")
    rows[0].legend(fontsize="small", ncols=2)
    finish_figure(figure, "Absolute errors along a chain of helicopters")


EXPERIMENT: Final = Experiment(
    "chain",
    "Errors along chains, trees and with several leaders",
    {"laboratory": 3, "helicopters": 3},
    cases,
    figures,
    draw_chain,
    levels=LEVELS,
)
