"""What must not be possible in a fleet that flies over four hosts with certificates."""

import json
import subprocess
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from hosts_support import Obeyed, environment_of, run_directory_of, trio_in_flight
from integration_support import NAMES, Flying, Truth
from msgspec.structs import replace
from support.namespaces import NetworkNamespaces

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel, key, request_key
from rcopterx.bus.codec import encode
from rcopterx.bus.message import Message
from rcopterx.bus.messages import Command, Kill
from rcopterx.bus.requests import LoggedLine
from rcopterx.bus.session import BusAddress, Session
from rcopterx.bus.subscription import Received
from rcopterx.deploy.certificates.files import credentials, directory_of
from rcopterx.deploy.certificates.issuing import issue, read_authority
from rcopterx.deploy.hosts.run_directory import router_socket, run_directory
from rcopterx.deploy.processes.log_reading import ProcessLogs

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(400)]

HOSTS = ("main", "compute1", "compute2", "ground")
ROGUE = Path(__file__).with_name("rogue.py")
FLOOD_S = 5.0
OLD = 300
"""Recorded commands that are said again."""
REFUSALS = ("old sequence number", "control lease lost", "command computed from an old pose")


class Laboratory:
    """A trio in flight over four hosts, and rogues in it."""

    def __init__(self, net: NetworkNamespaces, flying: Flying) -> None:
        self.net, self.flying, self.fleet = net, flying, flying.fleet
        self.truth, self.obeyed = Truth(flying), Obeyed(flying, NAMES)
        directory = directory_of(flying.fleet.file)
        assert directory is not None
        self.certificates = directory
        self.fleet.wait_until(self.truth.rested, 60, "the formation does not rest")
        self.truth.start_watch()

    def began(self, host: str, certificate: str | None, **order: Any) -> "subprocess.Popen[str]":
        """Start a rogue on a host; it talks to the router of `main` unless it is given another endpoint."""
        file = self.fleet.file
        shown = None if certificate is None else credentials(self.certificates, certificate)
        words = {
            "endpoint": file.endpoint("main"),
            "namespace": file.bus.namespace,
            "authority": credentials(self.certificates, "authority").certificate,
            "shown": shown and [shown.authority, shown.certificate, shown.private_key],
            "say": [],
            "serve": [],
            "for_s": 1.0,
            "flood": False,
        } | order
        command = self.net.python(host, str(ROGUE), json.dumps(words))
        return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)

    def rogue(self, host: str, certificate: str | None, **order: Any) -> Mapping[str, Any] | str:
        """What a rogue reports; `refused` if it was not let in."""
        with self.began(host, certificate, **order) as process:
            output, _ = process.communicate(timeout=60)
        text = output.strip().splitlines()[-1]
        return text if text == "refused" else json.loads(text)

    def said(self, channel: Channel[Any], unit: str, *messages: Message) -> list[tuple[str, str]]:
        """What a rogue is to say."""
        return [(key("lab", unit, channel.topic), encode(message).hex()) for message in messages]

    def newest(self, channel: Channel[Any], unit: str) -> Any:
        """Newest message of a channel."""
        inbox = self.fleet.session.subscribe(channel, unit)
        self.fleet.wait_until(lambda: inbox.latest() is not None, 30, f"nothing on {channel.topic}")
        received: Received[Any] | None = inbox.latest()
        assert received is not None
        return received.message

    def assert_flies_on(self, from_s: float) -> None:
        """The fleet was not disturbed: every arbiter applied its agent's commands all the time."""
        self.truth.assert_none_touched_down()
        assert [self.obeyed.states(name, from_s) for name in NAMES] == [["armed"]] * len(NAMES)


def _fleet_directory(host: str, laboratory: Laboratory) -> Path:
    """Run directory of the fleet on a host."""
    own = Path(run_directory("lab", laboratory.fleet.file.bus.namespace))
    return run_directory_of(host) / own.name


def _endpoint_of(host: str, laboratory: Laboratory) -> str:
    """Unix socket of a host, whose user may say what runs there."""
    socket = router_socket(host, _fleet_directory(host, laboratory))
    assert socket is not None
    return socket


def _refused(laboratory: Laboratory) -> int:
    """Commands for h2 that its arbiter has refused."""
    status = laboratory.fleet.state_of("h2").transmitter
    return 0 if status is None else sum(status.counters.get(kind, 0) for kind in REFUSALS)


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Laboratory]:
    directory = tmp_path_factory.mktemp("rogues")
    with (
        pytest.MonkeyPatch.context() as patch,
        trio_in_flight(directory, HOSTS, patch, spares=("compute2",), certificates=True) as (net, flying),
    ):
        laboratory = Laboratory(net, flying)
        yield laboratory
        flying.fleet.land()


