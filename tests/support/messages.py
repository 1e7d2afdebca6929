"""Hypothesis strategies for the maps of messages, built from the message types themselves."""

import math
from typing import Any

import msgspec
import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from msgspec import inspect
from numpy.typing import NDArray

from rcopterx.bus import channels, requests
from rcopterx.bus.log_messages import AgentSteps
from rcopterx.bus.message import FloatArray, Message
from rcopterx.bus.messages import MAX_NEXT_INPUTS, Pose
from rcopterx.bus.trajectory_array import PLAN_COLUMNS, TrajectoryArray

MESSAGE_TYPES: tuple[type[Message], ...] = (
    *(channel.message for channel in channels.CHANNELS),
    *(verb.request for verb in requests.VERBS.values()),
    requests.Reply,
    requests.RecallReply,
)
"""Everything that travels."""

COLUMNS = {
    "next_inputs": (0, MAX_NEXT_INPUTS, 4),
    "reference": (1, 6, PLAN_COLUMNS),
    "inputs": (1, 6, 4),
    "knots": (2, 6, requests.KNOT_COLUMNS),
    "path": (2, 6, requests.KNOT_COLUMNS),
    "rest": (2, 6, requests.KNOT_COLUMNS),
}
"""Fewest rows, most rows and columns of the matrices, by field."""


def wire_maps(message_type: type[Message]) -> st.SearchStrategy[dict[str, Any]]:
    """Valid MessagePack maps of a message."""
    maps = _struct(inspect.type_info(message_type))
    if message_type is Pose:
        return maps.map(_as_pose)
    if message_type is requests.Fly:
        return maps.map(_as_fly)
    if message_type is AgentSteps:
        return maps.map(_as_steps)
    return maps


def valid_messages(message_type: type[Message]) -> st.SearchStrategy[Message]:
    """Valid messages of a type."""
    return wire_maps(message_type).map(lambda plain: msgspec.convert(plain, message_type))


def _as_pose(plain: dict[str, Any]) -> dict[str, Any]:
    """Occluded without, seen with a position and a unit quaternion."""
    if plain["occluded"]:
        return plain | {"position_m": None, "quaternion_xyzw": None}
    half_rad = plain["latency_s"]
    return plain | {
        "position_m": plain["position_m"] or [0.1, -0.2, 0.3],
        "quaternion_xyzw": [0.0, 0.0, math.sin(half_rad), math.cos(half_rad)],
    }


def _as_fly(plain: dict[str, Any]) -> dict[str, Any]:
    """Times that increase from 0 on, at rest at both ends."""
    rows, columns = plain["knots"]["shape"]
    knots = np.frombuffer(plain["knots"]["data"]).reshape(rows, columns).copy()
    knots[:, 0] = np.linspace(0.0, 1.0 + 0.1 * rows, rows)
    knots[[0, -1], 5:] = 0.0
    return plain | {"knots": {"shape": [rows, columns], "data": knots.tobytes()}}


def _as_steps(plain: dict[str, Any]) -> dict[str, Any]:
    """As many inputs as there are in every column; all of the last step, and so is what was given up."""
    columns = "keys", "subscriptions", "checksums", "arrivals_s"
    inputs = min(len(plain[column]) for column in columns) if plain["times_s"] else 0
    counts = [0] * len(plain["times_s"])
    counts[-1:] = [inputs] * len(counts[-1:])
    steps = len(counts)
    overtime = [[steps - 1, *given_up] for _, *given_up in plain["overtime"]] if steps else []
    inputs_of = {column: plain[column][:inputs] for column in columns}
    return plain | inputs_of | {"counts": counts, "overtime": overtime}


def _packed(samples: NDArray[np.float64]) -> dict[str, Any]:
    packed = TrajectoryArray.of(samples)
    return {"offset": list(packed.offset), "scale": list(packed.scale), "data": packed.data}


def _struct(kind: Any) -> st.SearchStrategy[dict[str, Any]]:
    tag = {} if kind.tag_field is None else {kind.tag_field: st.just(kind.tag)}
    return st.fixed_dictionaries(
        tag | {field.name: _matrix_or_value(field.name, field.type) for field in kind.fields}
    )


def _matrix_or_value(name: str, kind: Any) -> st.SearchStrategy[Any]:
    members = kind.types if isinstance(kind, inspect.UnionType) else (kind,)
    if any(isinstance(member, inspect.StructType) and member.cls is FloatArray for member in members):
        low, high, columns = COLUMNS[name]
        return _optional(kind, _matrices(low, high, columns))
    if any(isinstance(member, inspect.StructType) and member.cls is TrajectoryArray for member in members):
        # All trajectories of a message have equally many stages.
        return _optional(kind, st.shared(st.integers(2, 6), key="stages").flatmap(_trajectory))
    if name == "start_s":
        return st.floats(-1, 1)
    if name in ("position_m", "quaternion_xyzw"):
        return _optional(kind, st.lists(st.floats(-100, 100), min_size=3, max_size=3))
    return _value(kind)


def _optional(kind: Any, values: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    return st.none() | values if isinstance(kind, inspect.UnionType) else values


def _matrices(low: int, high: int, columns: int) -> st.SearchStrategy[dict[str, Any]]:
    return st.integers(low, high).flatmap(lambda rows: _matrix(rows, columns))


def _matrix(rows: int, columns: int) -> st.SearchStrategy[dict[str, Any]]:

    return arrays(np.dtype("<f8"), (rows, columns), elements=st.floats(-1e6, 1e6)).map(
        lambda values: {"shape": [rows, columns], "data": values.tobytes()}
    )


def _trajectory(stages: int) -> st.SearchStrategy[dict[str, Any]]:
    values = arrays(np.float64, (stages, PLAN_COLUMNS), elements=st.floats(-1e3, 1e3))
    return values.map(_packed)


def _value(kind: Any) -> st.SearchStrategy[Any]:
    match kind:
        case inspect.BoolType():
            return st.booleans()
        case inspect.IntType():
            return st.integers(kind.ge or 0, 2**40 if kind.le is None else min(kind.le, 2**40))
        case inspect.FloatType():
            low = kind.gt if kind.ge is None else kind.ge
            return st.floats(
                -1e9 if low is None else low,
                1e9 if kind.le is None else kind.le,
                exclude_min=kind.gt is not None,
            )
        case inspect.BytesType():
            fewest = kind.min_length or 0
            return st.binary(min_size=fewest, max_size=max(20, fewest))
        case inspect.StrType(pattern=str() as pattern):
            return st.from_regex(pattern, fullmatch=True).filter(lambda text: not text.endswith("\n"))
        case inspect.StrType():
            return st.text(min_size=kind.min_length or 0, max_size=20)
        case inspect.LiteralType():
            return st.sampled_from(kind.values)
        case inspect.NoneType():
            return st.none()
        case inspect.UnionType():
            return st.one_of([_value(member) for member in kind.types])
        case inspect.TupleType():
            return st.tuples(*map(_value, kind.item_types)).map(list)
        case inspect.VarTupleType():
            return st.lists(_value(kind.item_type), min_size=kind.min_length or 0, max_size=3)
        case inspect.DictType():
            return st.dictionaries(_value(kind.key_type), _value(kind.value_type), max_size=3)
        case inspect.StructType():
            return _struct(kind)
    raise TypeError(f"no strategy for {kind}")
