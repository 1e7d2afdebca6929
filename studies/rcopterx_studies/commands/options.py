"""Options of studies."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rcopterx_studies.experiments.kept import KeptFlights

QuickOption = Annotated[bool, typer.Option("--quick", help="Short flights, as a test.")]
ProcessesOption = Annotated[
    int, typer.Option(metavar="N", min=1, help="Processor cores to use; flights do not depend on it.")
]
ResumeOption = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Store finished flights there, and skip those it has.")
]


@contextmanager
def kept_flights(resume: Path | None, context: Mapping[str, object]) -> Iterator["KeptFlights | None"]:
    """Yield the finished flights of a file, if one is named; an unusable file is a usage error."""
    from rcopterx_studies.experiments.kept import KeptFlights, KeptFlightsError

    try:
        yield None if resume is None else KeptFlights(resume, context)
    except KeptFlightsError as error:
        raise typer.BadParameter(str(error), param_hint="--resume") from None
