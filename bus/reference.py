"""Writes the reference of channels, messages and requests: `python -m bus.reference > docs/messages.md`.

Everything in it is read from the tables and from the message types, so that it cannot say anything else.
"""

import ast
import inspect
import json
import struct
from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Any, Final

import msgpack
import msgspec
from msgspec import inspect as types

from bus import channels, messages
from bus.channels import CHANNELS
from bus.messages import FloatArray, Message
from bus.requests import VERBS, Reply, Request

UNITS: Final = {
    "_m_s": "m/s",
    "_ms_p50": "ms",
    "_ms_p99": "ms",
    "_ms_max": "ms",
    "_us": "us",
    "_ms": "ms",
    "_hz": "Hz",
    "_rad": "rad",
    "_m": "m",
    "_s": "s",
}
"""Units by the end of a field's name; the first that fits counts."""

EXAMPLE: Final[dict[str, Any]] = {
    "schema_version": 1,
    "epoch": 1700000000000,
    "frame": 4711,
    "source": "h1",
    "sequence": 1,
    "input": [0.0, 0.0, 0.55, 0.0],
    "next_inputs": {"shape": [1, 4], "data": struct.pack("<4d", 0.0, 0.0, 0.55, 0.0)},
    "period_s": 0.02,
}
"""A stick command as another program would write it."""

_HEAD: Final = """\
# Messages on the bus

Generated from `bus/channels.py`, `bus/messages.py` and `bus/requests.py` by `python -m bus.reference`.

Any program with [Zenoh](https://zenoh.io) and [MessagePack](https://msgpack.org) can take part: connect as a
Zenoh *client* to the router of its host, put and subscribe to the keys below.

- Keys are `rcopterx/<fleet>/<unit>/<topic>`; a unit is a vehicle or one of {units}.
  Nobody puts on wildcard keys: such messages are refused.
- A payload is one MessagePack map, field names as keys. Fields with a default may be left out, unknown fields
  are ignored, fields are only ever appended. `schema_version` is {version}.
- SI units; the end of a name is the unit. Positions are in the inertial frame of the motion capture, z up.
  Yaw counts turns. An input is (pitch, roll, thrust, yaw), normalised sticks from -1 to 1, thrust from 0.
- A name is `{name}`; every number is finite. A message is at most {size} bytes.
  Whatever breaks a rule is refused, counted, and shown in the status of the receiver.
- A matrix is a map of `shape` (rows, columns) and `data`: 64-bit little-endian floats, row by row.
- `epoch` and `frame` come from the newest pose: the Tracker's frame number is the fleet's clock. No clocks of
  two hosts are ever compared.
- Put with congestion control *drop*, not express, priority as in the table.
"""

_EXAMPLE: Final = """\
## A controller in another language
Subscribe to `rcopterx/<fleet>/h1/pose`; for every pose put a command on `rcopterx/<fleet>/h1/command`. The
transmitter gateway obeys it once the vehicle is armed for its source: request `arm` with `lease` equal to the
command's `source`, after half a second of commands with thrust 0. `sequence` must grow with every command,
also over restarts; a wall clock in milliseconds is a good start. `next_inputs` are played when commands are
late. A command as a map:

```
{fields}
```

and its {size} bytes of MessagePack:

```
{hex}
```
"""


def reference() -> str:
    """Text of `docs/messages.md`."""
    structures: dict[str, type] = {}
    body = [*_channel_lines(), "", *_message_lines(structures), *_request_lines(structures)]
    return "\n".join([_head(), _example(), *body, *_structure_lines(structures)]).rstrip() + "\n"


def _head() -> str:
    fixed = (channels.TRACKER_UNIT, channels.SIMULATOR_UNIT, channels.FLEET_UNIT)
    return _HEAD.format(
        units=", ".join(f"`{unit}`" for unit in fixed),
        version=messages.SCHEMA_VERSION,
        name="[a-z][a-z0-9_]{0,30}",
        size=Message.MAX_BYTES,
    )


def _example() -> str:
    payload = bytes(msgpack.packb(EXAMPLE))
    shown = EXAMPLE | {"next_inputs": EXAMPLE["next_inputs"] | {"data": "<32 bytes>"}}
    fields = ",\n".join(f" {json.dumps(name)}: {json.dumps(value)}" for name, value in shown.items())
    return _EXAMPLE.format(
        fields=f"{{{fields[1:]}}}",
        size=len(payload),
        hex="\n".join(payload[start : start + 32].hex(" ") for start in range(0, len(payload), 32)),
    )


def _channel_lines() -> Iterator[str]:
    yield "## Channels"
    yield "| unit / topic | message | written by | rate [Hz] | stale after [s] | priority | what for |"
    yield "| --- | --- | --- | --- | --- | --- | --- |"
    for row in CHANNELS:
        rate = f"{row.rate_hz:g}" if row.rate_hz else "on events"
        yield (
            f"| {row.unit} / {row.topic} | {_link(row.message)} | {row.publisher} | {rate} "
            f"| {row.stale_after_s:g} | {row.priority} | {row.purpose} |"
        )
    yield ""
    yield f"The encoding of a payload is `{CHANNELS[0].encoding}`, with the topic in the place of `pose`."


