"""An agent that dies again and again comes back with what flew before, and then with the defaults."""

from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest
from agent_bench import HOVER, settings_of
from pilot_bench import seen

from rcopterx.agents.assembly import build_pilot
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.takeover import Handover
from rcopterx.agents.tuning.changes import Tuning
from rcopterx.agents.tuning.configuration import Configuration
from rcopterx.bus.codec import decode, encode
from rcopterx.bus.intent import FlownBy, Intent
from rcopterx.bus.message import FloatArray
from rcopterx.bus.messages import SetPoint
from rcopterx.bus.requests import RecallReply
from rcopterx.bus.session import BusAddress
from rcopterx.bus.subscription import Inbox

FILE = Configuration("pid", "kalman", {"horizon": 10})
CHANGED = Configuration("lqr", "extended_kalman", {"horizon": 12})
BEFORE = Configuration("pid", "finite_difference", {"horizon": 11})
DEFAULTS = Configuration("cascade", "extended_kalman", {"horizon": 10})


def flown_by(configuration: Configuration) -> FlownBy:
    return FlownBy(
        controller=configuration.controller,
        controller_settings=dict(configuration.controller_settings),  # type: ignore[arg-type]
        estimator=configuration.estimator,
    )


INTENT = Intent(
    phase="flying",
    epoch=1,
    frame=1,
    set_point=SetPoint(position_m=(0.0, 0.0, 1.0), yaw_rad=0.0),
    flown_by=flown_by(CHANGED),
    previous=flown_by(BEFORE),
)


class Launcher:
    """The session of an agent whose launcher remembers its predecessor."""

    life = 1

    def __init__(self, reply: RecallReply) -> None:
        self._reply = reply
        self.intents: list[Intent] = []

    def clock(self) -> float:
        return 0.0

    def subscribe(self, channel: Any, unit: str, depth: int, **_: object) -> Inbox[Any]:
        return Inbox(channel, depth, unit)

    def request(self, *_: object, **__: object) -> RecallReply:
        return self._reply

    def publish(self, _: object, __: str, intent: Intent) -> None:
        self.intents.append(decode(encode(intent), Intent))


class Restarted:
    """An agent that has been started again in flight."""

    def __init__(self, quick_deaths: int, intent: Intent | None = INTENT) -> None:
        settings = replace(
            settings_of(BusAddress(("tcp/127.0.0.1:1",), "lab")),
            configuration=Configuration("pid", "kalman", {"horizon": 10}),
        )  # fmt: skip
        self.pilot: Pilot = build_pilot(settings)
        self.tuning = Tuning(settings.configuration, self.pilot, 0.02)
        reply = RecallReply(accepted=intent is not None, intent=intent, quick_deaths=quick_deaths)
        self.launcher = Launcher(reply)
        self.handover = Handover(
            self.launcher,  # type: ignore[arg-type]  # answers like one
            settings,
            self.pilot,
            self.tuning,
        )
        self.pilot.observe(seen(1))
        self.pilot.note_applied("armed", -1, HOVER)
        self.handover.resume()

    def settle(self) -> Configuration:
        self.tuning.wait()
        self.tuning.finish()
        return self.tuning.configuration


@pytest.mark.parametrize(("quick_deaths", "flown"), [(0, CHANGED), (1, BEFORE), (2, DEFAULTS), (7, DEFAULTS)])
def test_every_quick_death_goes_one_step_back(quick_deaths: int, flown: Configuration) -> None:
    agent = Restarted(quick_deaths)
    assert agent.settle() == flown
    assert bool(agent.tuning.remark) == (quick_deaths > 0)


def test_the_defaults_fly_from_the_first_step_on() -> None:
    agent = Restarted(2)
    assert type(agent.pilot.controller).__name__ == "CascadeController"
    assert agent.pilot.control({}).reference is not None
    assert "died 3 times in a row" in agent.tuning.remark


def test_without_a_change_to_withdraw_the_same_flies_once_more() -> None:
    intent = msgspec.structs.replace(INTENT, previous=None)
    agent = Restarted(1, intent)
    assert agent.settle() == CHANGED
    assert not agent.tuning.remark


def test_a_predecessor_that_reported_nothing_is_followed_by_what_the_file_says_and_then_by_the_defaults() -> (
    None
):
    assert Restarted(1, None).settle() == FILE
    assert Restarted(2, None).settle() == DEFAULTS


def test_while_the_predecessors_settings_are_prepared_they_are_what_a_successor_is_told() -> None:
    agent = Restarted(0)
    agent.handover.publish(0.0)
    intent = agent.launcher.intents[-1]
    assert (intent.flown_by.controller, intent.previous) == ("lqr", INTENT.previous)
    agent.settle()


def test_a_change_tells_a_successor_what_flew_before() -> None:
    agent = Restarted(0)
    agent.settle()
    agent.tuning.begin(FILE)
    agent.settle()
    agent.handover.publish(0.0)
    intent = agent.launcher.intents[-1]
    assert intent.flown_by.controller == "pid"
    assert intent.previous is not None
    assert intent.previous.controller == "lqr"


def test_a_change_on_the_way_along_a_path_is_told_at_once_and_the_path_itself_only_now_and_then() -> None:
    knots = np.zeros((2, 13))
    knots[:, 3] = 1.0
    knots[1, :2] = (10.0, 0.5)
    agent = Restarted(0, msgspec.structs.replace(INTENT, path=FloatArray.of(knots)))
    agent.settle()
    agent.handover.publish(0.0)
    agent.handover.publish(0.0)
    assert len(agent.launcher.intents) == 1
    agent.tuning.begin(FILE)
    agent.settle()
    agent.handover.publish(0.0)
    intent = agent.launcher.intents[-1]
    assert intent.path is not None
    assert intent.flown_by.controller == "pid"


def test_what_somebody_chooses_ends_the_remark() -> None:
    agent = Restarted(2)
    agent.tuning.begin(FILE)
    assert agent.settle() == FILE
    assert not agent.tuning.remark
