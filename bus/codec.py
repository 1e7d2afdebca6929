"""MessagePack coding of messages; what is not a valid message is rejected with a reason."""

import math
from typing import Final, TypeVar

import msgspec

from rcopterx.bus.message import InvalidMessageError, Message

M = TypeVar("M", bound=Message)

MAX_DEPTH: Final = 8

_ENCODER: Final = msgspec.msgpack.Encoder()


class RejectedError(ValueError):
    """A payload that is not a valid message; `kind` is `size`, `malformed`, `type` or `value`."""

    def __init__(self, kind: str, detail: str) -> None:
        super().__init__(detail)
        self.kind = kind


def encode(message: Message) -> bytes:
    """Pack a message as a MessagePack map of its fields."""
    return _ENCODER.encode(message)


def decode(payload: bytes, message_type: type[M]) -> M:
    """Unpack and validate a message; every number in it is finite.

    Raises
    ------
    RejectedError
        Too large, not MessagePack, wrong types or missing fields, or values that the message forbids.
    """
    if len(payload) > message_type.MAX_BYTES:
        raise RejectedError("size", f"{len(payload)} bytes, at most {message_type.MAX_BYTES} are allowed")
    try:
        plain = msgspec.msgpack.decode(payload)
    except (msgspec.MsgspecError, ValueError, OverflowError, RecursionError) as error:
        raise RejectedError("malformed", f"not MessagePack: {error}") from None
    if not _finite(plain, MAX_DEPTH):
        raise RejectedError("value", "a number is not finite, or the message is nested too deeply")
    try:
        message = msgspec.convert(plain, message_type, builtin_types=(bytes,))
    except (msgspec.ValidationError, OverflowError) as error:
        raise RejectedError("type", str(error)) from None
    try:
        message.check()
    except InvalidMessageError as error:
        raise RejectedError("value", str(error)) from None
    return message


def _finite(value: object, depth: int) -> bool:
    """Whether every number is finite and no container lies deeper than `depth`."""
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        return depth > 0 and all(_finite(item, depth - 1) for item in value)
    return True
