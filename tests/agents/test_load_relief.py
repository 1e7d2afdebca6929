"""Promises of an agent that cannot keep up: what it decided takes effect by a note, and vehicles fly on."""

import numpy as np
import pytest
from agent_bench import Bench
from pilot_bench import airborne, noted, seen

from rcopterx.agents.load_relief import NEAREST, LoadRelief
from rcopterx.agents.overload import Relief
from rcopterx.agents.pacing import Pacing
from rcopterx.agents.separation.traffic import MOST, Traffic

LATE_S = 0.05


class NoteBus:
    """Takes notes, and lets them take effect when the test says so."""

    def __init__(self) -> None:
        self.notes: list[str] = []
        self.effective: set[str] = set()
        self.telling = True
        self.now_s = 10.0

    def clock(self) -> float:
        return self.now_s

    def note(self, word: str) -> None:
        self.notes.append(word)

    @property
    def words(self) -> set[str]:
        return self.effective

    def tell_steps(self, wanted: bool) -> None:
        self.telling = wanted


class Scene:
    def __init__(self) -> None:
        self.bus, self.pacing = NoteBus(), Pacing(0.02)
        self.traffic = Traffic("h1", None, lambda _: pytest.fail("nobody is near"))
        self.used_s = 0.0
        self.relief = LoadRelief(self.bus, 0.02, self.pacing, self.traffic, lambda: self.used_s)  # type: ignore[arg-type]  # what it needs of a bus

    def take_effect(self) -> bool:
        self.bus.effective, self.bus.notes = set(self.bus.notes[-1:]), []
        return self.relief.settle()

    def overload(self) -> None:
        while not self.bus.notes:
            self.relief.watch(LATE_S, flying=True)

    def doing(self) -> tuple[bool, int, int]:
        return self.bus.telling, self.traffic.most, self.pacing.every


def test_nothing_changes_before_the_note_takes_effect() -> None:
    scene = Scene()
    scene.overload()
    assert scene.relief.relief is Relief.NONE
    assert scene.relief.remark == ""
    assert scene.take_effect()
    assert scene.relief.relief is Relief.STATUSES
    scene.bus.effective.clear()
    assert not scene.relief.settle()


def test_one_thing_after_the_other_is_left_out_and_counted() -> None:
    scene = Scene()
    found = []
    for _ in range(4):
        scene.overload()
        scene.take_effect()
        found.append(scene.doing())
    assert found == [(True, MOST, 1), (False, MOST, 1), (False, NEAREST, 1), (False, NEAREST, 2)]
    assert scene.relief.remark.endswith("control at half rate")
    assert scene.relief.events == {
        "left_out_statuses": 1, "left_out_telemetry": 1, "left_out_far_plans": 1, "left_out_half_rate": 1
    }  # fmt: skip


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


def test_the_share_of_a_processor_is_that_since_the_last_look() -> None:
    scene = Scene()
    scene.used_s, scene.bus.now_s = 0.3, 12.0
    assert scene.relief.processor_share() == pytest.approx(0.15)
    scene.used_s, scene.bus.now_s = 0.8, 13.0
    assert scene.relief.processor_share() == pytest.approx(0.5)
    assert scene.relief.processor_share() == 0.0


def test_an_agent_at_half_rate_commands_every_second_frame_and_plans_for_the_other(bench: Bench) -> None:
    bench.start()
    bench.agent._bus.note("relief_4")
    bench.step_until(lambda: bench.agent._parts.pacing.every == 2, "half rate does not begin")
    if bench.frame % 2:
        bench.see()
    bench.sent.clear()
    missed_ticks = bench.agent._parts.pacing.missed_ticks
    for _ in range(4):
        bench.see()
        bench.see()
        bench.command_of(bench.frame)
    assert all(command.frame % 2 == 0 for command in bench.sent)
    assert bench.pilot.fallbacks["control_left_out"] >= 3
    bench.clock.advance(0.4)  # Statuses come half as often.
    diagnostics = bench.status().diagnostics
    assert diagnostics.missed_ticks == missed_ticks
    assert "half rate" in diagnostics.remarks[0]


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
    assert pilot.fallbacks["control_left_out"] == 1


def test_a_vehicle_on_the_floor_has_nothing_planned() -> None:
    pilot = noted()
    pilot.observe(seen(1, (0.0, 0.0, 0.0)))
    pilot.control({})
    pilot.fly_as_planned()
    assert pilot.fallbacks["control_left_out"] == 0


def test_periods_behind_which_it_lags_count_all_and_those_without_poses_once() -> None:
    lagging, blind = Scene(), Scene()
    for _ in range(4):
        for _ in range(5):
            lagging.pacing.on_overtaken()
        blind.pacing.missed_ticks += 5
        for scene in (lagging, blind):
            scene.relief.watch(0.0, flying=True)
    assert lagging.bus.notes
    assert not blind.bus.notes
