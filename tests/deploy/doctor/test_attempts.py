"""What a router must refuse is tried on real ones: those that do, and those that do not."""

import threading
from collections.abc import Iterator
from datetime import UTC, datetime

import pytest
from msgspec import structs
from support.bus import router
from support.secured import SecuredBus, secured_bus
from support.waiting import DEADLINE_S

from rcopterx.bus.channels import FLEET_UNIT, KILL, key, request_key
from rcopterx.bus.keys import probe_key
from rcopterx.bus.router import CONTENT
from rcopterx.bus.session import BusAddress, opened
from rcopterx.deploy.doctor import attempts
from rcopterx.fleet.schema import HostConfig


@pytest.fixture(scope="module")
def bus() -> Iterator[SecuredBus]:
    with secured_bus() as made:
        yield made


@pytest.fixture(autouse=True)
def _patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine may take longer to answer than a doctor waits."""
    monkeypatch.setattr(attempts, "ANSWER_S", DEADLINE_S)


def results(bus: SecuredBus, host: str) -> list[attempts.Result]:
    directory = bus.directory / "certificates"
    address = BusAddress((bus.socket(host),), "lab")
    return [
        *attempts.strangers(bus.fleet, host, directory, datetime.now(UTC)),
        *attempts.members(bus.fleet, address, host, directory),
    ]


@pytest.mark.parametrize("host", ["main", "second"])
def test_a_fleet_with_certificates_has_no_findings(bus: SecuredBus, host: str) -> None:
    found = results(bus, host)
    assert [result.text for result in found if not result.good] == []
    assert len(found) > 10


def test_what_others_say_and_what_an_agent_may_ask_of_every_host_is_no_finding(bus: SecuredBus) -> None:
    bus.serve(bus.local["main"], request_key("lab", "main", "recall"))
    ended = threading.Event()

    def go_on() -> None:
        while not ended.wait(0.001):
            bus.local["second"].put(probe_key("lab", "second"), CONTENT)

    sender = threading.Thread(target=go_on)
    sender.start()
    try:
        found = results(bus, "main")
    finally:
        ended.set()
        sender.join()
    assert [result.text for result in found if not result.good] == []


def test_routers_that_let_through_more_than_the_fleet_file_says_are_found(bus: SecuredBus) -> None:
    hosts = {name: structs.replace(host, steering=False) for name, host in bus.fleet.hosts.items()}
    stricter = structs.replace(bus.fleet, hosts=hosts)
    directory = bus.directory / "certificates"
    address = BusAddress((bus.socket("main"),), "lab")
    findings = [one.text for one in attempts.members(stricter, address, "main", directory) if not one.good]
    for name in ("local", "host.main"):
        kill = key("lab", FLEET_UNIT, KILL.topic)
        assert f"{name}: may publish {kill}, which is not its own" in findings


def test_a_router_without_certificates_is_found(bus: SecuredBus, monkeypatch: pytest.MonkeyPatch) -> None:
    directory = bus.directory / "certificates"
    with router() as address:
        port = int(address.endpoints[0].rpartition(":")[2])
        hosts = {"main": HostConfig(router_port=port)}
        fleet = structs.replace(bus.fleet, hosts=hosts)
        monkeypatch.setattr(attempts, "REFUSED_S", DEADLINE_S)
        plain = next(attempts.strangers(fleet, "main", directory, datetime.now(UTC)))
    assert not plain.good
    assert plain.text == "router of main: a connection without encryption is let in"


def test_what_is_not_answered_in_time_is_not_known(bus: SecuredBus, monkeypatch: pytest.MonkeyPatch) -> None:
    # Nothing in this process answers so fast.
    monkeypatch.setattr(attempts, "ANSWER_S", 1e-6)
    monkeypatch.setattr(attempts, "opened", lambda address, _: opened(address, DEADLINE_S))
    address = BusAddress((bus.socket("main"),), "lab")
    found = list(attempts.members(bus.fleet, address, "main", bus.directory / "certificates"))
    assert found
    for result in found:
        assert not result.good
        assert "is not known: no answer in time" in result.text