def test_doctor_has_no_findings_on_any_host(laboratory: Laboratory) -> None:
    for host in HOSTS:
        words = ["-m", "rcopterx", "doctor", str(laboratory.flying.path), "--host", host]
        done = subprocess.run(
            laboratory.net.python(host, *words),
            env=environment_of(host),
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.stdout.splitlines()[-1] == "findings: 0", done.stdout
        assert "what it refuses was not tried" not in done.stdout


def test_client_without_valid_certificate_is_rejected_and_reported(laboratory: Laboratory) -> None:
    directory, file = laboratory.certificates, laboratory.fleet.file
    issue(read_authority(directory), directory, "operator.gone", [], datetime.now(UTC), days=-1)
    logs = ProcessLogs(_fleet_directory("main", laboratory) / "log", ["router"])
    logs.new_lines()
    now_s = laboratory.fleet.session.clock()
    for certificate, endpoint in (
        (None, file.endpoint("main")),
        (None, file.endpoint("main").replace("tls/", "tcp/")),
        ("operator.gone", file.endpoint("main")),
    ):
        assert laboratory.rogue("ground", certificate, endpoint=endpoint) == "refused"
        logged: list[LoggedLine] = []

        def is_logged(logged: list[LoggedLine] = logged) -> bool:
            logged += logs.new_lines()
            return bool(logged)

        laboratory.fleet.wait_until(is_logged, 30, f"{certificate} at {endpoint}: the router logs nothing")
        print(f"{certificate} at {endpoint}: {logged[0].text}")
    laboratory.assert_flies_on(now_s)


def test_the_agent_of_one_vehicle_can_neither_fly_nor_see_nor_kill_nor_answer_for_another(
    laboratory: Laboratory,
) -> None:
    command, pose = laboratory.newest(channels.COMMAND, "h2"), laboratory.newest(channels.POSE, "h2")
    fall = replace(command, sequence=command.sequence + 10_000, input=(0.0, 0.0, 0.0, 0.0))
    ghost = replace(pose, frame=pose.frame + 10_000, position_m=(0.0, 0.0, 5.0))
    say = [
        *laboratory.said(channels.COMMAND, "h2", fall),
        *laboratory.said(channels.POSE, "h2", ghost),
        *laboratory.said(channels.KILL, channels.FLEET_UNIT, Kill(source="agent", reason="rogue")),
    ]
    frames = laboratory.fleet.session.subscribe(channels.POSE, "h2", depth=1024)
    land = request_key("lab", "h2", "go_to")
    now_s = laboratory.fleet.session.clock()
    with laboratory.began("ground", "agent.h1", say=say, serve=[land], for_s=4.0) as process:
        for _ in range(20):
            laboratory.fleet["h1"].go_to((0.0, 0.0, 1.0))
        output, _ = process.communicate(timeout=60)
    report = json.loads(output.strip().splitlines()[-1])
    assert report["said_hz"] > 10
    assert report["asked"] == 0
    assert all(received.message.frame < ghost.frame for received in frames.drain())
    assert laboratory.newest(channels.APPLIED, "h2").sequence < fall.sequence
    laboratory.assert_flies_on(now_s)


def test_recorded_commands_that_a_permitted_host_says_again_are_refused_and_counted(
    laboratory: Laboratory,
) -> None:
    fleet = laboratory.fleet
    inbox = fleet.session.subscribe(channels.COMMAND, "h2", depth=2 * OLD)
    recorded: list[Received[Command]] = []

    def enough() -> bool:
        recorded.extend(inbox.drain())
        return len(recorded) >= OLD

    fleet.wait_until(enough, 30, "no commands are heard")
    before, now_s = _refused(laboratory), fleet.session.clock()
    address = BusAddress((_endpoint_of("compute1", laboratory),), "lab", fleet.file.bus.namespace)
    with Session(address) as permitted:
        for received in recorded:
            permitted.publish(channels.COMMAND, "h2", received.message)
        fleet.wait_until(
            lambda: _refused(laboratory) >= before + OLD // 2, 30, "old commands are not refused"
        )
    print(f"{len(recorded)} commands said again, {_refused(laboratory) - before} more refused")
    laboratory.assert_flies_on(now_s)


def test_a_flood_from_a_permitted_host_is_borne_and_counted(laboratory: Laboratory) -> None:
    fleet, endpoint = laboratory.fleet, _endpoint_of("compute1", laboratory)
    before = fleet.state_of("h2").transmitter
    assert before is not None
    now_s = fleet.session.clock()
    say = [(key("lab", "h2", channels.COMMAND.topic), "c1")] * 8
    floods = [
        laboratory.began("compute1", None, endpoint=endpoint, say=say, for_s=FLOOD_S, flood=True)
        for _ in range(2)
    ]
    reports = [json.loads(process.communicate(timeout=60)[0].splitlines()[-1]) for process in floods]
    said_hz = sum(report["said_hz"] for report in reports)

    def rejected() -> int:
        after = fleet.state_of("h2").transmitter
        return 0 if after is None else sum(after.rejected.values()) - sum(before.rejected.values())

    fleet.wait_until(lambda: rejected() > 0, 30, "the flood is not counted")
    fleet.wait_for_formation()
    states = {name: laboratory.obeyed.states(name, now_s) for name in NAMES}
    silences = {name: laboratory.obeyed.longest_silence_s(name, now_s) for name in NAMES}
    print(
        f"{said_hz:.0f} messages a second, {rejected()} rejected; states {states}, "
        f"longest silence of commands {max(silences.values()):.2f} s"
    )
    laboratory.truth.assert_none_touched_down()
    assert all("cut" not in told for told in states.values())
