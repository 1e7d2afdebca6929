"""MessagePack coding of messages; what is not a valid message is rejected with a reason."""

import threading
from collections.abc import Iterable
from typing import Any, Final, TypeVar

import msgspec

from rcopterx.bus.message import InvalidMessageError, Message

M = TypeVar("M", bound=Message)

_ENCODER: Final = msgspec.msgpack.Encoder()
_DECODERS: Final[dict[type[Message], msgspec.msgpack.Decoder[Any]]] = {}
_preparing: Final = threading.Lock()


class RejectedError(ValueError):
    """A payload that is not a valid message; `kind` is `size`, `malformed`, `type` or `value`."""

    def __init__(self, kind: str, detail: str) -> None:
        super().__init__(detail)
        self.kind = kind


def encode(message: Message) -> bytes:
    """Pack a message as a MessagePack map of its fields."""
    return _ENCODER.encode(message)


def decode(payload: bytes, message_type: type[M]) -> M:
    """Unpack and validate a message; unknown fields are skipped, numbers finite. Raises `RejectedError`."""
    if len(payload) > message_type.MAX_BYTES:
        raise RejectedError("size", f"{len(payload)} bytes, at most {message_type.MAX_BYTES} are allowed")
    try:
        message: M = _decoder(message_type).decode(payload)
    except msgspec.ValidationError as error:
        raise RejectedError("type", str(error)) from None
    except (msgspec.DecodeError, ValueError, OverflowError, RecursionError) as error:
        raise RejectedError("malformed", f"not MessagePack: {error}") from None
    try:
        message.check()
    except InvalidMessageError as error:
        raise RejectedError("value", str(error)) from None
    return message


def prepare(message_types: Iterable[type[Message]]) -> None:
    """Build what `decode` needs for some types now: a loop has no time for it, and it leaves garbage."""
    for message_type in message_types:
        _decoder(message_type)


def _decoder(message_type: type[M]) -> msgspec.msgpack.Decoder[M]:
    if message_type not in _DECODERS:
        # While msgspec describes a type, a second thread that decodes it reads a null pointer and crashes.
        with _preparing:
            _DECODERS[message_type] = msgspec.msgpack.Decoder(message_type)
    return _DECODERS[message_type]
