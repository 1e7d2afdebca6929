"""Promises of the judgement of links: one direction that is silent closes them, a short pause does not."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.records import replace

from rcopterx.bus.host_messages import Beat, Echo
from rcopterx.bus.link_watch import (
    LONGEST_PATIENCE_S,
    SAMPLES,
    SILENCE_S,
    STALL_S,
    LinkWatch,
    RouterLink,
)
from rcopterx.bus.links import BEAT_S

STALL_OF_A_LINK_S = 0.2
LATE_TURN_S = 0.03
"""Of a busy computer."""
LINK = RouterLink("b0", ("10.0.0.1", 7447), ("10.0.0.2", 50000))


class Pair:
    """A router at host `a` and what arrives from host `b`, in steps of a beat."""

    def __init__(self, speed: float = 1.0) -> None:
        self.now_s = 100.0
        self.watch = LinkWatch("a", "a0", self.now_s, speed)
        self._beat_s = BEAT_S * self.watch.slowness
        self.closed: list[tuple[float, RouterLink]] = []
        self._answered = (0.0, 0.0)

    def step(
        self, *, receives: bool = True, is_received: bool = True, links: tuple[RouterLink, ...] = (LINK,)
    ) -> None:
        self.now_s += self._beat_s
        if is_received:
            self._answered = (self.now_s - self._beat_s, self.now_s - 0.001)
        if receives:
            sent_s, arrived_s = self._answered
            echo = Echo(router="a0", sent_s=sent_s, held_s=self.now_s - arrived_s)
            beat = Beat(router=LINK.router, sent_s=self.now_s + 7000.0, time_of_day_s=0.0, echoes={"a": echo})
            self.watch.add_beat("b", beat, self.now_s)
        self.closed += [(self.now_s, link) for link in self.watch.broken(links, self.now_s)]

    def steps(self, count: int, **how: bool) -> None:
        for _ in range(count):
            self.step(**how)

    @property
    def linked(self) -> bool:
        return self.watch.states(["b"], self.now_s, 0.0)["b"].linked


def test_a_link_that_carries_both_directions_stays() -> None:
    pair = Pair()
    pair.steps(200)
    assert pair.closed == []
    assert pair.linked


@pytest.mark.parametrize(("receives", "is_received"), [(False, False), (False, True), (True, False)])
def test_a_link_is_closed_when_one_direction_is_silent(receives: bool, is_received: bool) -> None:
    pair = Pair()
    pair.steps(20)
    silent_s = pair.now_s
    pair.steps(16, receives=receives, is_received=is_received)
    assert pair.closed
    assert SILENCE_S < pair.closed[0][0] - silent_s < 2 * SILENCE_S + 2 * BEAT_S
    assert not pair.linked
    assert pair.watch.states(["b"], pair.now_s, 0.0)["b"].redials == len(pair.closed)


def test_a_silence_that_is_shorter_than_the_limit_closes_nothing() -> None:
    pair = Pair()
    pair.steps(20)
    pair.steps(2, receives=False, is_received=False)
    pair.steps(20)
    assert pair.closed == []


def test_a_link_that_stalls_between_two_beats_stays() -> None:
    pair = Pair()
    pair.steps(20)
    pair.now_s += STALL_OF_A_LINK_S
    assert pair.watch.due_s > pair.now_s + BEAT_S + LATE_TURN_S
    pair.steps(20)
    assert pair.closed == []


def test_a_silent_link_counts_as_one_redial_and_its_successor_stays() -> None:
    pair = Pair()
    pair.steps(20)
    pair.steps(8, receives=False, is_received=False)
    assert [link for _, link in pair.closed] == [LINK]
    assert pair.watch.states(["b"], pair.now_s, 0.0)["b"].redials == 1
    again = replace(LINK, remote=("10.0.0.2", 50004))
    for _ in range(20):
        pair.step(links=(again,))
    assert len(pair.closed) == 1


def test_a_new_link_is_not_blamed_for_the_silence_before_it() -> None:
    pair = Pair()
    pair.steps(20)
    for _ in range(40):
        pair.step(receives=False, is_received=False, links=())
    new = replace(LINK, remote=("10.0.0.2", 50001))
    for _ in range(3):
        pair.step(receives=False, is_received=False, links=(new,))
    for _ in range(40):
        pair.step(links=(new,))
    assert pair.closed == []


def test_redialling_in_vain_becomes_rare_and_begins_anew_when_it_helped() -> None:
    pair = Pair()
    pair.steps(20)
    pair.steps(600, receives=False, is_received=False)
    times_s = [at_s for at_s, _ in pair.closed]
    pauses_s = [later - earlier for earlier, later in pairwise(times_s)]
    assert all(pause_s <= LONGEST_PATIENCE_S + 2 * BEAT_S for pause_s in pauses_s)
    assert pauses_s[-1] >= LONGEST_PATIENCE_S
    pair.steps(5)
    pair.closed.clear()
    pair.steps(8, receives=False, is_received=False)
    assert len(pair.closed) == 1


def test_a_watch_that_was_asleep_closes_nothing_before_it_has_listened() -> None:
    pair = Pair()
    pair.steps(20)
    pair.now_s += 2.0
    assert pair.watch.broken((LINK,), pair.now_s) == []
    pair.steps(20)
    assert pair.closed == []


def test_a_neighbour_that_started_again_has_to_receive_beats_of_this_router_again() -> None:
    pair = Pair()
    pair.steps(20)
    again = replace(LINK, router="b1")
    pair.watch.add_beat("b", Beat(router="b1", sent_s=3.0, time_of_day_s=0.0, echoes={}), pair.now_s)
    assert not pair.linked
    for _ in range(10):
        pair.now_s += BEAT_S
        pair.watch.add_beat(
            "b", Beat(router="b1", sent_s=pair.now_s, time_of_day_s=0.0, echoes={}), pair.now_s
        )
        pair.closed += [(pair.now_s, link) for link in pair.watch.broken((again,), pair.now_s)]
    assert pair.closed


def test_beats_that_waited_while_the_link_hung_are_counted_as_late() -> None:
    watch = LinkWatch("a", "a0", 0.0)
    for number in range(10):
        watch.add_beat(
            "b",
            Beat(router="b0", sent_s=number * BEAT_S, time_of_day_s=0.0, echoes={}),
            number * BEAT_S + 0.002,
        )
    assert watch.states(["b"], 0.5, 0.0)["b"].late == 0
    for number in range(10, 14):
        watch.add_beat("b", Beat(router="b0", sent_s=number * BEAT_S, time_of_day_s=0.0, echoes={}), 1.5)
    assert watch.states(["b"], 1.5, 0.0)["b"].late == 4


def test_beats_are_late_against_the_recent_ones_only() -> None:
    watch = LinkWatch("a", "a0", 0.0)
    for number in range(3 * SAMPLES):
        slower_s = 0.002 if number < SAMPLES else 0.2
        beat = Beat(router="b0", sent_s=number * BEAT_S, time_of_day_s=0.0, echoes={})
        watch.add_beat("b", beat, number * BEAT_S + slower_s)
    assert watch.states(["b"], 0.5, 0.0)["b"].late == SAMPLES - 1


def test_the_round_trip_leaves_out_how_long_the_other_host_held_the_beat() -> None:
    watch = LinkWatch("a", "a0", 0.0)
    echo = Echo(router="a0", sent_s=1.0, held_s=0.04)
    watch.add_beat("b", Beat(router="b0", sent_s=9000.0, time_of_day_s=0.0, echoes={"a": echo}), 1.043)
    assert watch.states(["b"], 1.05, 0.0)["b"].round_trip_s == pytest.approx(0.003)


def test_offsets_of_clocks_of_another_host_are_measured() -> None:
    watch = LinkWatch("a", "a0", 0.0)
    # Its monotonic clock is 7000 s ahead of ours, its time of day 0.25 s; the way takes 1 ms each time.
    echo = Echo(router="a0", sent_s=10.0, held_s=0.02)
    beat = Beat(router="b0", sent_s=7010.021, time_of_day_s=5010.271, echoes={"a": echo})
    watch.add_beat("b", beat, 10.022)
    state = watch.states(["b"], 10.05, 5010.05)["b"]
    assert state.monotonic_offset_s == pytest.approx(7000.0)
    assert state.clock_offset_s == pytest.approx(0.25)
    assert state.round_trip_s == pytest.approx(0.002)


def test_a_beat_echoes_the_newest_of_every_host_and_how_long_it_was_held() -> None:
    watch = LinkWatch("a", "a0", 0.0)
    watch.add_beat("b", Beat(router="b0", sent_s=70.0, time_of_day_s=0.0, echoes={}), 1.0)
    watch.add_beat("c", Beat(router="c0", sent_s=80.0, time_of_day_s=0.0, echoes={}), 1.02)
    beat = watch.beat(1.05, 5e8)
    assert (beat.router, beat.sent_s, beat.time_of_day_s) == ("a0", 1.05, 5e8)
    assert beat.echoes["b"] == Echo(router="b0", sent_s=70.0, held_s=pytest.approx(0.05))
    assert beat.echoes["c"].held_s == pytest.approx(0.03)


def test_a_host_without_beats_is_not_linked() -> None:
    state = LinkWatch("a", "a0", 0.0).states(["b"], 1.0, 0.0)["b"]
    assert (state.linked, state.redials, state.late, state.round_trip_s) == (False, 0, 0, None)


@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=120))
def test_whatever_arrives_a_silent_link_is_closed_in_time_and_a_live_one_never(
    received: list[tuple[bool, bool]],
) -> None:
    pair = Pair()
    pair.steps(20)
    good = 0
    for receives, is_received in received:
        before = len(pair.closed)
        pair.step(receives=receives, is_received=is_received)
        good = good + 1 if receives and is_received else 0
        # Two good beats in a row: the second one contains the echo of the first.
        if good >= 2:
            assert len(pair.closed) == before
            assert pair.linked
    pair.steps(int((2 * LONGEST_PATIENCE_S) / BEAT_S) + 2, receives=False, is_received=False)
    assert pair.closed


def test_the_stall_limit_leaves_room_for_late_turns() -> None:
    assert 2 * BEAT_S < STALL_S < SILENCE_S


def test_the_watch_knows_when_a_silent_link_is_to_be_closed() -> None:
    pair = Pair()
    pair.steps(20)
    received_s = pair.now_s
    pair.step(receives=False, is_received=False)
    assert pair.watch.due_s == pytest.approx(received_s + SILENCE_S)
    assert pair.watch.broken((LINK,), pair.watch.due_s - 1e-6) == []
    assert pair.watch.broken((LINK,), pair.watch.due_s + 1e-6) == [LINK]
    assert pair.watch.due_s == math.inf


def test_a_router_without_beats_is_dialled_for_hours() -> None:
    watch = LinkWatch("a", "a0", 0.0)
    closed = sum(bool(watch.broken((LINK,), 0.2 * turn)) for turn in range(30_000))
    assert closed > 2000


@pytest.mark.parametrize(("speed", "factor"), [(2.0, 1.0), (0.5, 2.0), (0.02, 10.0)])
def test_in_slow_motion_beats_and_limits_are_slower_up_to_ten_times(speed: float, factor: float) -> None:
    pair = Pair(speed)
    assert pair.watch.slowness == factor
    pair.steps(50)
    assert pair.closed == []
    assert pair.linked
    silent_s = pair.now_s
    pair.steps(12, receives=False, is_received=False)
    closed_s, _ = pair.closed[0]
    assert SILENCE_S * factor < closed_s - silent_s < 2 * (SILENCE_S + BEAT_S) * factor
    assert not pair.linked
