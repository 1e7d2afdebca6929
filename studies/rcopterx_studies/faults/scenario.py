"""Faults for the simulated laboratory: parsed from text and files, sent to the simulator."""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, cast, get_args

import msgspec

from rcopterx.bus.channels import SIMULATOR_UNIT
from rcopterx.bus.requests import MAX_FAULTS, Inject, InjectedFault
from rcopterx.bus.session import Session
from rcopterx.fleet.reading import converted, table_of, text_of
from rcopterx.fleet.schema import FleetError, errors_at
from rcopterx.simulator.faults import Fault, FaultRequest, TimedFault
from rcopterx.user_text import similar

FAULTS: Final[dict[str, type[FaultRequest]]] = {
    str(kind.__struct_config__.tag): kind for kind in get_args(Fault)
}
"""Every fault by its kind."""


class FaultRefusedError(RuntimeError):
    """The simulator refused the faults; none of them will happen."""


def fault_from(kind: str, values: Mapping[str, object]) -> Fault:
    """Fault of a kind of `FAULTS`; texts become numbers where needed. Raises FleetError."""
    kind = kind.replace("-", "_")
    if kind not in FAULTS:
        raise FleetError(f"unknown fault {kind!r}, known are {', '.join(FAULTS)}{similar(kind, FAULTS)}")
    return cast(Fault, converted({"kind": kind, **values}, FAULTS[kind], kind, strict=False))


def injected_faults(table: Iterable[TimedFault]) -> tuple[InjectedFault, ...]:
    """Lines of a scenario as a request carries them."""
    return tuple(InjectedFault(line.at_s, msgspec.to_builtins(line.fault)) for line in table)


def field_from(text: str) -> tuple[str, object]:
    """Field and value from `FIELD=VALUE`; lists are written `[0, 0, 1]`. Raises FleetError."""
    name, separator, value = text.partition("=")
    if not separator:
        raise FleetError(f"{text!r}: must be FIELD=VALUE")
    if not value.startswith("["):
        return name, value
    try:
        return name, json.loads(value)
    except json.JSONDecodeError:
        raise FleetError(f"{name}: {value!r} is no list") from None


def read_scenario(path: Path) -> tuple[TimedFault, ...]:
    """Faults of a file by time, `[[fault]]` with `at_s`, `kind` and its fields. Raises FleetError."""
    lines = []
    with errors_at(path):
        document = table_of(text_of(path))
        tables = document.pop("fault", [])
        if document or not isinstance(tables, list) or not 1 <= len(tables) <= MAX_FAULTS:
            raise FleetError(f"allowed are 1 to {MAX_FAULTS} tables [[fault]] and nothing else")
        for number, table in enumerate(tables, 1):
            with errors_at(f"fault {number}"):
                lines.append(_line(table))
    return tuple(sorted(lines, key=lambda line: line.at_s))


def _line(table: object) -> TimedFault:
    if not isinstance(table, dict):
        raise FleetError("must be a table [[fault]]")
    values: dict[str, Any] = dict(table)
    if missing := [name for name in ("at_s", "kind") if name not in values]:
        raise FleetError(f"{missing[0]} is missing")
    at_s, kind = values.pop("at_s"), values.pop("kind")
    return converted({"at_s": at_s, "fault": fault_from(str(kind), values)}, TimedFault, "", strict=False)


def inject_faults(session: Session, faults: Fault | Sequence[TimedFault]) -> None:
    """Inject faults into the simulator, one now or several by times; all or `FaultRefusedError`."""
    lines = tuple(faults) if isinstance(faults, Sequence) else (TimedFault(0.0, faults),)
    reply = session.request(SIMULATOR_UNIT, Inject(faults=injected_faults(lines)))
    if not reply.accepted:
        raise FaultRefusedError(reply.reason)


def fault_list() -> list[tuple[str, str, str]]:
    """Kind, fields with their defaults, and purpose of every fault."""
    return [(kind, _fields(cls), (cls.__doc__ or "").strip()) for kind, cls in FAULTS.items()]


def _fields(kind: type[msgspec.Struct]) -> str:
    words = []
    for field in msgspec.structs.fields(kind):
        known = field.default is not msgspec.NODEFAULT and field.default is not None
        words.append(f"{field.name}={field.default}" if known else field.name)
    return " ".join(words)
