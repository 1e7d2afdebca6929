"""Which flights break a promise: made of frames, poses and reasons."""

from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.codec import encode
from rcopterx.bus.message import Message
from rcopterx.bus.messages import Applied, Pose, TransmitterStatus
from rcopterx.bus.session import RawMessage
from rcopterx.command_line import app
from rcopterx.ground_station.report.logged_flight import records_of
from rcopterx.ground_station.report.recorder import Recording
from rcopterx_studies.faults.flight_promises import NEEDED, broken_promises

REFERENCE = Path(__file__).parents[2] / "fixtures" / "reference_flight.mcap"
FRAME_S = 0.02
OFF = ("disarmed", "cut", "killed")


class Log:
    """Makes records of vehicle h1: a frame and a pose every 20 ms."""

    def __init__(self) -> None:
        self.records: list[RawMessage] = []
        self.now_s = 100.0
        self.lease = 1

    def add(self, channel: Channel, unit: str, message: Message) -> None:
        self.records.append(RawMessage(unit, channel.topic, encode(message), self.now_s))

    def see(self, height_m: float) -> None:
        pose = Pose(
            epoch=1, frame=len(self.records), period_s=FRAME_S, latency_s=0.0, received_s=self.now_s,
            occluded=False, position_m=(0.0, 0.0, height_m), quaternion_xyzw=(0.0, 0.0, 0.0, 1.0),
        )  # fmt: skip
        self.add(channels.POSE, "h1", pose)

    def frame(self, state: str, thrust: float | None = None) -> None:
        u = (0.0, 0.0, (0.0 if state in OFF else 0.5) if thrust is None else thrust, 0.0)
        applied = Applied(
            state=state, input=u, pulse_width_us=(1500.0,), epoch=1, frame=1, sequence=1, fresh=False,
            written_s=self.now_s, lease=self.lease,
        )  # fmt: skip
        self.add(channels.APPLIED, "h1", applied)

    def be(self, state: str, height_m: float | None, frames: int = 10, thrust: float | None = None) -> "Log":
        """Write frames of a state at a height, or unseen."""
        for _ in range(frames):
            self.now_s += FRAME_S
            if height_m is not None:
                self.see(height_m)
            self.frame(state, thrust)
        return self

    def fly(self, height_m: float = 1.0) -> "Log":
        return self.be("disarmed", 0.02).be("armed", 0.02, thrust=0.0).be("armed", height_m)

    def give(self, state: str, reason: str) -> "Log":
        self.add(
            channels.TRANSMITTER_STATUS,
            "h1",
            TransmitterStatus(state=state, reason=reason, link="ready", module="", ready=True),
        )
        return self

    def broken(self) -> list[str]:
        return [found.promise for found in broken_promises(Recording(self.records))]


def test_the_reference_flight_breaks_no_promise() -> None:
    recording = Recording(records_of([REFERENCE], NEEDED))
    assert recording.units(channels.APPLIED)
    assert broken_promises(recording) == []


@pytest.mark.parametrize(
    "go_on",
    [
        lambda log: log.be("hold", 1.0).be("land", 1.0).be("land", 0.02).be("cut", 0.02).be("disarmed", 0.02),
        lambda log: log.be("descend", None, 90).be("cut", None).be("cut", 0.9),
        lambda log: log.be("descend", 1.0, 90).be("cut", 1.0),
        lambda log: log.be("killed", 1.0).be("disarmed", 0.0).be("armed", 0.0),
        lambda log: log.be("land", 1.0, thrust=0.0).be("cut", 1.0),
        lambda log: log.give("disarmed", "serial link lost").be("disarmed", 1.0),
        lambda log: log.give("cut", "far outside the fence").be("cut", 1.0),
    ],
    ids=["landing", "unseen", "mistaken", "kill", "no thrust", "link lost", "fence"],
)
def test_flights_that_end_as_promised_break_nothing(go_on: Callable[[Log], Log]) -> None:
    assert go_on(Log().fly()).broken() == []


def test_height_counts_from_where_a_vehicle_stood() -> None:
    assert Log().be("disarmed", 1.0).be("armed", 1.0).be("cut", 1.0).broken() == []


@pytest.mark.parametrize("end", ["cut", "disarmed"])
@pytest.mark.parametrize("state", ["armed", "hold", "land"])
def test_thrust_that_goes_off_in_the_air_is_found(state: str, end: str) -> None:
    log = Log().fly().be(state, 1.0)
    assert log.be(end, 1.0).broken() == [f"{end} after {state}, 0.98 m above the floor"]


def test_gap_that_ends_disarmed_in_the_air_is_found() -> None:
    log = Log().fly().be("descend", 1.0)
    log.now_s += 0.8
    assert log.be("disarmed", 0.8).broken() == [
        "disarmed after descend after 0.82 s without frames, 0.78 m above the floor"
    ]


def test_reason_of_long_ago_excuses_nothing() -> None:
    log = Log().give("disarmed", "serial link lost").fly().be("armed", 1.0, 60)
    assert len(log.be("disarmed", 1.0).broken()) == 1


@pytest.mark.parametrize("state", ["hold", "land", "descend"])
def test_flight_without_arming_is_found(state: str) -> None:
    assert Log().be("disarmed", 0.02).be(state, 1.0).broken() == [f"{state} after disarmed without arming"]


def test_flight_after_a_kill_without_a_reset_is_found() -> None:
    log = Log().fly().be("killed", 1.0)
    assert log.be("armed", 1.0).broken() == ["armed after killed without arming"]


def test_thrust_of_a_disarmed_vehicle_is_found() -> None:
    (found,) = Log().be("disarmed", 0.02).be("disarmed", 0.02, 1, thrust=0.3).broken()
    assert found == "inputs (0.0, 0.0, 0.3, 0.0) while disarmed"


def test_older_lease_that_commands_is_found_and_newer_ones_are_not() -> None:
    log = Log().fly()
    log.lease = 3
    log.be("armed", 1.0)
    log.lease = 2
    assert log.be("armed", 1.0, 1).broken() == ["lease 2 commands after 3"]


def test_order_of_arrival_does_not_matter() -> None:
    log = Log().fly()
    log.lease = 2
    log.be("armed", 1.0, 1)
    log.records[-4:-2], log.records[-2:] = log.records[-2:], log.records[-4:-2]
    assert log.broken() == []


def test_command_shows_broken_promises_and_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result = CliRunner().invoke(app, ["flights", "--check", str(REFERENCE)])
    assert (result.exit_code, result.output) == (0, "reference_flight: no promise is broken\n")
    bad = Recording(Log().fly().be("cut", 1.0).records)
    monkeypatch.setattr(
        "rcopterx_studies.faults.flight_promises.broken_promises", lambda _: broken_promises(bad)
    )
    result = CliRunner().invoke(app, ["flights", "--check", str(REFERENCE)])
    assert (result.exit_code, result.output) == (1, "100.62 s h1: cut after armed, 0.98 m above the floor\n")
    assert CliRunner().invoke(app, ["flights", "--check", str(tmp_path / "none")]).exit_code == 2
