"""Promises of replays of arbiters: the recorded calls give the written frames, and what differs is named."""

import json
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest
from msgspec import structs
from support.bus import free_port
from support.fleets import PAIR
from typer.testing import CliRunner

from rcopterx.bus.codec import decode, encode
from rcopterx.bus.log_messages import ArbiterCalls
from rcopterx.bus.messages import Applied
from rcopterx.bus.session import RawMessage
from rcopterx.command_line import app
from rcopterx.fleet.reading import at_speed, parse_fleet
from rcopterx.fleet.schema import FleetFile
from rcopterx.flights.flight_writing import FLEET_ATTACHMENT, METADATA
from rcopterx.flights.mcap_records import FlightLogError
from rcopterx.flights.mcap_writing import LoggedMessage, McapFile
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx_studies.replay.arbiter_replay import ArbiterComparison, RecordedArbiters, replay_arbiter
from rcopterx_studies.search import flying
from rcopterx_studies.search.flights import read_flight
from rcopterx_studies.search.one_process import in_one_process

pytestmark = pytest.mark.timeout(300)
FOUND = Path(__file__).parents[2] / "found" / "touchdown-1004.json"
LOST_S = 0.25  # of calls that a gateway had not published when it was killed
Flown = tuple[FleetFile, list[LoggedMessage]]


def logged(message: RawMessage) -> LoggedMessage:
    time_ns = round(message.arrived_s * 1e9)
    return LoggedMessage(f"{message.unit}/{message.topic}", message.payload, time_ns, message.number)


@pytest.fixture(scope="module")
def flown() -> Flown:
    """A flight of two vehicles, in which their gateway is killed."""
    port = f'[tracker]\naddress = "127.0.0.1:{free_port()}"\n'
    file = at_speed(parse_fleet(PAIR + port), None, lockstep=True)
    messages: list[LoggedMessage] = []

    def script(fleet: Fleet) -> None:
        fleet.wait_ready()
        fleet.take_off()
        assert fleet.session.participant is not None
        fleet.session.participant.kill("transmitters")
        fleet.wait(2.0)
        fleet.land()

    with in_one_process(file, lambda message: messages.append(logged(message))) as process:
        process.run(script)
    assert not process.turns.failures
    return file, messages


def replayed(flown: Flown, vehicle: str = "h1", fleet: FleetFile | None = None) -> ArbiterComparison:
    file, messages = flown
    return replay_arbiter(RecordedArbiters(vehicle, file, messages), fleet or file)


@pytest.mark.parametrize("vehicle", ["h1", "h2"])
def test_arbiters_write_the_same_frames_again_also_after_the_death_of_their_gateway(
    flown: Flown, vehicle: str
) -> None:
    result = replayed(flown, vehicle)
    assert result.first is None
    assert result.frames == result.identical > 300
    assert result.missing_inputs == 0
    written = sum(message.topic == f"{vehicle}/applied" for message in flown[1])
    assert result.frames + result.unmatched == written
    assert result.unmatched <= 60 * LOST_S
    assert result.notes == [f"{result.unmatched} frames without calls: those before the recording or a death"]


def test_another_limit_is_shown_where_it_first_has_an_effect(flown: Flown) -> None:
    file, messages = flown
    safety = structs.replace(file.safety, settings={"take_over_s": 0.01})
    result = replayed(flown, fleet=structs.replace(file, safety=safety))
    assert result.first is not None
    assert (result.first.cause, result.first.detail) == ("state", "disarmed in place of descend")
    calls = [decode(message.payload, ArbiterCalls) for message in messages if message.topic == "h1/calls"]
    successor_s = max(each.began_s for each in calls) - calls[0].calls[0][2]
    assert 0.0 < result.first.time_s - successor_s < 0.2


def with_messages(flown: Flown, change: Callable[[int, LoggedMessage], LoggedMessage | None]) -> Flown:
    """The flight with messages changed or lost, by number of those of their topic."""
    counts: dict[str, int] = {}
    kept = []
    for message in flown[1]:
        number = counts[message.topic] = counts.get(message.topic, -1) + 1
        if (changed := change(number, message)) is not None:
            kept.append(changed)
    return flown[0], kept


