"""The benefit of preview and feed-forward: a figure-eight, flown with and without them.

One vehicle flies the same path in the same laboratory: with the path over the whole horizon and the inputs
that fly it, without these inputs, and with the path's present point as set point, a new one in every period.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from rcopterx.control.references.path_shapes import figure_eight
from rcopterx.experiments.events import Event, Fly, GoTo
from rcopterx.experiments.figures import finish_figure
from rcopterx.experiments.knowledge import beyond_equation_1
from rcopterx.experiments.record import rms, rms_and_max_mm
from rcopterx.experiments.rig import Progress, Rig
from rcopterx.experiments.runner import Cases, Experiment, Options, Result
from rcopterx.experiments.schemes import (
    CASCADE,
    NO_FEED_FORWARD,
    PAPER,
    TUNED_LQR,
    TUNED_PAPER,
    TUNED_PID,
    Scheme,
)
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import Pose
from rcopterx.vehicles.state import Array

PERIOD_S: Final = 0.02
START_S: Final = 3.0  # when the path begins; the estimator knows trim and turbulence by then
TURNS: Final = 4.0
QUICK_TURNS: Final = 1.0
PATH: Final = partial(figure_eight, (0.0, 0.0, 1.0), (0.5, 0.25), 6.0, heading="along")


@dataclass(frozen=True)
class Setting:
    """A scheme, and whether it sees the path or only the path's present point."""

    name: str
    title: str
    scheme: Scheme
    preview: bool


SETTINGS: Final = (
    Setting("set_points_paper", "Paper's scheme, set points", PAPER, preview=False),
    Setting("set_points", "Cascade, set points", CASCADE, preview=False),
    Setting("preview", "Cascade, preview", NO_FEED_FORWARD, preview=True),
    Setting("preview_feed_forward", "Cascade, preview and feed-forward", CASCADE, preview=True),
)
HELICOPTER_SETTINGS: Final = (
    Setting("set_points_paper", "Paper's scheme, tuned, set points", TUNED_PAPER, preview=False),
    Setting("set_points_lqr", "LQR, tuned, set points", TUNED_LQR, preview=False),
    Setting("set_points_pid", "PID, tuned, set points", TUNED_PID, preview=False),
    *SETTINGS[1:],
    Setting(
        "preview_feed_forward_exact",
        "Cascade, preview and feed-forward, known exactly",
        CASCADE.knowing("exact"),
        preview=True,
    ),
)


def settings_in(conditions: Conditions) -> tuple[Setting, ...]:
    """Settings that are flown in these conditions."""
    return HELICOPTER_SETTINGS if beyond_equation_1(conditions) else SETTINGS


@dataclass(frozen=True)
class Flown:
    """Places on the path and true ones, shape (K, 3) [m]; errors of yaw, shape (K,) [rad]."""

    wanted_m: Array
    flown_m: Array
    yaw_error_rad: Array

    @property
    def errors_m(self) -> Array:
        """Distances from the path's present point, shape (K,)."""
        return np.asarray(np.linalg.norm(self.flown_m - self.wanted_m, axis=1))


def fly_path(
    setting: Setting, turns: float, conditions: Conditions, seed: int, progress: Progress | None = None
) -> Flown:
    """Fly the path once."""
    path = PATH(turns=turns)
    first = path.sample(np.zeros(1))[0]
    start = Pose((first[0], first[1], first[2]), first[3])
    vehicle = setting.scheme.vehicle("h1", start, conditions, seed)
    events: Sequence[Event] = (Fly(START_S, "h1", path),)
    if not setting.preview:
        times = np.arange(0.0, path.duration_s, PERIOD_S)
        events = [
            GoTo(START_S + at_s, "h1", (row[0], row[1], row[2]), row[3])
            for at_s, row in zip(times.tolist(), path.sample(times).tolist(), strict=True)
        ]
    record = Rig([vehicle], conditions, seed).fly(START_S + path.duration_s, events, progress)["h1"]
    rows = record.time_s >= START_S
    wanted = path.sample(record.time_s[rows] - START_S)
    motion = record.motion[rows]
    return Flown(wanted[:, :3], motion[:, :3], motion[:, 3] - wanted[:, 3])


def cases(options: Options) -> Cases[Flown]:
    """Every setting of these conditions."""
    turns = QUICK_TURNS if options.quick else TURNS
    return {setting.name: partial(fly_path, setting, turns) for setting in settings_in(options.conditions)}


def figures(_: str, flights: Mapping[int, Flown]) -> dict[str, float]:
    """Distances from the path's present point, flights together."""
    errors_m = np.concatenate([flight.errors_m for flight in flights.values()])
    yaw = np.concatenate([flight.yaw_error_rad for flight in flights.values()])
    return {**rms_and_max_mm(errors_m), "yaw_rms_rad": round(rms(yaw), 4)}


def draw_preview(result: Result[Flown], figure: Any) -> None:
    """Draw the path of each setting's first flight from above, and the distance from it over time."""
    figure.set_size_inches(11, 4.5)
    above, over_time = figure.subplots(1, 2)
    preset, flown = next(iter(result.by_preset.items()))
    for setting in settings_in(result.options.conditions):
        flight = next(iter(flown[setting.name].values()))
        above.plot(*flight.flown_m[:, :2].T, linewidth=1.0, label=setting.title)
        times_s = PERIOD_S * np.arange(len(flight.errors_m))
        over_time.semilogy(times_s, np.maximum(1000 * flight.errors_m, 0.01), linewidth=1.0)
        path = flight.wanted_m
    above.plot(path[:, 0], path[:, 1], "k--", linewidth=1.0, label="path")
    above.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", xlim=(-0.8, 0.8), ylim=(-0.6, 0.6))
    above.legend(fontsize="x-small", loc="upper center", ncols=2)
    over_time.set(xlabel="time [s]", ylabel="distance from the path's present point [mm]")
    finish_figure(figure, f"A figure-eight with the heading along the path, conditions `{preset}`")


EXPERIMENT: Final = Experiment(
    "preview",
    "A figure-eight with and without preview and feed-forward",
    {"laboratory": 3, "helicopters": 3},
    cases,
    figures,
    draw_preview,
    beside_ideal=True,
)
