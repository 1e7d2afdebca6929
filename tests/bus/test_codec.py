"""Promises of the message coding: valid messages survive, others are refused with a kind and a reason."""

import math
import struct
from typing import Any

import msgpack
import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import inspect
from support.messages import MESSAGE_TYPES, valid_messages, wire_maps

from rcopterx.bus.codec import RejectedError, decode, encode
from rcopterx.bus.host_messages import LaboratoryState, LaboratoryVehicle
from rcopterx.bus.message import LONGEST_PERIOD_S, MAX_COUNT, SHORTEST_PERIOD_S, FloatArray, Message
from rcopterx.bus.messages import (
    MAX_NEXT_INPUTS,
    MAX_STAGES,
    AgentStatus,
    Applied,
    Command,
    Kill,
    Plan,
    Pose,
)
from rcopterx.bus.requests import GoTo, TakeOff

message_types = st.sampled_from(MESSAGE_TYPES)

POSE: dict[str, Any] = {
    "schema_version": 1,
    "epoch": 1,
    "frame": 2,
    "period_s": 0.02,
    "latency_s": 0.004,
    "received_s": 12.5,
    "occluded": False,
    "position_m": [0.1, 0.2, 0.3],
    "quaternion_xyzw": [0.0, 0.0, 0.0, 1.0],
    "quality": 0.9,
}
COMMAND: dict[str, Any] = {
    "epoch": 1,
    "frame": 2,
    "lease": 1,
    "sequence": 3,
    "input": [0.0, 0.0, 0.5, 0.0],
    "next_inputs": {"shape": [1, 4], "data": bytes(32)},
    "period_s": 0.02,
}
TRAJECTORY: dict[str, Any] = {"offset": 12 * [0.0], "scale": 12 * [1e-3], "data": bytes(48)}
PLAN: dict[str, Any] = {
    "epoch": 1,
    "frame": 2,
    "source": "h1",
    "ancestors": [],
    "period_s": 0.02,
    "start_s": 0.02,
    "trajectory": TRAJECTORY,
}
APPLIED: dict[str, Any] = {
    "state": "armed",
    "input": [0.0, 0.0, 0.5, 0.0],
    "pulse_width_us": [1500.0],
    "epoch": 0,
    "frame": 0,
    "sequence": 0,
    "fresh": True,
}


def refusal(plain: object, message_type: type[Message]) -> RejectedError:
    payload = plain if isinstance(plain, bytes) else msgpack.packb(plain)
    with pytest.raises(RejectedError) as caught:
        decode(payload, message_type)
    return caught.value


Path = tuple[str | int, ...]


def floats_in(value: object, path: Path = ()) -> dict[Path, float]:
    """Every float of a message, by the keys that lead to it."""
    if isinstance(value, float):
        return {path: value}
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return {place: number for key, item in items for place, number in floats_in(item, (*path, key)).items()}


def replaced(value: Any, path: Path, number: float) -> Any:
    """The message with another number in one place."""
    if not path:
        return number
    changed = value.copy()
    changed[path[0]] = replaced(value[path[0]], path[1:], number)
    return changed


@settings(max_examples=40, deadline=None)
@given(st.data(), message_types)
def test_every_message_survives_encoding_and_decoding(
    data: st.DataObject, message_type: type[Message]
) -> None:
    message = data.draw(valid_messages(message_type))
    assert decode(encode(message), message_type) == message


@settings(max_examples=40, deadline=None)
@given(st.data(), message_types)
def test_fields_unknown_to_this_version_are_ignored(data: st.DataObject, message_type: type[Message]) -> None:
    plain = data.draw(wire_maps(message_type))
    future = plain | {"schema_version": 7, "field_of_a_later_version": {"x": [1, "a", None]}}
    known = decode(msgpack.packb(plain | {"schema_version": 7}), message_type)
    assert decode(msgpack.packb(future), message_type) == known


@settings(max_examples=40, deadline=None)
@given(st.data(), message_types, st.data())
def test_truncated_messages_are_refused(
    data: st.DataObject, message_type: type[Message], cut: st.DataObject
) -> None:
    payload = encode(data.draw(valid_messages(message_type)))
    error = refusal(payload[: cut.draw(st.integers(0, len(payload) - 1))], message_type)
    assert error.kind == "malformed"


def has_required_fields(message_type: type[Message]) -> bool:
    """Any map is a valid request of a type without required fields, an empty one too."""
    return any(field.required for field in msgspec.structs.fields(message_type))


