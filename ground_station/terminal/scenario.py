"""Faults for the simulated laboratory: parsed from text and files, sent to the simulator."""

import json
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from rcopterx.bus.channels import SIMULATOR_UNIT
from rcopterx.bus.requests import MAX_FAULTS, Inject
from rcopterx.bus.session import Session
from rcopterx.simulator.faults import FAULTS, Fault, TimedFault, injected_faults


class ScenarioError(ValueError):
    """An unknown fault or field, or a wrong value; says what is allowed."""


class FaultRefusedError(RuntimeError):
    """The simulator refused the faults; none of them will happen."""


def fault_from(kind: str, values: Mapping[str, object]) -> Fault:
    """Fault of a kind of `rcopterx.simulator.faults.FAULTS`, with hyphens or underscores.

    Texts among the values are converted where numbers are needed. Raises ScenarioError.
    """
    kind = kind.replace("-", "_")
    if kind not in FAULTS:
        raise ScenarioError(f"unknown fault {kind!r}, known are {', '.join(FAULTS)}")
    allowed = [field.name for field in msgspec.structs.fields(FAULTS[kind])]
    for name in values:
        if name not in allowed:
            raise ScenarioError(f"{kind}: unknown field {name!r}, allowed are {', '.join(allowed) or 'none'}")
    try:
        fault: Fault = msgspec.convert({"kind": kind, **values}, Fault, strict=False)
    except msgspec.ValidationError as error:
        raise ScenarioError(f"{kind}: {str(error)[0].lower()}{str(error)[1:]}") from None
    return fault


def field_from(text: str) -> tuple[str, object]:
    """Field and value from `FIELD=VALUE`; lists are written `[0, 0, 1]`. Raises ScenarioError."""
    name, separator, value = text.partition("=")
    if not separator:
        raise ScenarioError(f"{text!r}: must be FIELD=VALUE")
    if not value.startswith("["):
        return name, value
    try:
        return name, json.loads(value)
    except json.JSONDecodeError:
        raise ScenarioError(f"{name}: {value!r} is no list") from None


def read_scenario(path: Path) -> tuple[TimedFault, ...]:
    """Faults of a scenario file by time: TOML tables `[[fault]]` with `at_s`, `kind` and its fields.

    Raises ScenarioError.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: not TOML: {error}") from None
    except RecursionError:
        raise ScenarioError(f"{path}: tables or arrays are nested too deeply") from None
    tables = document.pop("fault", [])
    if document or not isinstance(tables, list) or not 1 <= len(tables) <= MAX_FAULTS:
        raise ScenarioError(f"{path}: allowed are 1 to {MAX_FAULTS} tables [[fault]] and nothing else")
    lines = []
    for number, table in enumerate(tables, 1):
        try:
            lines.append(_line(table))
        except ScenarioError as error:
            raise ScenarioError(f"{path}: fault {number}: {error}") from None
    return tuple(sorted(lines, key=lambda line: line.at_s))


def _line(table: object) -> TimedFault:
    if not isinstance(table, dict):
        raise ScenarioError("must be a table [[fault]]")
    values: dict[str, Any] = dict(table)
    missing = [name for name in ("at_s", "kind") if name not in values]
    if missing:
        raise ScenarioError(f"{missing[0]} is missing")
    at_s, kind = values.pop("at_s"), values.pop("kind")
    try:
        return msgspec.convert({"at_s": at_s, "fault": fault_from(str(kind), values)}, TimedFault)
    except msgspec.ValidationError as error:
        raise ScenarioError(f"at_s: {str(error)[0].lower()}{str(error)[1:]}") from None


def inject_faults(session: Session, faults: Fault | Sequence[TimedFault]) -> None:
    """Inject faults into the simulator of a running fleet, one now or several by their times.

    Raises
    ------
    FaultRefusedError
        At least one is not possible; none of them will happen.
    RequestFailedError
        There is no simulator.
    """
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
