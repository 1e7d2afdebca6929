"""What routers of a fleet with certificates refuse, tried on real routers and links."""

import json
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest
import zenoh
from support.secured import SecuredBus, identified, secured_bus
from support.waiting import DEADLINE_S

from rcopterx.bus.channels import (
    COMMAND,
    EVERY_FLEET,
    EXTERNAL_INPUT,
    FLEET_UNIT,
    KILL,
    PLAN,
    POSE,
    key,
    request_key,
)  # fmt: skip
from rcopterx.bus.endpoints import Credentials, client_config
from rcopterx.deploy.certificates.files import credentials
from rcopterx.deploy.certificates.issuing import issue, new_authority, read_authority

REFUSED_S = 0.5


@pytest.fixture(scope="module")
def bus() -> Iterator[SecuredBus]:
    with secured_bus() as made:
        yield made


def not_let_in(bus: SecuredBus, endpoint: str, shown: Credentials | None) -> None:
    with pytest.raises(zenoh.ZError, match="Unable to connect"):
        bus.client(endpoint, shown, REFUSED_S)


def test_whoever_shows_a_certificate_of_the_fleet_is_let_in(bus: SecuredBus) -> None:
    assert len(identified(bus.remote("watcher.lab"))) == 2


def test_no_connection_is_admitted_without_encryption(bus: SecuredBus) -> None:
    not_let_in(bus, bus.fleet.endpoint("main").replace("tls/", "tcp/"), None)


def test_a_certificate_of_another_authority_is_refused(bus: SecuredBus, tmp_path: Path) -> None:
    now = datetime.now(UTC)
    issue(new_authority("lab", tmp_path, now), tmp_path, "operator.lab", [], now, days=10)
    stranger = credentials(tmp_path, "operator.lab")
    trusting = Credentials(bus.certificate("host.main").authority, stranger.certificate, stranger.private_key)
    not_let_in(bus, bus.fleet.endpoint("main"), trusting)


def test_an_expired_certificate_is_refused(bus: SecuredBus) -> None:
    directory = bus.directory / "certificates"
    issue(read_authority(directory), directory, "operator.gone", [], datetime.now(UTC), days=-1)
    not_let_in(bus, bus.fleet.endpoint("main"), bus.certificate("operator.gone"))


def test_a_certificate_with_a_name_that_is_not_in_the_fleet_file_permits_nothing(bus: SecuredBus) -> None:
    directory = bus.directory / "certificates"
    issue(read_authority(directory), directory, "operator.fired", [], datetime.now(UTC), days=10)
    assert identified(bus.remote("operator.fired")) == []


@pytest.mark.parametrize("name", ["operator.lab", "host.second"])
def test_no_other_member_adds_a_link_to_those_of_a_router(bus: SecuredBus, name: str) -> None:
    (router,) = bus.local["second"].info.routers_zid()
    config = client_config([bus.fleet.endpoint("main")], None, REFUSED_S, bus.certificate(name))
    config.insert_json5("mode", json.dumps("router"))
    config.insert_json5("id", json.dumps(str(router)))
    config.insert_json5("listen/endpoints", "[]")
    with pytest.raises(zenoh.ZError, match="Unable to connect"):
        zenoh.open(config)
    assert len(identified(bus.local["main"])) == 2


@pytest.mark.parametrize(
    ("sender", "on_key"),
    [
        ("agent.h1", key("lab", "h1", COMMAND.topic)),
        ("agent.h1", key("lab", "h1", PLAN.topic)),
        ("agent.h2", key("lab", "h2", COMMAND.topic)),
        ("host.main", key("lab", "h2", POSE.topic)),
        ("operator.lab", key("lab", FLEET_UNIT, KILL.topic)),
        ("operator.lab", key(EVERY_FLEET, FLEET_UNIT, KILL.topic)),
        ("operator.lab", key("lab", "h2", EXTERNAL_INPUT.topic)),
        ("program.h1", key("lab", "h1", EXTERNAL_INPUT.topic)),
    ],
)
def test_members_may_publish_what_is_permitted(bus: SecuredBus, sender: str, on_key: str) -> None:
    assert bus.passes(bus.remote(sender), on_key)


FORBIDDEN = [
    ("agent.h1", key("lab", "h2", COMMAND.topic)),
    ("agent.h1", key("lab", "*", COMMAND.topic)),
    ("agent.h1", key("lab", "h2", PLAN.topic)),
    ("agent.h1", key("lab", "h1", POSE.topic)),
    ("agent.h1", key("lab", FLEET_UNIT, KILL.topic)),
    ("agent.h1", key(EVERY_FLEET, FLEET_UNIT, KILL.topic)),
    ("program.h1", key("lab", "h2", EXTERNAL_INPUT.topic)),
    ("program.h1", key("lab", "h1", COMMAND.topic)),
    ("program.h1", key("lab", "h1", PLAN.topic)),
    ("program.h1", key("lab", FLEET_UNIT, KILL.topic)),
    ("host.second", key("lab", "h1", COMMAND.topic)),
    ("host.second", key("lab", "h2", POSE.topic)),
    ("host.second", key("lab", FLEET_UNIT, KILL.topic)),
    ("operator.lab", key("lab", "h1", COMMAND.topic)),
    ("operator.lab", key("lab", "h1", POSE.topic)),
    ("watcher.lab", key("lab", FLEET_UNIT, KILL.topic)),
    ("watcher.lab", key("lab", "h1", COMMAND.topic)),
]


@pytest.mark.parametrize(("sender", "on_key"), FORBIDDEN)
def test_what_is_not_permitted_reaches_no_other_member(bus: SecuredBus, sender: str, on_key: str) -> None:
    assert not bus.passes(bus.remote(sender), on_key)


@pytest.mark.parametrize(
    "on_key",
    [key("lab", "h1", COMMAND.topic), key("lab", "h2", POSE.topic), key("lab", FLEET_UNIT, KILL.topic)],
)
def test_a_host_passes_on_only_what_the_fleet_file_gives_it(bus: SecuredBus, on_key: str) -> None:
    assert bus.passes(bus.local["second"], key("lab", "h2", COMMAND.topic))
    assert not bus.passes(bus.local["second"], on_key)


def asked(session: zenoh.Session, on_key: str) -> bool:
    return any(reply.ok is not None for reply in session.get(on_key, timeout=DEADLINE_S))


def test_only_operators_may_ask_for_what_moves_a_vehicle(bus: SecuredBus) -> None:
    land = request_key("lab", "h1", "land")
    bus.serve(bus.remote("agent.h1"), land)
    assert asked(bus.remote("operator.lab"), land)
    for rogue in ("watcher.lab", "agent.h2", "host.second"):
        assert not asked(bus.remote(rogue), land), rogue


def test_an_agent_cannot_answer_in_the_place_of_another_one(bus: SecuredBus) -> None:
    land = request_key("lab", "h2", "land")
    bus.serve(bus.remote("agent.h1"), land)
    operator = bus.remote("operator.lab")
    assert identified(operator)
    assert not asked(operator, land)
    bus.serve(bus.remote("agent.h2"), land)
    assert asked(operator, land)
