"""Promises of the agent on the bus: when it commands, when it keeps silent, and what it says of itself."""

import threading

import numpy as np
import pytest
from agent_bench import FOLLOWING, HOVER, LEASE, Bench, Join
from support.bus import raw_session
from support.plans import plan_of
from support.vehicle_types import COAXIAL_LAG
from support.waiting import DEADLINE_S

from rcopterx.agents.estimation import BLIND_LIMIT_S
from rcopterx.agents.flight.timeline import INPUT_UNIT
from rcopterx.agents.process import Agent
from rcopterx.agents.reporting import error_m
from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.messages import Plan
from rcopterx.bus.requests import TakeOff, Tune
from rcopterx.bus.session import BusAddress, RequestFailedError
from rcopterx.bus.stepping import StepBus
from rcopterx.bus.wakeup import Wakeup


@pytest.fixture
def follower(join: Join, bus_address: BusAddress) -> Bench:
    return Bench(join, bus_address, FOLLOWING)


def test_nothing_is_commanded_before_vehicle_and_transmitter_are_known(bench: Bench) -> None:
    def seen() -> bool:
        bench.frame += 1
        bench.pose()
        return bench.pilot.clock.started

    bench.step_until(seen, "no pose arrives")
    for _ in range(5):
        bench.see()
    assert bench.agent.control_by_s is None
    bench.start("disarmed", 0.0)
    assert bench.sent
    first_known = min(command.frame for command in bench.sent)
    assert first_known > 105


def test_on_the_floor_every_pose_is_answered_by_thrust_zero(bench: Bench) -> None:
    bench.start("disarmed", 0.0)
    for _ in range(5):
        bench.see()
        command = bench.command_of(bench.frame)
        assert command.input == (0.0, 0.0, 0.0, 0.0)
        assert command.lease == LEASE
        assert (command.epoch, command.period_s) == (1, 0.02)
    sequences = [command.sequence for command in bench.sent]
    assert sequences == sorted(set(sequences))


def test_in_the_air_command_and_plan_carry_the_frame_they_answer(bench: Bench) -> None:
    bench.start()
    bench.see()
    command = bench.command_of(bench.frame)
    assert command.input == pytest.approx(tuple(HOVER), abs=INPUT_UNIT)
    assert command.next_inputs.shape == (6, 4)
    plans: list[Plan] = []

    def planned() -> bool:
        plans.extend(received.message for received in bench.plans.drain())
        return any(plan.frame == bench.frame for plan in plans)

    bench.step_until(planned, "no plan")
    plan = plans[-1]
    assert (plan.source, plan.airborne, plan.ancestors, plan.start_s) == ("h9", True, (), COAXIAL_LAG.delay_s)


def test_a_command_tells_when_it_passed_each_stage_unless_its_frame_was_predicted(bench: Bench) -> None:
    bench.start()
    bench.see()
    timing = bench.command_of(bench.frame).timing
    assert timing is not None
    assert (timing.gateway_host, timing.agent_host, timing.received_s) == ("main", "main", 0.0)
    assert timing.arrived_s == pytest.approx(bench.clock(), abs=0.02)
    assert timing.ready_s >= timing.began_s
    bench.clock.advance(0.0301)
    assert bench.command_of(bench.frame + 1).timing is None


def test_a_silent_tracker_is_bridged_by_prediction_up_to_a_limit(bench: Bench) -> None:
    bench.start()
    last = bench.frame
    for number in range(1, 6):
        bench.clock.advance(0.02 if number > 1 else 0.0301)
        bench.command_of(last + number)
    bench.clock.advance(5.0)
    for _ in range(200):
        bench.agent.step()
    assert not bench.pilot.ready
    bench.clock.advance(0.02)
    bench.agent.step()
    assert bench.agent.control_by_s is None
    assert 5 <= bench.status().diagnostics.fallbacks["pose_extrapolated"] <= round(BLIND_LIMIT_S / 0.02)