def _message_lines(structures: dict[str, type]) -> Iterator[str]:
    yield "## Messages"
    for row in CHANNELS:
        yield from _section(row.message, Message, structures)


def _request_lines(structures: dict[str, type]) -> Iterator[str]:
    yield "## Requests"
    yield (
        "A Zenoh query on `rcopterx/<fleet>/<vehicle>/request/<verb>` with the request as payload. Every "
        "request may carry `source`, the name of who asks (`operator` if left out). A malformed one is "
        "answered by a Zenoh error with the reason."
    )
    yield ""
    yield "| verb | request | answered by | reply | what for |"
    yield "| --- | --- | --- | --- | --- |"
    for verb in VERBS.values():
        yield (
            f"| {verb.name} | {_link(verb.request)} | {verb.server} | {_link(verb.reply)} | {verb.purpose} |"
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
    yield _one_line(kind.__doc__ or "")
    yield ""
    inherited = set(getattr(base, "__struct_fields__", ()))
    documents = _field_documents(kind)
    info = types.type_info(kind)
    own = [field for field in getattr(info, "fields", ()) if field.name not in inherited]
    tag = getattr(info, "tag_field", None)
    if not own and not tag:
        yield "No fields of its own."
        yield ""
        return
    yield "| field | type | unit | default | meaning |"
    yield "| --- | --- | --- | --- | --- |"
    if tag:
        yield f"| `{tag}` | `{getattr(info, 'tag', None)}` | | | which one it is |"
    for field in own:
        described = _type(field.type, structures)
        default = "" if field.required else f"`{_default(field)}`"
        meaning = documents.get(field.name, "")
        yield f"| `{field.name}` | {described} | {_unit(field.name)} | {default} | {meaning} |"
    yield ""


def _default(field: types.Field) -> str:
    value = field.default_factory() if field.default is msgspec.NODEFAULT else field.default
    return json.dumps(msgspec.to_builtins(value)).replace("null", "nil")


def _unit(name: str) -> str:
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), "")


def _link(kind: type) -> str:
    return f"[{kind.__name__}](#{kind.__name__.lower()})"


def _type(kind: Any, structures: dict[str, type]) -> str:
    """A field's type as text."""
    match kind:
        case types.BoolType():
            return "boolean"
        case types.IntType() | types.FloatType():
            return ("integer" if isinstance(kind, types.IntType) else "float") + _bounds(kind)
        case types.StrType():
            return _text(kind)
        case types.BytesType():
            return "bytes"
        case types.NoneType():
            return "nil"
        case types.UnionType():
            return " or ".join(_type(member, structures) for member in kind.types)
        case types.TupleType():
            return f"{len(kind.item_types)} times {_type(kind.item_types[0], structures)}"
        case types.VarTupleType():
            return f"array of {_type(kind.item_type, structures)}{_length(kind)}"
        case types.DictType():
            return f"map of {_type(kind.key_type, structures)} to {_type(kind.value_type, structures)}"
        case types.StructType() if kind.cls is FloatArray:
            return "matrix"
        case types.StructType():
            if not issubclass(kind.cls, Message):
                structures[kind.cls.__name__] = kind.cls
            return _link(kind.cls)
    raise TypeError(f"no text for {kind}")


def _text(kind: types.StrType) -> str:
    if kind.pattern is None:
        return "text" if kind.max_length is None else f"text, at most {kind.max_length} characters"
    words = kind.pattern.removeprefix("^").removesuffix("$").strip("()").split("|")
    return "name" if "[" in kind.pattern else " or ".join(f"`{word}`" for word in words)


def _bounds(kind: types.IntType | types.FloatType) -> str:
    low, high = kind.ge if kind.gt is None else kind.gt, kind.le
    strict = "" if kind.gt is None else "above "
    if low is not None and high is not None:
        return f", {strict}{low:g} to {high:g}"
    if low is not None:
        return f", {strict or 'from '}{low:g}"
    return "" if high is None else f", to {high:g}"


def _length(kind: types.VarTupleType) -> str:
    low = f", at least {kind.min_length}" if kind.min_length else ""
    return low + ("" if kind.max_length is None else f", at most {kind.max_length}")


def _field_documents(kind: type) -> dict[str, str]:
    """The strings that stand below fields in the source, by field."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        if issubclass(base, msgspec.Struct) and base.__module__.startswith("bus."):
            found |= dict(_documented(ast.parse(inspect.getsource(base)).body[0]))
    return found


def _documented(node: ast.stmt) -> Iterable[tuple[str, str]]:
    body = node.body if isinstance(node, ast.ClassDef) else []
    for field, below in pairwise(body):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(below, ast.Expr)
            and isinstance(below.value, ast.Constant)
        ):
            yield field.target.id, _one_line(str(below.value.value))


def _one_line(text: str) -> str:
    return " ".join(inspect.cleandoc(text).split())


if __name__ == "__main__":
    print(reference(), end="")
