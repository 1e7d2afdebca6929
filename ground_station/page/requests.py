"""The requests that a browser sends: names of methods of `PageSteering`, with arguments of their types."""

from collections.abc import Callable, Collection
from functools import cache, partial
from typing import Any, Final, get_type_hints

import msgspec
from msgspec import Struct

from rcopterx.ground_station.page.guard import RequestRejectedError
from rcopterx.ground_station.page.steering import PageSteering

ALLOWED: Final = (
    "kill", "take_off", "land", "reset", "move", "go_to", "follow", "formation", "promote", "use_controller",
    "weigh", "fly_through",
)  # fmt: skip


class Request(Struct, frozen=True, forbid_unknown_fields=True):
    """Name of a method and its arguments."""

    do: str
    arguments: dict[str, Any] = {}


@cache
def _arguments_of(name: str) -> type[Struct]:
    """Arguments of a method as a type."""
    hints = get_type_hints(getattr(PageSteering, name), include_extras=True)
    fields = [(field, hint) for field, hint in hints.items() if field != "return"]
    return msgspec.defstruct(name, fields, forbid_unknown_fields=True)


def decode(text: str, steering: PageSteering, vehicles: Collection[str]) -> Callable[[], object]:
    """Return what carries out a request; raises `RequestRejectedError` where it is none of the page."""
    try:
        request = msgspec.json.decode(text, type=Request)
        if request.do not in ALLOWED:
            raise RequestRejectedError(f"no request {request.do!r}")
        arguments = msgspec.structs.asdict(msgspec.convert(request.arguments, _arguments_of(request.do)))
    except msgspec.MsgspecError as error:
        raise RequestRejectedError(f"not a request of the page: {error}") from None
    for name in (arguments.get("name"), arguments.get("leader")):
        if name is not None and name not in vehicles:
            raise RequestRejectedError(f"no vehicle {name!r}")
    return partial(getattr(steering, request.do), **arguments)