def test_an_occluded_vehicle_is_commanded_for_a_while_and_then_left_to_its_gateway(bench: Bench) -> None:
    bench.start()
    for _ in range(3):
        bench.see(occluded=True)
        bench.command_of(bench.frame)
    for _ in range(30):
        bench.see(occluded=True)
    answered = {command.frame for command in bench.sent}
    assert bench.frame not in answered
    bench.see()
    bench.command_of(bench.frame)


def test_a_command_that_two_frames_at_once_left_no_time_for_is_counted_as_missed(bench: Bench) -> None:
    bench.start()
    sent, missed = len(bench.sent), bench.agent.pacing.missed_ticks
    bench.clock.advance(0.02)
    for _ in range(2):
        bench.frame += 1
        bench.agent.poses.store(encode(bench.pose(publish=False)), bench.clock())
    bench.command_of(bench.frame)
    assert len(bench.sent) == sent + 1
    assert bench.agent.pacing.missed_ticks == missed + 1


def test_poses_that_waited_while_the_agent_was_stopped_cause_no_commands(bench: Bench) -> None:
    bench.start()
    sent = len(bench.sent)
    bench.clock.advance(2.0)
    for _ in range(20):
        bench.frame += 1
        bench.clock.advance(0.001)
        bench.agent.poses.store(encode(bench.pose(publish=False)), bench.clock())
        bench.agent.step()
    bench.see()
    bench.command_of(bench.frame)
    assert [command.frame for command in bench.sent[sent:]] == [bench.frame]


@pytest.mark.parametrize("topic", ["pose", "applied"])
def test_malformed_messages_are_counted_in_the_status_and_the_vehicle_flies_on(
    bench: Bench, bus_address: BusAddress, topic: str
) -> None:
    bench.start()
    inboxes = {"pose": bench.agent.poses, "applied": bench.agent.applied}
    with raw_session(bus_address) as stranger:

        def counted() -> bool:
            stranger.put(channels.key("lab", "h9", topic), b"\xc1")
            return bool(inboxes[topic].rejected)

        bench.step_until(counted, "not counted")
    bench.see()
    bench.command_of(bench.frame)
    assert bench.status().diagnostics.rejected[f"{topic}.malformed"] >= 1


def test_durations_of_control_steps_are_reported_as_percentiles_in_milliseconds(bench: Bench) -> None:
    bench.start()
    solve_ms = bench.agent.relief.solve_ms
    solve_ms.clear()
    assert bench.status().diagnostics.solve_ms_max == 0.0
    solve_ms.extend(map(float, range(1, 101)))
    diagnostics = bench.status().diagnostics
    assert 45.0 < diagnostics.solve_ms_p50 < 55.0
    assert 95.0 < diagnostics.solve_ms_p99 < diagnostics.solve_ms_max == 100.0


def test_a_follower_waits_for_its_leaders_plan_of_the_same_frame(follower: Bench) -> None:
    follower.start()
    missing = follower.pilot.guidance.events["leader_plan_missing"]
    follower.see()
    assert follower.agent.control_by_s is not None
    follower.others.publish(channels.PLAN, "h1", plan_of("h1", follower.frame))
    follower.command_of(follower.frame)
    assert follower.pilot.guidance.events["leader_plan_missing"] == missing


def test_a_follower_waits_for_a_silent_leader_only_until_its_deadline(follower: Bench) -> None:
    follower.start()
    follower.see()
    follower.clock.advance(0.0039)
    follower.agent.step()
    assert follower.frame not in {command.frame for command in follower.sent}
    follower.clock.advance(0.0002)
    follower.command_of(follower.frame)
    assert follower.pilot.guidance.events["leader_plan_missing"] >= 1


def test_a_plan_of_the_frame_before_is_used_after_the_deadline(follower: Bench) -> None:
    follower.start()
    follower.see()
    follower.others.publish(channels.PLAN, "h1", plan_of("h1", follower.frame, position_m=(0.5, 0.0, 1.0)))
    follower.command_of(follower.frame)
    missing = follower.pilot.guidance.events["leader_plan_missing"]
    follower.see()
    follower.clock.advance(0.005)
    follower.command_of(follower.frame)
    assert follower.pilot.guidance.events["leader_plan_missing"] == missing


