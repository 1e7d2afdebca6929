"""Figure of the solver benchmark: computing time against the horizon."""

from collections.abc import Mapping
from typing import Any, Final

SAMPLING_MS: Final = 20.0
OURS: Final = {"cascade": "-", "cascade_lags": "--"}
"""Lines of our own, thick and black; the others take what comes."""


def draw_solver(document: Mapping[str, Any], figure: Any) -> None:
    """Draw mean and 99.9th percentile of the whole control step of every solver.

    Parameters
    ----------
    document
        As `rcopterx.benchmarks.solver.run` returns it.
    figure
        Empty `matplotlib.figure.Figure`.
    """
    figure.set_size_inches(11, 5)
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    horizons = document["horizons"]
    lengths = [int(length) for length in horizons]
    for name in next(iter(horizons.values())):
        own = {"color": "black", "linestyle": OURS[name], "linewidth": 2.2} if name in OURS else {}
        for axes, field in ((left, "mean_ms"), (right, "p999_ms")):
            values = [horizons[str(length)][name][field] for length in lengths]
            axes.plot(lengths, values, marker="o", markersize=4, label=name, **own)
    for axes, title in ((left, "mean"), (right, "99.9th percentile")):
        axes.axhline(SAMPLING_MS, color="grey", linestyle="--")
        axes.set_title(title)
        axes.set_xlabel("horizon N")
        axes.set_yscale("log")
        axes.grid(alpha=0.3, which="both")
    left.set_ylabel("whole control step [ms], dashed: sampling time")
    left.legend(fontsize="small", ncols=2)
    figure.tight_layout()
