"""The message by which the schemes of vehicles coordinate."""

from typing import Annotated, Final

from msgspec import Meta

from rcopterx.bus.message import Count, Message, Name, Place

MAX_PAYLOAD_BYTES: Final = 4096


class SchemeMessage(Message, frozen=True, kw_only=True):
    """Message of a vehicle's scheme to those of all others."""

    epoch: Count
    frame: Count
    """Epoch and frame of the control period in which it was sent."""
    source: Name
    scheme: Annotated[str, Meta(max_length=60)]
    """Type of the payload; vehicles with another scheme ignore it."""
    offsets_m: Annotated[dict[Name, Place], Meta(max_length=16)]
    """Where the source should be relative to each of its leaders, inertial frame."""
    payload: Annotated[bytes, Meta(max_length=MAX_PAYLOAD_BYTES)]
    """MessagePack map of the fields that the scheme defines."""