@settings(max_examples=40, deadline=None)
@given(st.binary(max_size=300), message_types.filter(has_required_fields))
def test_garbage_is_refused_and_nothing_else_is_raised(payload: bytes, message_type: type[Message]) -> None:
    assert refusal(payload, message_type).kind in ("malformed", "type", "value")


@settings(max_examples=40, deadline=None)
@given(st.data(), message_types)
def test_a_flipped_byte_is_refused_or_gives_a_finite_message(
    data: st.DataObject, message_type: type[Message]
) -> None:
    payload = bytearray(encode(data.draw(valid_messages(message_type))))
    payload[data.draw(st.integers(0, len(payload) - 1))] ^= data.draw(st.integers(1, 255))
    kinds: tuple[str, ...] = ()
    try:
        numbers = floats_in(msgpack.unpackb(encode(decode(bytes(payload), message_type))))
    except RejectedError as error:
        kinds, numbers = (error.kind,), {}
    assert set(kinds) <= {"malformed", "type", "value"}
    assert all(map(math.isfinite, numbers.values()))


@settings(max_examples=100, deadline=None)
@given(data=st.data(), message_type=message_types, number=st.sampled_from([math.nan, math.inf, -math.inf]))
def test_numbers_that_are_not_finite_are_refused_wherever_they_stand(
    number: float, data: st.DataObject, message_type: type[Message]
) -> None:
    plain = data.draw(wire_maps(message_type))
    places = [("schema_version",), *floats_in(plain)]
    wrong = replaced(plain | {"schema_version": 1}, data.draw(st.sampled_from(places)), number)
    assert refusal(wrong, message_type).kind == "type"


def numbers_of(kind: Any) -> list[Any]:
    """Every type of a number in a type, at any depth; a map's keys are none."""
    if isinstance(kind, inspect.IntType | inspect.FloatType):
        return [kind]
    parts: list[Any] = []
    for name in ("fields", "types", "item_types"):
        parts += getattr(kind, name, ())
    for name in ("type", "item_type", "value_type"):
        parts += [getattr(kind, name)] if hasattr(kind, name) else []
    return [number for part in parts for number in numbers_of(part)]


@pytest.mark.parametrize("message_type", MESSAGE_TYPES)
def test_every_number_is_bounded_by_its_type_which_refuses_nan_and_infinity(
    message_type: type[Message],
) -> None:
    for field in inspect.type_info(message_type).fields:  # type: ignore[attr-defined]  # of structs
        for number in numbers_of(field):
            assert number.ge is not None or number.gt is not None, field.name
            assert number.le is not None, field.name


def test_counters_up_to_the_exact_integers_of_floats_are_accepted() -> None:
    assert decode(msgpack.packb(POSE | {"epoch": MAX_COUNT, "frame": MAX_COUNT}), Pose).epoch == MAX_COUNT


@given(st.floats())
def test_a_period_of_a_command_that_is_accepted_is_one_of_control(period_s: float) -> None:
    payload = msgpack.packb(COMMAND | {"period_s": period_s})
    if SHORTEST_PERIOD_S <= period_s <= LONGEST_PERIOD_S:
        assert decode(payload, Command).period_s == period_s
    else:
        assert refusal(payload, Command).kind == "type"


@pytest.mark.parametrize("message_type", MESSAGE_TYPES)
def test_oversize_messages_are_refused_before_they_are_unpacked(message_type: type[Message]) -> None:
    error = refusal(b"\xc1" * (message_type.MAX_BYTES + 1), message_type)
    assert error.kind == "size"
    assert str(message_type.MAX_BYTES) in str(error)


def test_the_longest_allowed_plan_fits_into_a_message() -> None:
    plain = PLAN | {"trajectory": TRAJECTORY | {"data": bytes(24 * MAX_STAGES)}}
    assert decode(msgpack.packb(plain), Plan).trajectory.to_numpy().shape == (MAX_STAGES, 12)


def test_the_state_of_a_laboratory_with_a_hundred_vehicles_fits_into_a_message() -> None:
    frames = 2 * ((1000.5, *8 * (1500.25,)),)  # more than one arrives between two messages
    vehicle = LaboratoryVehicle(
        position_m=(0.1, 0.2, 0.3), yaw_rad=0.1, velocity_m_s=(0.1, 0.2, 0.3), on_floor=False, outside=False,
        touchdown_speed_m_s=0.3, touchdowns=1, radio=frames,
    )  # fmt: skip
    state = LaboratoryState(frame=1, sent_s=1.0, vehicles={f"h{number}": vehicle for number in range(100)})
    assert decode(encode(state), LaboratoryState) == state