def test_a_plan_that_comes_too_late_is_counted(follower: Bench) -> None:
    follower.start()
    follower.see()
    follower.others.publish(channels.PLAN, "h1", plan_of("h1", follower.frame))
    follower.command_of(follower.frame)
    late = follower.pilot.events["leader_plan_late"]
    follower.see()
    follower.clock.advance(0.005)
    follower.command_of(follower.frame)
    assert follower.pilot.events["leader_plan_late"] == late + 1


def test_plans_wake_a_follower_only_while_it_waits_for_them(follower: Bench) -> None:
    follower.start()
    plans = follower.agent.following.plans
    assert not plans.awaited
    follower.see()
    assert plans.awaited
    follower.clock.advance(0.005)
    follower.command_of(follower.frame)
    assert not plans.awaited


def test_a_pose_that_comes_late_while_its_bridged_frame_waits_for_a_plan_is_no_missed_period(
    follower: Bench,
) -> None:
    follower.start()
    follower.see()
    follower.clock.advance(0.005)
    follower.command_of(follower.frame)
    missed = follower.agent.pacing.missed_ticks
    follower.clock.advance(0.0261)
    bridged = follower.frame + 1
    follower.step_until(lambda: follower.agent.control_by_s is not None, "the late frame is not bridged")
    assert follower.pilot.clock.current_frame == bridged
    follower.clock.advance(-0.0199)
    follower.see()
    assert follower.frame == bridged
    follower.clock.advance(0.005)
    follower.command_of(bridged)
    assert follower.agent.pacing.missed_ticks == missed


def test_a_follower_of_a_follower_waits_longer(follower: Bench) -> None:
    follower.start()
    follower.see()
    follower.others.publish(channels.PLAN, "h1", plan_of("h1", follower.frame, ancestors=("h3",)))
    follower.command_of(follower.frame)
    follower.see()
    assert follower.agent.control_by_s == pytest.approx(
        follower.clock() + 2 * follower.settings.leader_wait_s
    )


def test_the_status_tells_task_phase_and_leaders(follower: Bench) -> None:
    follower.start()
    status = follower.status()
    assert (status.phase, status.diagnostics.horizon, status.epoch) == ("flying", 8, 1)
    assert [link.leader for link in status.following] == ["h1"]
    assert status.position_m == pytest.approx((0.0, 0.0, 1.0), abs=0.2)
    assert status.diagnostics.fallbacks["leader_plan_missing"] >= 1
    assert status.diagnostics.ticks > 0


def test_the_status_tells_how_far_the_vehicle_is_from_its_reference(follower: Bench) -> None:
    follower.start()
    follower.see()
    follower.clock.advance(0.005)
    follower.command_of(follower.frame)
    pilot = follower.pilot
    assert pilot.plan is not None
    assert pilot.reference is not None
    pilot.reference = pilot.plan.samples[0, :4] + np.array([0.3, 0.4, 0.0, 1.0])
    assert error_m(pilot) == pytest.approx(0.5, abs=1e-4)


def test_requests_reach_the_pilot_and_refusals_come_back(bench: Bench) -> None:
    bench.start("disarmed", 0.0)
    answers: list[str] = []

    def ask() -> None:
        try:
            answers.append(
                bench.others.request("h9", TakeOff(), timeout_s=DEADLINE_S, patience_s=DEADLINE_S).reason
            )
        except RequestFailedError as error:
            answers.append(str(error))

    asker = threading.Thread(target=ask)
    asker.start()
    bench.step_until(lambda: answers, "no answer")
    asker.join()
    assert answers == ["take-off needs an armed vehicle on the floor, the phase is ground"]


def test_an_agent_wakes_by_itself_when_what_was_tuned_is_ready(join: Join, bus_address: BusAddress) -> None:
    bench, wakeup = Bench(join, bus_address), Wakeup()
    agent = Agent(
        bench.settings, bench.pilot, StepBus(join(clock=bench.clock, waiter=wakeup)), realtime=False
    )
    wakeup.wait(0.0)
    agent.tuning.begin(agent.tuning.configuration.changed(Tune(controller="lqr")))
    wakeup.wait(DEADLINE_S)
    assert isinstance(agent.tuning.finish(), str)
