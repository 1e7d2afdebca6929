"""Rules of access follow from the tables of channels and requests, and refuse everything else."""

import pytest

from rcopterx.bus.access import (
    Seat,
    Subject,
    access_control,
    published_keys,
    requested_keys,
    served_keys,
)  # fmt: skip
from rcopterx.bus.channels import CHANNELS, EVERY_FLEET, FLEET_UNIT, KILL, key
from rcopterx.bus.keys import request_key
from rcopterx.bus.requests import ANYBODY, VERBS

ROLES = sorted({channel.publisher for channel in CHANNELS} - {"server of the request"})
SERVERS = sorted({verb.server for verb in VERBS.values()})


def seat(role: str) -> Seat:
    return Seat(role, ("h1", "h2"), "main")


def test_every_channel_has_a_publisher() -> None:
    keys = published_keys("lab", [seat(role) for role in {*ROLES, *SERVERS}])
    for channel in CHANNELS:
        unit = {"vehicle": "h1", "host": "main"}.get(channel.unit, channel.unit)
        assert key("lab", unit, channel.topic) in keys, channel.topic


@pytest.mark.parametrize("role", ROLES)
def test_a_role_publishes_its_own_channels_only(role: str) -> None:
    topics = {channel.topic for channel in CHANNELS if channel.publisher in (role, "server of the request")}
    extra = {"router"} if role == "router" else set()
    assert {name.rpartition("/")[2] for name in published_keys("lab", [seat(role)])} <= topics | extra


def test_every_request_has_a_client_and_a_server() -> None:
    requested = requested_keys("lab", [seat(verb.asker) for verb in VERBS.values()])
    served = served_keys("lab", [seat(role) for role in SERVERS])
    for verb in VERBS.values():
        unit = {"vehicle": "h1", "host": "main"}.get(verb.unit, verb.unit)
        assert request_key("lab", unit, verb.name) in served
        everyone = request_key("*", "*", verb.name)
        assert (everyone if verb.asker == ANYBODY else request_key("lab", unit, verb.name)) in requested


def test_a_seat_is_for_its_own_vehicles_only() -> None:
    for keys in (published_keys, served_keys):
        found = keys("lab", [Seat("agent", ("h1",))])
        assert found
        assert all(name.startswith("rcopterx/lab/h1/") for name in found)


@pytest.mark.parametrize("role", sorted({*ROLES, *SERVERS} - {"operator"}))
def test_only_operators_may_kill_or_steer(role: str) -> None:
    killing = {key(fleet, FLEET_UNIT, KILL.topic) for fleet in ("lab", EVERY_FLEET)}
    assert not killing & published_keys("lab", [seat(role)])
    assert killing <= published_keys("lab", [seat("operator")])
    steering = {request_key("lab", "h1", verb.name) for verb in VERBS.values() if verb.asker == "operator"}
    assert not steering & requested_keys("lab", [seat(role)])


def test_a_watcher_may_say_nothing() -> None:
    table = access_control("lab", "test", [Subject("watcher.bob")])
    assert table["default_permission"] == "deny"
    allowed = [rule for rule in table["rules"] if "ingress" in rule["flows"]]  # type: ignore[attr-defined]
    messages = {message for rule in allowed for message in rule["messages"]}
    assert messages == {"query", "declare_subscriber"}
    assert all(name.startswith("test/rcopterx/") for rule in allowed for name in rule["key_exprs"])


def test_wildcards_are_only_in_what_anybody_may_ask() -> None:
    seats = [seat(role) for role in {*ROLES, *SERVERS}]
    for keys in (published_keys, served_keys):
        assert not any("*" in name for name in keys("lab", seats))
    assert {name for name in requested_keys("lab", seats) if "*" in name} == {
        request_key("*", "*", verb.name) for verb in VERBS.values() if verb.asker == ANYBODY
    }
