"""MessagePack coding of messages. Anything that is not a valid message is refused with a reason."""

import math
import re
from functools import cache
from typing import Final, TypeVar

import msgpack
import msgspec

from rcopterx.bus.message import InvalidMessageError, Message

M = TypeVar("M", bound=Message)

MAX_DEPTH = 8

_ENCODER = msgspec.msgpack.Encoder()
_DOUBLE_NOT_FINITE: Final = re.compile(rb"\xcb[\x7f\xff][\xf0-\xff]").search
_SINGLE_NOT_FINITE: Final = re.compile(rb"\xca[\x7f\xff][\x80-\xff]").search
"""How every infinity and every NaN of MessagePack begins, as may other bytes: its type, sign and exponent.

Two expressions: each is searched for by its first byte, several times as fast as both at once.
"""

_REFUSED: Final = (msgspec.MsgspecError, ValueError, OverflowError, RecursionError)
"""What msgspec raises for a payload that is not a message of a type."""


class RejectedError(ValueError):
    """A payload that is not a valid message of its channel.

    Attributes
    ----------
    kind
        Short name to count by: `size`, `malformed`, `type`, `value`.
    """

    def __init__(self, kind: str, detail: str) -> None:
        super().__init__(detail)
        self.kind = kind


def encode(message: Message) -> bytes:
    """Pack a message as a MessagePack map of its fields."""
    return _ENCODER.encode(message)


def decode(payload: bytes, message_type: type[M]) -> M:
    """Unpack and validate a message.

    Parameters
    ----------
    payload
        Bytes from the bus.
    message_type
        Type the channel carries.

    Returns
    -------
    M
        The message; every number in it is finite.

    Raises
    ------
    RejectedError
        Too large, not MessagePack, wrong types or missing fields, or values that make no sense.
    """
    if len(payload) > message_type.MAX_BYTES:
        raise RejectedError("size", f"{len(payload)} bytes, at most {message_type.MAX_BYTES} are allowed")
    if _DOUBLE_NOT_FINITE(payload) or _SINGLE_NOT_FINITE(payload):
        message = _examined(payload, message_type)
    else:
        try:
            message = _decoder(message_type).decode(payload)
        except _REFUSED:
            message = _examined(payload, message_type)
    try:
        message.check()
    except InvalidMessageError as error:
        raise RejectedError("value", str(error)) from None
    return message


@cache
def _decoder(message_type: type[M]) -> msgspec.msgpack.Decoder[M]:
    return msgspec.msgpack.Decoder(message_type)


def _examined(payload: bytes, message_type: type[M]) -> M:
    """Message of a payload that is looked at number by number, to tell what is wrong with it."""
    limit = message_type.MAX_BYTES
    try:
        plain = msgpack.unpackb(payload, max_bin_len=limit, max_str_len=limit, raw=False)
    except Exception as error:  # noqa: BLE001 - msgpack raises many types for garbage; all mean the same
        raise RejectedError("malformed", f"not MessagePack: {error}") from None
    if not _finite(plain, MAX_DEPTH):
        raise RejectedError("value", "a number is not finite, or the message is nested too deeply")
    try:
        return msgspec.convert(plain, message_type, builtin_types=(bytes,))
    except (msgspec.ValidationError, OverflowError) as error:
        raise RejectedError("type", str(error)) from None


def _finite(value: object, depth: int) -> bool:
    """Whether every number in what msgpack unpacked is finite and no container lies deeper than `depth`."""
    if isinstance(value, dict):
        items = iter(value.values())
    elif isinstance(value, list):
        items = iter(value)
    else:
        return not isinstance(value, float) or math.isfinite(value)
    if depth == 0:
        return False
    # Every message passes here; a call for every number would take longer than all the rest of decoding.
    for item in items:
        if type(item) is float:
            if not math.isfinite(item):
                return False
        elif isinstance(item, dict | list) and not _finite(item, depth - 1):
            return False
    return True
