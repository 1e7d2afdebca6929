"""Promises of an agent that cannot keep up: what it decided takes effect by a note, and vehicles fly on."""

from collections import Counter

import numpy as np
import pytest
from agent_bench import Bench
from pilot_bench import HOVER, airborne, noted, seen
from support.failing import FailingController
from support.flight import NotedController

from rcopterx.agents.following.traffic import MOST, Traffic
from rcopterx.agents.load import Pacing, Relief
from rcopterx.agents.relief import NEAREST, LoadRelief
from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.host_messages import LauncherStatus
from rcopterx.bus.subscription import Inbox

LATE_S = 0.05


FLIES = (10, 13, 15, 17)
"""How many vehicles a computer flies at full, half, third and quarter rate."""


class NoteBus:
    """Takes notes, and lets them take effect when the test says so."""

    def __init__(self) -> None:
        self.notes: list[str] = []
        self.effective: set[str] = set()
        self.publishing = True
        self.now_s = 10.0

    def clock(self) -> float:
        return self.now_s

    def note(self, word: str) -> None:
        self.notes.append(word)

    @property
    def events(self) -> set[str]:
        return self.effective


class Scene:
    def __init__(self) -> None:
        self.launcher = Inbox(channels.LAUNCHER)
        self.bus, self.pacing = NoteBus(), Pacing(0.02)
        self.traffic = Traffic("h1", None, lambda _: pytest.fail("no vehicle is near"))
        self.relief = LoadRelief(
            self.bus,  # type: ignore[arg-type]  # what it needs of a bus
            0.02,
            self.pacing,
            self.traffic,
            self.launcher,
            Counter(),
        )

    def take_effect(self) -> bool:
        self.bus.effective, self.bus.notes = set(self.bus.notes[-1:]), []
        return self.relief.update()

    def receive(self, agents: int, flies: tuple[int, ...]) -> bool:
        """A status of the launcher takes effect at the next step, without a note."""
        status = LauncherStatus(running=tuple(f"h{n}" for n in range(agents)), absent=(), flies=flies)
        self.launcher.store(encode(status), self.bus.now_s)
        self.bus.effective = set()
        return self.relief.update()

    def overload(self) -> None:
        self.bus.notes = []
        while not self.bus.notes:
            self.relief.watch(LATE_S, flying=True)

    def doing(self) -> tuple[bool, int, int]:
        return self.bus.publishing, self.traffic.most, self.pacing.every


def test_nothing_changes_before_the_note_takes_effect() -> None:
    scene = Scene()
    scene.overload()
    assert scene.relief.relief is Relief.NONE
    assert scene.relief.remark == ""
    assert scene.take_effect()
    assert scene.relief.relief is Relief.REPORTS
    scene.bus.effective.clear()
    assert not scene.relief.update()


def test_one_thing_after_the_other_is_left_out_and_counted() -> None:
    scene = Scene()
    found = []
    for _ in range(3):
        scene.overload()
        scene.take_effect()
        scene.relief.watch(0.0, flying=True)
        found.append(scene.doing())
    assert found == [(False, NEAREST, 1), (False, NEAREST, 2), (False, NEAREST, 3)]
    assert scene.relief.remark.endswith("control at third rate")
    assert scene.relief.events == {"left_out_reports": 1, "left_out_half_rate": 1, "left_out_third_rate": 1}


def test_on_the_floor_everything_is_done_again() -> None:
    scene = Scene()
    for _ in range(4):
        scene.overload()
        scene.take_effect()
    scene.relief.watch(LATE_S, flying=False)
    assert scene.take_effect()
    assert scene.doing() == (True, MOST, 1)
    assert scene.relief.remark == ""


def test_missed_periods_count_as_late() -> None:
    scene = Scene()
    for _ in range(100):
        scene.pacing.missed_ticks += 1
        scene.relief.watch(0.0, flying=True)
    assert scene.bus.notes


def test_an_agent_at_half_rate_commands_every_second_frame_and_plans_for_the_other(bench: Bench) -> None:
    bench.start()
    bench.bus.note("relief_2")
    bench.step_until(lambda: bench.agent.pacing.every == 2, "half rate does not begin")
    # The second vehicle of the fleet, so its turn is with odd frames.
    if bench.frame % 2 == 0:
        bench.see()
    bench.sent.clear()
    missed_ticks = bench.agent.pacing.missed_ticks
    for _ in range(4):
        bench.see()
        bench.see()
        bench.command_of(bench.frame)
    assert all(command.frame % 2 == 1 for command in bench.sent)
    assert bench.pilot.events["control_left_out"] >= 3
    bench.clock.advance(0.4)  # Statuses come half as often.
    diagnostics = bench.status().diagnostics
    assert diagnostics.missed_ticks == missed_ticks
    assert "half rate" in diagnostics.remarks[0]