@pytest.mark.parametrize("topic", ["h1/pose", "h2/command"])
def test_a_message_that_the_log_has_lost_is_counted(flown: Flown, topic: str) -> None:
    lost = with_messages(flown, lambda number, one: None if (number, one.topic) == (150, topic) else one)
    result = replayed(lost, topic.partition("/")[0])
    assert result.missing_inputs == 1
    assert result.first is None or "1 inputs so far are not in the flight log" in result.first.detail


def test_lost_calls_are_named_with_their_number(flown: Flown) -> None:
    calls = [decode(m.payload, ArbiterCalls) for m in flown[1] if m.topic == "h1/calls"]
    lost = with_messages(flown, lambda number, one: None if (number, one.topic) == (7, "h1/calls") else one)
    notes = replayed(lost).notes
    assert f"{len(calls[7].calls)} calls after number {calls[7].number} are missing" in notes


def test_another_reason_and_another_state_are_found(flown: Flown) -> None:
    def disarmed(number: int, message: LoggedMessage) -> LoggedMessage:
        if (number, message.topic) != (200, "h1/applied"):
            return message
        applied = decode(message.payload, Applied)
        assert applied.state == "armed"
        return message._replace(payload=encode(structs.replace(applied, state="hold")))

    def other_reason(_: int, message: LoggedMessage) -> LoggedMessage:
        if message.topic != "h1/calls":
            return message
        calls = decode(message.payload, ArbiterCalls)
        changed = [(name, *rest, ("?",) if name == "reason" else last) for name, *rest, last in calls.calls]
        return message._replace(payload=encode(structs.replace(calls, calls=tuple(changed))))

    first = replayed(with_messages(flown, disarmed)).first
    assert first is not None
    assert (first.cause, first.detail) == ("state", "armed in place of hold")
    first = replayed(with_messages(flown, other_reason)).first
    assert first is not None
    assert first.cause == "reason"


def test_a_log_without_calls_and_an_unknown_vehicle_are_refused(flown: Flown) -> None:
    older = with_messages(flown, lambda _, one: None if one.topic.endswith("/calls") else one)
    with pytest.raises(FlightLogError, match=r"h1: the flight log has no calls of its arbiter"):
        replayed(older)
    with pytest.raises(FlightLogError, match=r"h9: no such vehicle, the flight has h1, h2"):
        replayed(flown, "h9")


def test_a_flight_that_the_search_has_found_is_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    messages: list[LoggedMessage] = []
    files: list[FleetFile] = []

    def noted(file: FleetFile, store: Callable[[RawMessage], None]) -> object:
        def both(message: RawMessage) -> None:
            messages.append(logged(message))
            store(message)

        files.append(file)
        return in_one_process(file, both)

    monkeypatch.setattr(flying, "in_one_process", noted)
    flight = read_flight(FOUND)
    flying.fly(flight)
    for vehicle in flight.vehicles:
        result = replayed((files[0], messages), vehicle)
        assert result.first is None
        assert result.frames == result.identical > 100
        assert result.missing_inputs == 0


def test_the_command_prints_what_was_compared(flown: Flown, tmp_path: Path) -> None:
    file, messages = flown
    path = tmp_path / "flight.mcap"
    with path.open("xb") as stream:
        mcap = McapFile(stream)
        mcap.add_metadata(METADATA, {})
        mcap.add_attachment(FLEET_ATTACHMENT, msgspec.json.encode(file), 0)
        mcap.add_chunk(messages)
        mcap.finish()
    runner = CliRunner()
    shown = runner.invoke(app, ["replay", str(path), "--transmitter", "h1", "--json"])
    assert shown.exit_code == 0, shown.output
    document = json.loads(shown.stdout)
    assert document["frames"] == document["identical"] > 300
    text = runner.invoke(app, ["replay", str(path), "--transmitter", "h2"]).stdout
    assert "the same to the last bit" in text
    both = runner.invoke(app, ["replay", str(path), "--agent", "h1", "--transmitter", "h1"])
    assert both.exit_code == 2
