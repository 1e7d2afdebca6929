"""Changes of the keep-out zones of a running fleet."""

from contextlib import suppress

from msgspec import to_builtins

from rcopterx.bus.messages import Zone, ZoneSet
from rcopterx.bus.requests import SetZones
from rcopterx.bus.session import RequestFailedError
from rcopterx.fleet.consistency import check_zone
from rcopterx.fleet.reading import converted
from rcopterx.ground_station.scripting.observer import Observer
from rcopterx.ground_station.scripting.vehicle import RefusedError


def change_zone(fleet: Observer, name: str, zone: Zone | None) -> None:
    """Add, change, or with None remove a keep-out zone; see `Fleet.set_zone`."""
    before = fleet.zones
    zones = {other: kept for other, kept in before.zones.items() if other != name}
    if zone is not None:
        check_zone(name, zone)
        zones[name] = zone
    elif name not in before.zones:
        raise RefusedError(f"no keep-out zone {name!r}, there are {', '.join(before.zones) or 'none'}")
    after = {"revision": before.revision + 1, "zones": to_builtins(zones)}
    request, served = SetZones(zones=converted(after, ZoneSet, "")), False
    for vehicle in fleet.statuses():
        with suppress(RequestFailedError):  # Agents that are silent now adopt the zones of others later.
            reply = fleet.session.request(vehicle, request)
            if not reply.accepted:
                raise RefusedError(f"{vehicle}: {reply.reason}")
            served = True
    if not served:
        raise RefusedError("no agent has answered")