def test_an_agent_at_quarter_rate_rests_until_shortly_before_its_turn(bench: Bench) -> None:
    bench.start()
    status = LauncherStatus(running=("h1", "h9"), absent=(), flies=(0, 1, 1, 2))

    def ordered() -> bool:
        bench.others.publish(channels.LAUNCHER, "main", status)
        return bench.agent.relief.relief is Relief.QUARTER_RATE

    bench.step_until(ordered, "the agent receives no order of the launcher")
    for _ in range(8):
        bench.see()
    assert bench.agent.pacing.every == 4
    rests_s = []
    for _ in range(4):
        bench.see()
        seen = bench.agent.seen
        assert seen is not None
        rests_s.append(bench.agent.rest_until_s - seen.arrived_s)
    assert sorted(rests_s) == pytest.approx([0.0, 0.0, 0.0, 3.5 * 0.02])


def test_a_period_that_is_left_out_is_predicted_with_the_input_planned_for_it() -> None:
    rows = np.array([[0.01 * row, 0.0, 0.5, 0.0] for row in range(7)])
    pilot = airborne(noted(inputs=rows))
    pilot.observe(seen(1))
    output = pilot.control({})
    pilot.observe(seen(2))
    sequence = pilot.sequence
    pilot.fly_as_planned()
    assert pilot.sequence == sequence
    assert np.array_equal(pilot.input_history.newest, output.next_inputs[0])
    assert pilot.events["control_left_out"] == 1


def test_the_plan_of_a_step_that_fails_later_is_that_of_the_time_although_periods_were_left_out() -> None:
    pilot = airborne(noted())
    rows = HOVER + 0.01 * np.arange(30)[:, None]
    pilot.use_controller(FailingController(NotedController(rows, horizon=31), [None, "raises"]))
    pilot.control({})
    for frame in (1, 2, 3):
        pilot.observe(seen(frame))
        pilot.fly_as_planned()
    pilot.observe(seen(4))
    assert pilot.control({}).input[0] == pytest.approx(rows[4, 0], abs=1e-3)


def test_a_vehicle_on_the_floor_has_nothing_planned() -> None:
    pilot = noted()
    pilot.observe(seen(1, (0.0, 0.0, 0.0)))
    pilot.control({})
    pilot.fly_as_planned()
    assert pilot.events["control_left_out"] == 0


def test_periods_behind_which_it_lags_count_all_and_those_without_poses_once() -> None:
    lagging, blind = Scene(), Scene()
    lagging.pacing.on_begin(1, 0, flying=True)
    for turn in range(4):
        for place in range(5):
            lagging.pacing.on_begin(1, 1 + 5 * turn + place, flying=True)
        blind.pacing.missed_ticks += 5
        for scene in (lagging, blind):
            scene.relief.watch(0.0, flying=True)
    assert lagging.bus.notes
    assert not blind.bus.notes


def test_where_more_agents_run_than_the_computer_serves_half_rate_is_planned() -> None:
    scene = Scene()
    assert not scene.receive(agents=10, flies=())
    assert not scene.receive(agents=10, flies=FLIES)
    assert scene.receive(agents=11, flies=FLIES)
    assert scene.doing() == (False, NEAREST, 2)
    assert "more agents" in scene.relief.remark
    assert "half rate" in scene.relief.remark
    assert not scene.receive(agents=11, flies=FLIES)
    # Neither calm nor a landing ends it.
    for flying in (True, False):
        for _ in range(2000):
            scene.relief.watch(0.0, flying)
    assert scene.bus.notes == []
    assert scene.receive(agents=10, flies=FLIES)
    assert scene.doing() == (True, MOST, 1)


@pytest.mark.parametrize(
    ("agents", "flies", "relief"),
    [
        (10, FLIES, Relief.NONE),
        (11, FLIES, Relief.HALF_RATE),
        (13, FLIES, Relief.HALF_RATE),
        (14, FLIES, Relief.THIRD_RATE),
        (16, FLIES, Relief.QUARTER_RATE),
        (99, FLIES, Relief.QUARTER_RATE),
        (1, (0, 0, 0, 0), Relief.QUARTER_RATE),
    ],
)
def test_the_more_agents_too_many_the_lower_the_rate(
    agents: int, flies: tuple[int, ...], relief: Relief
) -> None:
    scene = Scene()
    scene.receive(agents, flies)
    assert scene.relief.relief is relief


def test_on_the_floor_the_rate_is_never_below_half_because_arming_asks_for_fresh_commands() -> None:
    scene = Scene()
    scene.receive(agents=16, flies=FLIES)
    assert scene.pacing.every == 2
    scene.relief.watch(0.0, flying=True)
    assert scene.pacing.every == 4
    assert "quarter rate" in scene.relief.remark
    scene.relief.watch(0.0, flying=False)
    assert scene.pacing.every == 2


def test_what_was_decided_under_another_load_is_forgotten() -> None:
    scene = Scene()
    for _ in range(2):
        scene.overload()
        scene.take_effect()
    assert scene.receive(agents=11, flies=FLIES)
    assert scene.receive(agents=10, flies=FLIES)
    assert scene.relief.relief is Relief.NONE
    scene.overload()
    scene.take_effect()
    assert scene.relief.relief is Relief.REPORTS


def test_commands_that_are_late_on_the_floor_are_reported() -> None:
    scene = Scene()
    assert scene.relief.overload.late_share == 0.0
    for _ in range(50):
        scene.relief.watch(LATE_S, flying=False)
    assert scene.relief.overload.late_share == 1.0
    assert scene.bus.notes == []
