"""Page of messages from tables and types: `python docs/generators/messages_page.py > docs/messages.md`."""

import ast
import inspect
import json
import re
import struct
import textwrap
from collections.abc import Callable, Collection, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import msgpack
import msgspec
from msgspec import inspect as types

from rcopterx.bus.channels import CHANNELS, FIXED_UNITS
from rcopterx.bus.message import (
    MAX_CLOCK_S,
    MAX_COUNT,
    MAX_DURATION_S,
    MAX_FLOAT,
    MAX_MAGNITUDE,
    SCHEMA_VERSION,
    FloatArray,
    Message,
)
from rcopterx.bus.requests import VERBS, Reply, Request

UNITS: Final = {
    "_m_s2": "m/s²",
    "_rad_s": "rad/s",
    "_deg_s": "deg/s",
    "_m_s": "m/s",
    "_per_s": "1/s",
    "_ms_p50": "ms",
    "_ms_p99": "ms",
    "_ms_max": "ms",
    "_us": "µs",
    "_ms": "ms",
    "_gb": "GB",
    "_mb": "MB",
    "_hz": "Hz",
    "_rad": "rad",
    "_deg": "deg",
    "_m": "m",
    "_s": "s",
}
"""Units by the end of a field's name; the first match counts."""
GENERAL_LIMITS: Final = (MAX_COUNT, MAX_MAGNITUDE, MAX_DURATION_S, MAX_CLOCK_S, MAX_FLOAT)
"""Named once, at the head of the page."""

EXAMPLE: Final[dict[str, Any]] = {
    "schema_version": SCHEMA_VERSION,
    "epoch": 1700000000000,
    "frame": 4711,
    "lease": 1,
    "sequence": 1,
    "input": [0.0, 0.0, 0.55, 0.0],
    "next_inputs": {"shape": [1, 4], "data": struct.pack("<4d", 0.0, 0.0, 0.55, 0.0)},
    "period_s": 0.02,
}
"""A stick command as another program would write it."""


def reference() -> str:
    """Text of `docs/messages.md`."""
    structures: dict[str, type] = {}
    messages = [line for row in CHANNELS for line in _section(row.message, Message, structures)]
    body = [*_channel_lines(), "", "## Messages", *messages, *_request_lines(structures)]
    return "\n".join([_head(), *body, *_structure_lines(structures)]).rstrip() + "\n"


def _head() -> str:
    payload = bytes(msgpack.packb(EXAMPLE))
    shown = EXAMPLE | {"next_inputs": EXAMPLE["next_inputs"] | {"data": "<32 bytes>"}}
    fields = ",\n".join(f" {json.dumps(name)}: {json.dumps(value)}" for name, value in shown.items())
    return (
        Path(__file__)
        .with_name("messages.template")
        .read_text(encoding="utf-8")
        .format(
            units=", ".join(f"`{unit}`" for unit in FIXED_UNITS),
            version=SCHEMA_VERSION,
            name="[a-z][a-z0-9_]{0,30}",
            limit=Message.MAX_BYTES,
            fields=f"{{{fields[1:]}}}",
            size=len(payload),
            hex="\n".join(payload[start : start + 32].hex(" ") for start in range(0, len(payload), 32)),
        )
    )


def _channel_lines() -> Iterator[str]:
    yield "## Channels"
    yield "| unit / topic | message | published by | rate [Hz] | stale after [s] | priority | purpose |"
    yield "| --- | --- | --- | --- | --- | --- | --- |"
    for row in CHANNELS:
        rate = f"{row.rate_hz:g}" if row.rate_hz else "on events"
        yield (
            f"| {row.unit} / {row.topic} | {_link(row.message)} | {row.publisher} | {rate} "
            f"| {row.stale_after_s:g} | {row.priority} | {purpose(row.message)} |"
        )
    yield ""
    yield f"The encoding of a payload is `{CHANNELS[0].encoding}`, with the topic in the place of `pose`."


def _request_lines(structures: dict[str, type]) -> Iterator[str]:
    yield "## Requests"
    yield (
        "A Zenoh query on `rcopterx/<fleet>/<vehicle>/request/<verb>` with the request as payload. Every "
        "request may carry `source`, the name of its sender (`operator` if left out). The answer to a "
        "malformed one is a Zenoh error with the reason."
    )
    yield ""
    yield "| verb | request | sent by | answered by | reply | purpose |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for verb in VERBS.values():
        yield (
            f"| {verb.name} | {_link(verb.request)} | {verb.asker} | {verb.server} "
            f"| {_link(verb.reply)} | {purpose(verb.request)} |"
        )
    yield ""
    for verb in VERBS.values():
        yield from _section(verb.request, Request, structures)
    replies: list[type[Reply]] = [Reply, *(verb.reply for verb in VERBS.values())]
    for reply in dict.fromkeys(replies):
        yield from _section(reply, Message, structures)


def _structure_lines(structures: dict[str, type]) -> Iterator[str]:
    yield "## Parts of messages"
    done: set[str] = set()
    while structures.keys() - done:
        for name in [name for name in structures if name not in done]:
            done.add(name)
            yield from _section(structures[name], msgspec.Struct, structures)


