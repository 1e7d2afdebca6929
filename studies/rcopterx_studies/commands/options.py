"""Options of studies, and how their values are read."""

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Annotated

import typer

from rcopterx.commands.output import Progress
from rcopterx.commands.parsing import check_known

QuickOption = Annotated[bool, typer.Option("--quick", help="Short flights, as a test.")]
ProcessesOption = Annotated[
    int, typer.Option(metavar="N", min=1, help="Processor cores to use; flights do not depend on it.")
]
ResumeOption = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Store finished flights there, and skip those it has.")
]


def known_names(text: str, known: Collection[str], what: str, option: str) -> tuple[str, ...]:
    """Parse known names, separated by commas; `what` and `option` are for the error message."""
    names = tuple(name.strip() for name in text.split(","))
    check_known(names, known, what, option)
    return names


def different_numbers(text: str, option: str, lowest: int = 0, highest: int | None = None) -> tuple[int, ...]:
    """Parse different whole numbers in a range, separated by commas; `option` is for the error message."""
    try:
        numbers = tuple(int(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    inside = all(lowest <= number and (highest is None or number <= highest) for number in numbers)
    if not numbers or not inside or len(set(numbers)) < len(numbers):
        span = f"from {lowest} on" if highest is None else f"from {lowest} to {highest}"
        raise typer.BadParameter(
            f"{text!r}: allowed are different whole numbers {span}, separated by commas", param_hint=option
        )
    return numbers


def shares_on(progress: Progress) -> Callable[[str, float], None]:
    """Return what shows on `progress` the work that is done now, and the share that is done."""
    return lambda label, done: progress.show(label, f", {100 * done:.0f} %")
