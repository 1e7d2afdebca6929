"""What differs between hosts is named before anything flies; a host that does not start is an error."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

import pytest
from support.bus import answering
from support.scripted import fleet_file_text, patient_fleet

from rcopterx.bus.host_messages import LinkState, RouterStatus
from rcopterx.bus.requests import Identify, IdentifyReply, Reply, Request
from rcopterx.bus.session import BusAddress, Session
from rcopterx.fleet.reading import digest_of, parse_fleet
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.ground_station.scripting.daemons import Daemons, differences
from rcopterx.ground_station.scripting.notes import clock_differences


def answer(host: str, version: str) -> IdentifyReply:
    return IdentifyReply(accepted=True, fleet="lab", host=host, digest="d", version=version)


def test_hosts_with_another_version_are_named() -> None:
    answers = {"a": answer("a", "0.1.0"), "b": answer("b", "0.2.0"), "c": answer("c", "")}
    assert differences(answers, "0.1.0") == [
        "host b runs version 0.2.0, this program is 0.1.0",
        "host c runs version unknown, this program is 0.1.0",
    ]


def test_hosts_whose_clocks_differ_are_named_with_a_remedy() -> None:
    def link(offset_s: float | None) -> LinkState:
        return LinkState(linked=True, redials=0, late=0, clock_offset_s=offset_s, round_trip_s=0.001)

    status = RouterStatus(links={"near": link(0.05), "far": link(-3.0), "unknown": link(None)})
    (line,) = clock_differences({"main": status}, "main", 0.1)
    assert line.startswith("host far: clock 3000.0 +- 0.5 ms behind that of main")
    assert line.endswith("set the clocks, for instance by chrony")
    assert clock_differences({}, "main", 0.1) == []


@contextmanager
def daemon(
    session: Session, fleet: FleetFile, host: str, requests: list[tuple[str, str]], *, starts: bool = True
) -> Iterator[None]:
    """A daemon that stores the requests that arrive."""
    identity = IdentifyReply(accepted=True, fleet=fleet.name, host=host, digest=digest_of(fleet), version="")

    def reply(request: Request) -> Reply:
        if isinstance(request, Identify):
            return identity
        requests.append((host, type(request).__name__))
        return Reply(accepted=starts, reason="" if starts else "the disk is full")

    session.serve(host, ["identify", "start_host", "stop_host"])
    with answering(session, reply):
        yield


def test_a_host_that_does_not_start_is_an_error_and_the_others_stop_again(
    bus_address: BusAddress, join: Callable[..., Session], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    hosts = '[hosts.second]\naddress = "127.0.0.2"\n[hosts.third]\naddress = "127.0.0.3"\n'
    file = parse_fleet(fleet_file_text(bus_address) + hosts)
    requests: list[tuple[str, str]] = []
    with ExitStack() as stack:
        for host in file.hosts:
            stack.enter_context(daemon(join(), file, host, requests, starts=host != "second"))
        daemons = Daemons(stack.enter_context(closing(patient_fleet(file, "main"))))
        daemons.find()
        with pytest.raises(FleetError, match="host second does not start: the disk is full"):
            daemons.start()
    assert requests == [("main", "StartHost"), ("second", "StartHost"), ("main", "StopHost")]