def _section(kind: type, base: type, structures: dict[str, type]) -> Iterator[str]:
    """Heading, purpose and fields of one type, without the fields of its base."""
    yield f"### {kind.__name__}"
    yield one_line(kind.__doc__ or "")
    yield ""
    inherited = getattr(base, "__struct_fields__", ())
    info = types.type_info(kind)
    tag = getattr(info, "tag_field", None)
    if not tag and not set(getattr(kind, "__struct_fields__", ())).difference(inherited):
        yield "No fields of its own."
        yield ""
        return

    def structure(part: Any) -> str:
        if part.cls is FloatArray:
            return "matrix"
        if not issubclass(part.cls, Message):
            structures[part.cls.__name__] = part.cls
        return _link(part.cls)

    header, rule, *rows = field_table(kind, structure, _default, inherited)
    yield from (header, rule)
    if tag:
        yield f"| `{tag}` | `{getattr(info, 'tag', None)}` | | | which one it is |"
    yield from rows
    yield ""


def field_table(
    kind: type,
    structure: Callable[[Any], str],
    default: Callable[[types.Field], str],
    inherited: Collection[str] = (),
) -> Iterator[str]:
    """Yield the lines of a table of a type's fields; `structure` and `default` return texts of its cells."""
    yield "| field | type | unit | default | meaning |"
    yield "| --- | --- | --- | --- | --- |"
    meanings = meanings_of(kind)
    for field in getattr(types.type_info(kind), "fields", ()):
        if field.name not in inherited:
            unit = next((unit for end, unit in UNITS.items() if field.name.endswith(end)), "")
            yield (
                f"| `{field.name}` | {_type(field.type, structure)} | {unit} | {default(field)} "
                f"| {meanings.get(field.name, '')} |"
            )


def purpose(kind: type) -> str:
    """First paragraph of a type's docstring."""
    return one_line((kind.__doc__ or "").split("\n\n")[0])


def _default(field: types.Field) -> str:
    if field.required:
        return ""
    value = field.default_factory() if field.default is msgspec.NODEFAULT else field.default
    return f"`{json.dumps(msgspec.to_builtins(value)).replace('null', 'nil')}`"


def _link(kind: type) -> str:
    return f"[{kind.__name__}](#{kind.__name__.lower()})"


def _type(kind: Any, structure: Callable[[Any], str]) -> str:

    def text(inner: Any) -> str:
        return _type(inner, structure)

    match kind:
        case types.BoolType():
            return "boolean"
        case types.IntType() | types.FloatType():
            return ("integer" if isinstance(kind, types.IntType) else "float") + _bounds(kind)
        case types.StrType():
            return _text(kind)
        case types.LiteralType():
            return " or ".join(f"`{word}`" for word in kind.values)
        case types.BytesType():
            return "bytes"
        case types.NoneType():
            return "nil"
        case types.AnyType():
            return "anything"
        case types.UnionType():
            return " or ".join(map(text, kind.types))
        case types.TupleType() if len({text(each) for each in kind.item_types}) > 1:
            return f"({', '.join(map(text, kind.item_types))})"
        case types.TupleType():
            return f"{len(kind.item_types)} times {text(kind.item_types[0])}"
        case types.VarTupleType() if kind.min_length == kind.max_length is not None:
            return f"{kind.max_length} times {text(kind.item_type)}"
        case types.VarTupleType() | types.ListType() | types.FrozenSetType():
            return f"array of {text(kind.item_type)}{_length(kind)}"
        case types.DictType():
            return f"map of {text(kind.key_type)} to {text(kind.value_type)}"
        case types.StructType() | types.DataclassType():
            return structure(kind)
    raise TypeError(f"no text for {kind}")


def _text(kind: types.StrType) -> str:
    if kind.pattern is None:
        return "text" if kind.max_length is None else f"text, at most {kind.max_length} characters"
    words = kind.pattern.removeprefix("^").removesuffix("$").strip("()").split("|")
    return "name" if "[" in kind.pattern else " or ".join(f"`{word}`" for word in words)


def _bounds(kind: types.IntType | types.FloatType) -> str:
    """Limits of a number, to be put after its type; empty if there are none but the general ones."""
    low, high = kind.ge if kind.gt is None else kind.gt, kind.le
    low = None if low is not None and -low in GENERAL_LIMITS else low
    high = None if high in GENERAL_LIMITS else high
    strict = "" if kind.gt is None else "above "
    if low is not None and high is not None:
        return f", {strict}{low:g} to {high:g}"
    if low is not None:
        return f", {strict or 'from '}{low:g}"
    return "" if high is None else f", to {high:g}"


def _length(kind: types.VarTupleType | types.ListType | types.FrozenSetType) -> str:
    low = f", at least {kind.min_length}" if kind.min_length else ""
    return low + ("" if kind.max_length is None else f", at most {kind.max_length}")


def meanings_of(kind: type) -> dict[str, str]:
    """Return the documentation of the fields of a type: the strings below them.

    A string that begins with several names, "`low`, `high`: limits of it.", is that of all these fields.
    """
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__[:-1]):
        if base.__module__.partition(".")[0] != "msgspec":
            node = ast.parse(textwrap.dedent(inspect.getsource(base))).body[0]
            found |= dict(_documented(node))
    return found


def _documented(node: ast.stmt) -> Iterator[tuple[str, str]]:
    """Yield fields of a class, and the strings that stand below them in its source."""
    body = node.body if isinstance(node, ast.ClassDef) else []
    for field, below in pairwise(body):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(below, ast.Expr)
            and isinstance(below.value, ast.Constant)
        ):
            text = one_line(str(below.value.value))
            names, _, shared = text.partition(": ")
            if re.fullmatch(r"`\w+`(, `\w+`)+", names):
                yield from ((name.strip("`"), shared[:1].upper() + shared[1:]) for name in names.split(", "))
            else:
                yield field.target.id, text


def one_line(text: str) -> str:
    """Text of a docstring without its line breaks."""
    return " ".join(inspect.cleandoc(text).split())


if __name__ == "__main__":
    print(reference(), end="")
