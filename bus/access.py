"""Rules of access for routers, which deny what is not derived from the tables of channels and requests."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from rcopterx.bus import channels
from rcopterx.bus.channels import ANSWERED, CHANNELS, KILL, key
from rcopterx.bus.keys import EVERY_FLEET, ROOT, probe_key, request_key
from rcopterx.bus.requests import ANYBODY, VERBS

_EVERYTHING: Final = ["put", "query", "reply", "declare_queryable", "declare_subscriber"]


@dataclass(frozen=True)
class Seat:
    """A role in a fleet, with the vehicles or the host that it is for."""

    role: str
    vehicles: tuple[str, ...] = ()
    host: str | None = None


@dataclass(frozen=True)
class Subject:
    """A client by its certificate's name, None on the Unix socket; without seats it may only subscribe."""

    certificate: str | None
    seats: tuple[Seat, ...] = ()

    @property
    def name(self) -> str:
        """Identifier in the rules."""
        return self.certificate or "local"


def access_control(fleet: str, namespace: str | None, subjects: Sequence[Subject]) -> dict[str, object]:
    """Return Zenoh's table `access_control` for a router; it denies what it does not allow."""
    prefix = f"{namespace}/" if namespace else ""
    rules = [_rule("receive", "egress", _EVERYTHING, [f"{prefix}{ROOT}/**"])]
    rules.append(_rule("subscribe", "ingress", ["declare_subscriber"], [f"{prefix}{ROOT}/**"]))
    policies: list[dict[str, object]] = [
        {"rules": ["receive", "subscribe"], "subjects": [subject.name for subject in subjects]}
    ]
    for subject in subjects:
        own = [
            _rule(f"{subject.name} {messages[0]}", "ingress", messages, [f"{prefix}{key}" for key in keys])
            for messages, keys in (
                (["put"], sorted(published_keys(fleet, subject.seats))),
                (["reply", "declare_queryable"], sorted(served_keys(fleet, subject.seats))),
                (["query"], sorted(requested_keys(fleet, subject.seats))),
            )
            if keys
        ]
        rules += own
        policies.append({"rules": [rule["id"] for rule in own], "subjects": [subject.name]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [
            {"id": subject.name, "link_protocols": ["unixsock-stream"]}
            if subject.certificate is None
            else {"id": subject.name, "cert_common_names": [subject.certificate]}
            for subject in subjects
        ],
        "policies": policies,
    }


def published_keys(fleet: str, seats: Sequence[Seat]) -> set[str]:
    """Return the keys on which these seats may publish."""
    keys = {
        key(fleet, unit, channel.topic)
        for seat in seats
        for channel in CHANNELS
        if channel.publisher == seat.role
        for unit in _units(channel.unit, seat)
    }
    keys |= {key(fleet, unit, ANSWERED.topic) for unit, _ in _served(seats)}
    keys |= {probe_key(fleet, seat.host) for seat in seats if seat.role == "router" and seat.host}
    if any(seat.role == KILL.publisher for seat in seats):
        keys.add(key(EVERY_FLEET, channels.FLEET_UNIT, KILL.topic))
    return keys


def served_keys(fleet: str, seats: Sequence[Seat]) -> set[str]:
    """Return the keys of the requests that these seats may answer."""
    return {request_key(fleet, unit, verb) for unit, verb in _served(seats)}


def requested_keys(fleet: str, seats: Sequence[Seat]) -> set[str]:
    """Return the keys of the requests that these seats may send; requests for anybody may go to all units."""
    keys = {request_key("*", "*", verb.name) for verb in VERBS.values() if verb.asker == ANYBODY}
    return keys | {
        request_key(fleet, unit, verb.name)
        for seat in seats
        for verb in VERBS.values()
        if verb.asker == seat.role
        for unit in (("*",) if verb.unit == "host" and seat.host is None else _units(verb.unit, seat))
    }


def _served(seats: Sequence[Seat]) -> Iterator[tuple[str, str]]:
    """Unit and verb of every request that the seats serve."""
    for seat in seats:
        for verb in VERBS.values():
            if verb.server == seat.role:
                for unit in _units(verb.unit, seat):
                    yield unit, verb.name


def _units(kind: str, seat: Seat) -> tuple[str, ...]:
    """Units of a kind that a seat is for: its vehicles, its host, or the fixed unit itself."""
    if kind == "vehicle":
        return seat.vehicles
    if kind == "host":
        return () if seat.host is None else (seat.host,)
    return (kind,)


def _rule(name: str, flow: str, messages: Sequence[str], keys: Sequence[str]) -> dict[str, object]:
    return {"id": name, "permission": "allow", "flows": [flow], "messages": [*messages], "key_exprs": [*keys]}