@pytest.mark.parametrize(
    ("message_type", "plain", "word"),
    [
        (Pose, POSE | {"frame": "2"}, "frame"),
        (Pose, POSE | {"frame": -1}, "frame"),
        (Pose, POSE | {"frame": 2.5}, "frame"),
        (Pose, POSE | {"occluded": 0}, "occluded"),
        (Pose, POSE | {"position_m": [0.0, 0.0]}, "position_m"),
        (Pose, POSE | {"position_m": None, "quality": 1.5}, "quality"),
        (Pose, POSE | {"period_s": 0.0}, "period_s"),
        (Pose, POSE | {"period_s": 1e-300}, "period_s"),
        (Pose, POSE | {"position_m": [0.0, 0.0, 1e6]}, "position_m"),
        (Pose, POSE | {"epoch": MAX_COUNT + 1}, "epoch"),
        (Pose, POSE | {"frame": 2**64 - 1}, "frame"),
        (Command, COMMAND | {"sequence": MAX_COUNT + 1}, "sequence"),
        (Command, COMMAND | {"period_s": 3e-8}, "period_s"),
        (Command, COMMAND | {"period_s": 5e-324}, "period_s"),
        (Command, COMMAND | {"next_inputs": {"shape": [-1, 4], "data": b""}}, "shape"),
        (Plan, PLAN | {"start_s": 3.0}, "start_s"),
        (Pose, {key: value for key, value in POSE.items() if key != "epoch"}, "epoch"),
        (Pose, POSE | {"schema_version": 0}, "schema_version"),
        (Command, COMMAND | {"lease": "1"}, "lease"),
        (Command, COMMAND | {"lease": -1}, "lease"),
        (Plan, PLAN | {"source": "H 1/.."}, "source"),
        (Plan, PLAN | {"source": "h1/command"}, "source"),
        (Command, COMMAND | {"input": [0.0, 0.0, 0.5]}, "input"),
        (Command, COMMAND | {"next_inputs": [0.0]}, "next_inputs"),
        (Command, COMMAND | {"next_inputs": {"shape": [1, 4], "data": "text"}}, "data"),
        (Plan, PLAN | {"ancestors": ["h1"] * 65}, "ancestors"),
        (Applied, APPLIED | {"state": "asleep"}, "state"),
        (Applied, APPLIED | {"input": [0.0, 0.0, 1e300, 0.0]}, "input"),
        (TakeOff, {"height_m": 50.0}, "height_m"),
        (GoTo, {"set_point": {"position_m": [0.0, 0.0, 1e4], "yaw_rad": 0.0}}, "position_m"),
        (GoTo, {"set_point": {"position_m": [0.0, 0.0, 1.0], "yaw_rad": 1e300}}, "yaw_rad"),
        (Kill, {"source": "gcs", "reason": "x" * 401}, "reason"),
    ],
)
def test_wrong_types_are_refused_and_the_field_is_named(
    message_type: type[Message], plain: dict[str, Any], word: str
) -> None:
    error = refusal(plain, message_type)
    assert error.kind == "type"
    assert word in str(error)


@pytest.mark.parametrize(
    ("message_type", "plain", "word"),
    [
        (Pose, POSE | {"occluded": True}, "occluded"),
        (Pose, POSE | {"position_m": None}, "missing"),
        (Pose, POSE | {"quaternion_xyzw": None}, "missing"),
        (Pose, POSE | {"quaternion_xyzw": [0.0, 0.0, 0.0, 0.0]}, "norm"),
        (Pose, POSE | {"quaternion_xyzw": [0.0, 0.0, 1e5, 1e5]}, "norm"),
    ],
)
def test_values_that_make_no_sense_are_refused_and_the_field_is_named(
    message_type: type[Message], plain: dict[str, Any], word: str
) -> None:
    error = refusal(plain, message_type)
    assert error.kind == "value"
    assert word in str(error)


@pytest.mark.parametrize(
    ("shape", "size"),
    [
        ([1, 4], 31),
        ([1, 4], 33),
        ([2, 4], 32),
        ([0, 4], 32),
        ([4, 1], 32),
        ([1, 5], 40),
        ([MAX_NEXT_INPUTS + 1, 4], 32 * (MAX_NEXT_INPUTS + 1)),
        ([2**40, 4], 32),
        ([2**53, 4], 0),
    ],
)
def test_arrays_that_lie_about_their_shape_are_refused(shape: list[int], size: int) -> None:
    error = refusal(COMMAND | {"next_inputs": {"shape": shape, "data": bytes(size)}}, Command)
    assert error.kind == "value"
    assert "next_inputs" in str(error)


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, 1e300, -1.001e6])
def test_arrays_with_numbers_no_controller_can_use_are_refused(number: float, place: int) -> None:
    data = bytearray(32)
    struct.pack_into("<d", data, 8 * place, number)
    error = refusal(COMMAND | {"next_inputs": {"shape": [1, 4], "data": bytes(data)}}, Command)
    assert error.kind == "value"
    assert "next_inputs" in str(error)


