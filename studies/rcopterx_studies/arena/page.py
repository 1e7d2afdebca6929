"""The page of the arena: who is best at which task, and for each task a table and the ways from above."""

from collections.abc import Mapping
from functools import partial
from html import escape
from pathlib import Path
from typing import Any, Final

import numpy as np

from rcopterx.ground_station.acceptance.pages import link, write_page
from rcopterx.ground_station.report.document import table
from rcopterx_studies.arena.flying import FlownTask
from rcopterx_studies.arena.tasks import TASKS
from rcopterx_studies.experiments.runner import FlightResult
from rcopterx_studies.figures import finish_figure, svg_of

Rows = Mapping[str, Mapping[str, Any]]  # figures by scheme
HEAD: Final = (
    "scheme", "formation error rms / max [mm]", "task error rms / max [mm]", "closest [mm]", "violated [s]",
    "messages / s", "kB / s", "processor time mean / p99 [ms]", "fallbacks", "lost",
)  # fmt: skip


def score(row: Mapping[str, Any]) -> tuple[bool, float]:
    """Key by which flights are ranked: nothing lost or violated first, then the error."""
    errors = row["rms_mm"], row["task_rms_mm"]
    return bool(row["lost"]) or row["violated_s"] > 0.0, float(np.hypot(*errors))


def ranked(rows: Rows) -> list[tuple[str, Mapping[str, Any]]]:
    """Schemes with their figures, the best one first."""
    return sorted(rows.items(), key=lambda item: score(item[1]))


def write_arena(directory: Path, result: FlightResult[FlownTask]) -> Path:
    """Write `index.html` into a directory, which is created if missing."""
    reports = [
        {"verdict": "lost vehicles" if row["lost"] else "kept all"}
        for rows in result.document.values()
        for row in rows.values()
    ]
    overview = table(
        ("task", "", "best", "formation error rms [mm]", "next best", "lost vehicles"),
        (_overview(task, rows) for task, rows in result.document.items()),
    )
    sections = (_section(task, rows, result) for task, rows in result.document.items())
    return write_page(directory, "Arena", reports, overview, sections)


def _overview(task: str, rows: Rows) -> tuple[object, ...]:
    order = ranked(rows)
    best, row = order[0]
    lost = [name for name, each in rows.items() if each["lost"]]
    further = order[1][0] if len(order) > 1 else ""
    return link(task), TASKS[task].title, best, f"{row['rms_mm']:.1f}", further, ", ".join(lost)


def _section(task: str, rows: Rows, result: FlightResult[FlownTask]) -> str:
    lines = (
        (
            scheme,
            f"{row['rms_mm']:.1f} / {row['max_mm']:.0f}",
            f"{row['task_rms_mm']:.1f} / {row['task_max_mm']:.0f}",
            f"{row['closest_mm']:.0f}",
            f"{row['violated_s']:g}",
            f"{row['messages_per_s']:.0f}",
            f"{row['bytes_per_s'] / 1000:.1f}",
            f"{row['step_mean_ms']:.2f} / {row['step_p99_ms']:.2f}",
            f"{row['fallbacks']:g}",
            ("; ".join(f"{seed}: {', '.join(names)}" for seed, names in row["lost"].items()), "failed"),
        )
        for scheme, row in ranked(rows)
    )
    heading = f'<section id="{escape(task)}"><h2>{escape(task)}</h2><p>{escape(TASKS[task].title)}.</p>'
    flights = {scheme: result.flown[f"{task} / {scheme}"] for scheme in rows}
    first = {scheme: next(iter(by_seed.values())) for scheme, by_seed in flights.items()}
    picture = svg_of(task, (3.2 * len(first), 3.4), partial(_draw_ways, first))
    return "\n".join((heading, table(HEAD, lines), picture, "</section>"))


def _draw_ways(flights: Mapping[str, FlownTask], figure: Any) -> None:
    """Draw the ways of all vehicles from above, a panel for each scheme."""
    panels = figure.subplots(1, len(flights), sharex=True, sharey=True, squeeze=False)[0]
    for axes, (scheme, flown) in zip(panels, flights.items(), strict=True):
        for x, y in np.moveaxis(flown.tracks_m, 2, 1):
            (line,) = axes.plot(x, y, linewidth=0.8)
            axes.plot(x[-1], y[-1], "o", markersize=3, color=line.get_color())
        axes.set(title=scheme, xlabel="x [m]", aspect="equal")
    panels[0].set_ylabel("y [m]")
    finish_figure(figure)
