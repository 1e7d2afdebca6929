"""Renews the calls in docs/scripting.md: `python docs/generators/scripting_page.py`."""

import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from rcopterx.bus.message import Colour, Parameters, Setting
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.launched import launched
from rcopterx.ground_station.scripting.state import VehicleState
from rcopterx.ground_station.scripting.vehicle import Vehicle

BEGIN: Final = "<!-- begin: python docs/generators/scripting_page.py -->\n"
END: Final = "<!-- end -->\n"
PAGE: Final = Path(__file__).resolve().parents[1] / "scripting.md"
CLASSES: Final = (Fleet, Vehicle, VehicleState)
ALIASES: Final = {"Parameters": Parameters, "Setting": Setting, "Colour": Colour}  # the outer one first
INTERNAL: Final = frozenset({"statuses", "frame_period_s", "moving_state_of"})


def reference() -> str:
    """The generated part of the page."""
    lines = ["### Functions", "", "| call | |", "| --- | --- |", f"| {_call('launched', launched)} |", ""]
    for kind in CLASSES:
        lines += [f"### {kind.__name__}", "", "| call or attribute | |", "| --- | --- |"]
        lines += [f"| {row} |" for row in sorted(_rows(kind))]
        lines.append("")
    return "\n".join(lines)


def with_reference(page: str) -> str:
    """The page with its generated part renewed."""
    head, rest = page.split(BEGIN)
    return head + BEGIN + "\n" + reference() + "\n" + END + rest.split(END)[1]


def _rows(kind: type) -> Iterator[str]:
    for name, member in inspect.getmembers(kind):
        if name.startswith("_") or name in INTERNAL:
            continue
        if inspect.isroutine(member):
            yield _call(name, member)
        elif isinstance(member, property):
            yield f"`{name}` | {_purpose(member)}"


def _call(name: str, function: object) -> str:
    assert callable(function)
    signature = inspect.signature(function)
    kept = [parameter for parameter in signature.parameters.values() if parameter.name != "self"]
    text = str(signature.replace(parameters=kept, return_annotation=inspect.Signature.empty))
    text = _short(text)
    for alias, annotation in ALIASES.items():
        text = text.replace(_short(inspect.formatannotation(annotation)), alias)
    escaped = text.replace("|", "\\|")
    return f"`{name}{escaped}` | {_purpose(function)}"


def _short(text: str) -> str:
    """A signature without names of modules and quotation marks."""
    return re.sub(r"(?:[A-Za-z_]\w*\.)+(\w+)", r"\1", text).replace("'", "")


def _purpose(member: object) -> str:
    return (inspect.getdoc(member) or "").splitlines()[0].replace("|", "\\|")


if __name__ == "__main__":
    PAGE.write_text(with_reference(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