@pytest.mark.parametrize(
    "wrong",
    [
        {"data": bytes(24)}, {"data": bytes(47)}, {"data": bytes(24 * (MAX_STAGES + 1))},
        {"scale": 12 * [0.0]}, {"scale": 12 * [-1e-3]}, {"scale": 12 * [1e5]},
    ],
)  # fmt: skip
def test_plans_that_are_no_trajectory_are_refused(wrong: dict[str, Any]) -> None:
    assert refusal(PLAN | {"trajectory": TRAJECTORY | wrong}, Plan).kind == "value"


@pytest.mark.parametrize(
    "wrong", [{"scale": 11 * [1e-3]}, {"offset": 12 * [1e9]}, {"offset": "text"}, {"data": None}]
)
def test_trajectories_of_other_types_are_refused(wrong: dict[str, Any]) -> None:
    assert refusal(PLAN | {"trajectory": TRAJECTORY | wrong}, Plan).kind == "type"


@pytest.mark.parametrize(
    "payload", [b"", b"\xc0", msgpack.packb([1, 2]), msgpack.packb("text"), msgpack.packb(7)]
)
@pytest.mark.parametrize("message_type", MESSAGE_TYPES)
def test_payloads_that_are_no_map_are_refused(payload: bytes, message_type: type[Message]) -> None:
    assert refusal(payload, message_type).kind in ("malformed", "type")


def test_timestamps_and_extension_types_are_refused_where_a_number_belongs() -> None:
    for foreign in (msgpack.Timestamp(1), msgpack.ExtType(5, b"abc")):
        assert refusal(POSE | {"frame": foreign}, Pose).kind == "type"


@pytest.mark.parametrize("container", [b"\x91", b"\x81\xa1a"])
def test_an_unknown_field_without_a_bottom_is_refused(container: bytes) -> None:
    head = msgpack.packb(POSE | {"extra": None})[:-1]
    assert refusal(head + 9000 * container + b"\xc0", Pose).kind == "malformed"


def test_bytes_that_look_like_a_number_that_is_not_finite_are_none() -> None:
    data = b"\xcb\x7f\xf0" + bytes(29)
    message = decode(msgpack.packb(COMMAND | {"next_inputs": {"shape": [1, 4], "data": data}}), Command)
    assert message.next_inputs == FloatArray((1, 4), data)


def test_bottomless_nesting_is_refused() -> None:
    assert refusal(b"\x91" * 20_000, Pose).kind == "type"


@settings(deadline=None)
@given(st.integers(0, 20), st.integers(1, 12), st.randoms(use_true_random=False))
def test_matrices_survive_the_bus(rows: int, columns: int, random: Any) -> None:
    values = np.array([[random.uniform(-1e3, 1e3) for _ in range(columns)] for _ in range(rows)])
    values = values.reshape(rows, columns)
    packed = FloatArray.of(values)
    packed.check("x", columns, max_rows=20)
    assert np.array_equal(packed.to_numpy(), values)
    assert packed.rows() == [tuple(row) for row in values.tolist()]
    assert not packed.to_numpy().flags.writeable


def test_matrices_travel_in_little_endian_rows_whatever_the_memory_layout() -> None:
    values = np.array([[1.0, 2.0], [3.0, 4.0]])
    expected = struct.pack("<4d", 1.0, 2.0, 3.0, 4.0)
    assert FloatArray.of(values).data == expected
    assert FloatArray.of(np.asfortranarray(values)).data == expected
    assert FloatArray.of(values.astype(">f8").astype(np.float64)).data == expected


def test_a_status_of_a_vehicle_that_was_never_seen_survives() -> None:
    plain = {
        "phase": "ground", "epoch": 0, "frame": 0, "set_point": {"position_m": [0, 0, 0], "yaw_rad": 0},
        "diagnostics": {"controller": "paper", "estimator": "kalman", "horizon": 50},
    }  # fmt: skip
    status = decode(msgpack.packb(plain), AgentStatus)
    assert status.position_m is None
    assert decode(encode(status), AgentStatus) == status
