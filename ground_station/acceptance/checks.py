"""Checks on a recorded flight: a name, a figure, and whether it is acceptable."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import combinations, groupby
from typing import Any, Final

import numpy as np

from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.statistics import percentiles

PERIOD_MS: Final = 20.0
LEAST_M: Final = 0.3
TOUCHDOWN_M_S: Final = 1.0
HEADING_DEG: Final = 8.0
HEIGHT_M: Final = 0.15  # largest errors of headings and heights

Tables = dict[str, dict[str, Any]]
Result = tuple[bool, Any]


@dataclass(frozen=True)
class Check:
    """One line of a report: `judge` gets the figures and the table of each vehicle."""

    name: str
    judge: Callable[[FlightFigures, Tables], Result]

    def run(self, figures: FlightFigures, vehicles: Tables) -> dict[str, Any]:
        """Table of the report: `name`, `passed`, `figure`."""
        passed, figure = self.judge(figures, vehicles)
        return {"name": self.name, "passed": bool(passed), "figure": figure}


@partial(Check, "every vehicle ticked")
def _ticked(_: FlightFigures, vehicles: Tables) -> Result:
    least = min(table["ticks"] for table in vehicles.values())
    return least >= 1, least


@partial(Check, "no control period was missed")
def _no_period_missed(_: FlightFigures, vehicles: Tables) -> Result:
    total = sum(table["missed_ticks"] for table in vehicles.values())
    return total == 0, total


@partial(Check, "no vehicle touched the floor")
def _not_on_floor(figures: FlightFigures, vehicles: Tables) -> Result:
    touched = [name for name in vehicles if any(truth.on_floor for truth in figures.truth(name))]
    return not touched, touched


@partial(Check, "no vehicle left the flight volume")
def _inside_volume(figures: FlightFigures, vehicles: Tables) -> Result:
    outside = [name for name in vehicles if any(truth.outside for truth in figures.truth(name))]
    return not outside, outside


@partial(Check, f"frame to radio, p99 within a control period of {PERIOD_MS:g} ms")
def in_time(figures: FlightFigures, _: Tables) -> Result:
    """Commands reach the radio before the next frame."""
    times = percentiles(figures.frame_to_radio_ms())
    return (times is not None and times["p99"] <= PERIOD_MS), times and times["p99"]


@partial(Check, f"distance at least {LEAST_M:g} m")
def distance_kept(figures: FlightFigures, vehicles: Tables) -> Result:
    """No two vehicles came nearer than this."""
    gaps_m = [figures.distances_m(first, second) for first, second in combinations(vehicles, 2)]
    least = min((float(gaps.min()) for gaps in gaps_m if len(gaps)), default=math.inf)
    return least >= LEAST_M, None if least == math.inf else round(least, 3)


@partial(Check, "plans were held off each other")
def avoided(_: FlightFigures, vehicles: Tables) -> Result:
    """Some vehicle avoided another one."""
    ticks = {name: table["avoiding_ticks"] for name, table in vehicles.items()}
    return sum(ticks.values()) > 0, ticks


@partial(Check, f"all stand on the floor, touched down at {TOUCHDOWN_M_S:g} m/s at most")
def touched_down_gently(figures: FlightFigures, vehicles: Tables) -> Result:
    """Speed of the last touchdown of every vehicle with known true states."""
    last = [states[-1] for name in vehicles if (states := figures.truth(name))]
    speeds = [state.touchdown_speed_m_s for state in last]
    stands = all(state.on_floor for state in last)
    return stands and max(speeds, default=0.0) <= TOUCHDOWN_M_S, [round(speed, 3) for speed in speeds]


@partial(Check, "no transmitter gateway had to take over")
def transmitters_undisturbed(_: FlightFigures, vehicles: Tables) -> Result:
    """No transmitter gateway flew a vehicle by itself."""
    events = {name: table["safety"] for name, table in vehicles.items() if table["safety"]}
    return not events, events


CONTROLLED: Final = (_ticked, _no_period_missed)  # every vehicle was controlled all the time
IN_THE_AIR: Final = (_ticked, _not_on_floor, _inside_volume)  # no vehicle fell or flew away
ALWAYS: Final = (_ticked, _no_period_missed, _not_on_floor, _inside_volume)  # without faults and landings

USUAL_P99_MS: Final = {"pose_to_command_ms": 5.0, "frame_to_radio_ms": 12.0}  # on an idle computer


def remarks_on_latency(report: Mapping[str, Any]) -> list[str]:
    """Latencies of a report that are longer than usual; they do not fail a flight that met its deadlines."""
    return [
        f"{name.removesuffix('_ms').replace('_', ' ')} slower than usual: p99 {report[name]['p99']:g} ms, "
        f"on an idle computer at most {usual_ms:g} ms"
        for name, usual_ms in USUAL_P99_MS.items()
        if report[name] is not None and report[name]["p99"] > usual_ms
    ]


FORMATION: Final = "formation error at most"


def remarks_on_models(report: Mapping[str, Any]) -> list[str]:
    """Advice where a formation was not held as precisely as a manoeuvre demands."""
    held = all(check["passed"] for check in report["checks"] if check["name"].startswith(FORMATION))
    return [] if held else ["identified vehicles are more precise: rcopterx identify --all"]


def formation_held(rms_mm: float = 40.0, max_mm: float = 150.0) -> Check:
    """Formation error of every follower, also while offsets change."""

    def judge(_: FlightFigures, vehicles: Tables) -> Result:
        errors = {name: found for name, table in vehicles.items() if (found := table["formation_error_mm"])}
        good = all(error["rms"] <= rms_mm and error["max"] <= max_mm for error in errors.values())
        return bool(errors) and good, errors

    return Check(f"{FORMATION} {rms_mm:g} mm rms, {max_mm:g} mm", judge)


def ends_at(name: str, position_m: tuple[float, float, float], tolerance_m: float = 0.1) -> Check:
    """Place of a vehicle at the end."""

    def judge(figures: FlightFigures, _: Tables) -> Result:
        _frames, flown = figures.flown(name)
        if not len(flown):
            return False, None
        distance_m = float(np.linalg.norm(flown[-1, :3] - np.array(position_m)))
        return distance_m <= tolerance_m, round(1000 * distance_m, 1)

    return Check(f"{name} ends within {1000 * tolerance_m:g} mm of {position_m}", judge)


def heading_ends_at(name: str, yaw_deg: float) -> Check:
    """Heading of a vehicle at the end, up to whole turns."""

    def judge(figures: FlightFigures, _: Tables) -> Result:
        _frames, flown = figures.flown(name)
        if not len(flown):
            return False, None
        away = (math.degrees(float(flown[-1, 3])) - yaw_deg + 180) % 360 - 180
        return abs(away) <= HEADING_DEG, round(away, 2)

    return Check(f"{name} ends within {HEADING_DEG:g} deg of heading {yaw_deg:g} deg", judge)


def followed(name: str, *leaders: str) -> Check:
    """Leaders of a vehicle at the end."""

    def judge(figures: FlightFigures, _: Tables) -> Result:
        statuses = figures.statuses[name]
        present = [link.leader for link in statuses[-1].following] if statuses else None
        return present == list(leaders), present

    return Check(f"{name} follows {', '.join(leaders) or 'no vehicle'} in the end", judge)


def reached_height(height_m: float) -> Check:
    """Greatest height of every vehicle."""

    def judge(figures: FlightFigures, vehicles: Tables) -> Result:
        heights = {name: float(figures.flown(name)[1][:, 2].max(initial=0.0)) for name in vehicles}
        good = all(abs(height - height_m) <= HEIGHT_M for height in heights.values())
        return good, {name: round(height, 3) for name, height in heights.items()}

    return Check(f"every vehicle reached {height_m:g} m", judge)


def controllers_flown(name: str, *controllers: str) -> Check:
    """Controllers of a vehicle in order."""

    def judge(figures: FlightFigures, _: Tables) -> Result:
        used = (status.diagnostics.controller for status in figures.statuses[name])
        flown = [controller for controller, _ in groupby(used)]
        return flown == list(controllers), flown

    return Check(f"{name} flies with {', '.join(controllers)}", judge)


def agents_started_again(name: str, times: int = 1) -> Check:
    """Number of agent processes of a vehicle after the first."""

    def judge(figures: FlightFigures, _: Tables) -> Result:
        processes = {status.diagnostics.process for status in figures.statuses[name]}
        return len(processes) == times + 1, len(processes) - 1

    return Check(f"the agent of {name} was started again {times} time(s)", judge)
