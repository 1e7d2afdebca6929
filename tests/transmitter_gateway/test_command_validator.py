import math
from collections import Counter
from copy import copy
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from rcopterx.bus.message import LONGEST_PERIOD_S, MAX_COUNT, SHORTEST_PERIOD_S
from rcopterx.bus.messages import MAX_NEXT_INPUTS
from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway.command_validator import CommandValidator, Rejection
from rcopterx.transmitter_gateway.inputs import CommandInput, PoseInput

GOOD = CommandInput(1, epoch=5, sequence=10, frame=100, u=(0.1, -0.2, 0.5, 0.0), next_u=((0, 0, 0.5, 0),))


def validator_of(limits: ArbiterLimits, counters: Counter[str]) -> CommandValidator:
    """A validator that has issued the lease of `GOOD`."""
    validator = CommandValidator(limits, counters)
    assert validator.leases.bid(99, 0.0, fresh=False, take_over=False) == GOOD.lease
    return validator


class Gate:
    def __init__(self) -> None:
        self.counters: Counter[str] = Counter()
        self.validator = validator_of(ArbiterLimits(), self.counters)

    def consider(
        self,
        command: CommandInput = GOOD,
        now_s: float = 1.0,
        pose_epoch: int | None = 5,
        pose_frame: int = 100,
        latency_s: float = 0.0,
        epoch_age_s: float = 0.0,
        flying: bool = False,
        **changes: Any,
    ) -> Rejection | None:
        return self.validator.consider(
            structs.replace(command, **changes),
            now_s,
            pose=None
            if pose_epoch is None
            else PoseInput("h1", pose_epoch, pose_frame, None, 0.02, latency_s=latency_s),
            epoch_age_s=epoch_age_s,
            flying=flying,
        )


def test_a_good_command_is_accepted_and_kept() -> None:
    gate = Gate()
    assert gate.consider(period_s=0.025) is None
    assert gate.validator.stream.command.period_s == 0.025
    stream = gate.validator.stream
    assert stream.command.u == (0.1, -0.2, 0.5, 0.0)
    assert stream.command.next_u == ((0.0, 0.0, 0.5, 0.0),)
    assert stream.arrival_s == 1.0
    assert stream.low_since_s is None
    assert not gate.counters


@pytest.mark.parametrize(
    "changes",
    [
        {"lease": "1"},
        {"lease": None},
        {"lease": -1},
        {"sequence": 2**53 + 1},
        {"frame": 2**64},
        {"epoch": -1},
        {"epoch": True},
        {"epoch": 5.0},
        {"sequence": "11"},
        {"frame": None},
        {"u": None},
        {"u": 0.5},
        {"u": (0.1, 0.1, 0.5)},
        {"u": (0.1, 0.1, 0.5, 0.0, 0.0)},
        {"u": ("0.1", 0.1, 0.5, 0.0)},
        {"u": "0000"},
        {"u": (True, 0.1, 0.5, 0.0)},
        {"u": (1j, 0.1, 0.5, 0.0)},
        {"next_u": None},
        {"next_u": (0.1, 0.1, 0.5, 0.0)},
        {"next_u": ((0.1, 0.1, 0.5),)},
        {"next_u": ((0.0, 0.0, 0.5, 0.0),) * 91},
        {"period_s": "0.02"},
        {"period_s": None},
        {"period_s": True},
    ],
    ids=str,
)
def test_malformed_commands_are_rejected_and_counted(changes: dict[str, Any]) -> None:
    gate = Gate()
    assert gate.consider(**changes) is Rejection.MALFORMED
    assert gate.counters == {Rejection.MALFORMED: 1}
    assert gate.validator.stream is None


def test_the_largest_count_is_accepted() -> None:
    assert Gate().consider(sequence=MAX_COUNT) is None
    assert Gate().consider(sequence=MAX_COUNT + 1) is Rejection.MALFORMED


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(4))
def test_values_that_are_not_finite_are_rejected(bad: float, place: int) -> None:
    u = [0.0, 0.0, 0.5, 0.0]
    u[place] = bad
    for changes in ({"u": u}, {"next_u": [u]}):
        assert Gate().consider(**changes) is Rejection.NOT_FINITE
    assert Gate().consider(period_s=bad) is Rejection.NOT_FINITE


@pytest.mark.parametrize(
    ("place", "limit", "outward"),
    [(0, 1, 1), (0, -1, -1), (1, 1, 1), (1, -1, -1), (2, 1, 1), (2, 0, -1), (3, 0.4, 1), (3, -0.4, -1)],
)
def test_values_a_little_outside_are_clamped_and_further_outside_rejected(
    place: int, limit: float, outward: int
) -> None:
    u = [0.0, 0.0, 0.5, 0.0]
    u[place] = limit + outward * 0.0199
    gate = Gate()
    assert gate.consider(u=u, next_u=[u]) is None
    command = gate.validator.stream.command
    assert command.u[place] == limit
    assert command.next_u[0][place] == limit
    u[place] = limit + outward * 0.0201
    assert Gate().consider(u=u) is Rejection.OUT_OF_LIMITS
    assert Gate().consider(next_u=[u]) is Rejection.OUT_OF_LIMITS


@pytest.mark.parametrize("period_s", [0.0, -0.02, 0.0019, 3e-8, 5e-324, 0.0501])
def test_command_periods_out_of_range_are_rejected(period_s: float) -> None:
    assert Gate().consider(period_s=period_s) is Rejection.OUT_OF_LIMITS
    assert Gate().consider(period_s=LONGEST_PERIOD_S) is None
    assert Gate().consider(period_s=SHORTEST_PERIOD_S) is None


def test_numbers_of_any_real_type_are_taken() -> None:
    gate = Gate()
    assert gate.consider(u=np.array([0.1, 0.2, 0.5, 0.0], dtype=np.float32), next_u=np.zeros((6, 4))) is None
    assert gate.consider(u=(0, Fraction(1, 4), 1, 0), sequence=11) is None
    assert all(type(value) is float for value in gate.validator.stream.command.u)


NEARLY_RIGHT = st.sampled_from(
    [0.0, -0.0, 0.3, 1.0, 1.01, 1.03, -1.0, -1.01, 0.4, 0.41, -0.02, 1, True, math.nan, math.inf, -math.inf]
)


@given(st.lists(st.lists(NEARLY_RIGHT, min_size=3, max_size=5), min_size=1, max_size=4))
def test_whole_plans_are_judged_as_if_every_number_was_looked_at(plan: list[list[float]]) -> None:
    at_once, one_by_one = Gate(), Gate()
    tuples = [tuple(values) for values in plan]
    assert at_once.consider(u=tuples[0], next_u=tuples[1:]) is one_by_one.consider(u=plan[0], next_u=plan[1:])
    assert at_once.validator.stream == one_by_one.validator.stream


def test_counting_may_start_at_zero() -> None:
    assert Gate().consider(epoch=0, sequence=0, frame=0, pose_epoch=0, pose_frame=0) is None


def test_values_exactly_at_the_tolerance_are_accepted() -> None:
    limits = ArbiterLimits(tolerance=0.25)
    for u in ((1.25, 0, 0.5, 0), (-1.25, 0, 0.5, 0), (0, 0, 1.25, 0), (0, 0, -0.25, 0)):
        validator = validator_of(limits, Counter())
        assert (
            validator.consider(
                structs.replace(GOOD, u=u), 1.0, pose=PoseInput("h1", 5, 100, None), flying=False
            )
            is None
        )


def test_gap_exactly_at_the_limit_is_a_gap() -> None:
    gate = Gate()
    gate.validator = validator_of(ArbiterLimits(hold_after_s=0.0625), gate.counters)
    gate.consider(u=(0, 0, 0, 0))
    gate.consider(sequence=11, now_s=1.0625, u=(0, 0, 0, 0))
    assert gate.validator.stream.low_since_s == 1.0625


def test_longest_plan_is_accepted() -> None:
    rows = ((0.0, 0.0, 0.5, 0.0),) * MAX_NEXT_INPUTS
    assert Gate().consider(next_u=rows) is None
    assert Gate().consider(next_u=rows + rows[:1]) is Rejection.MALFORMED


@pytest.mark.parametrize(("sequence", "rejection"), [(9, True), (10, True), (11, False), (10**15, False)])
def test_sequence_must_grow_within_an_epoch(sequence: int, rejection: bool) -> None:
    gate = Gate()
    gate.consider()
    assert gate.consider(sequence=sequence) is (Rejection.OLD_SEQUENCE if rejection else None)


def test_silence_lets_no_earlier_command_count() -> None:
    gate = Gate()
    gate.consider()
    assert gate.consider(sequence=7, frame=150, pose_frame=150, now_s=100.0) is Rejection.OLD_SEQUENCE


def test_a_later_lease_starts_a_new_count() -> None:
    gate = Gate()
    gate.consider(sequence=10**12)
    lease = gate.validator.leases.bid(100, 1.0, fresh=True, take_over=True)
    assert gate.consider(lease=lease, sequence=1) is None
    assert gate.consider(sequence=10**12 + 1) is Rejection.LEASE_LOST
    assert gate.consider(lease=lease, sequence=1) is Rejection.OLD_SEQUENCE


def test_agents_that_take_over_are_counted() -> None:
    gate = Gate()
    gate.consider()
    for expected in (1, 2):
        lease = gate.validator.leases.bid(100 + expected, 1.0, fresh=True, take_over=True)
        assert gate.consider(lease=lease) is None
        assert gate.consider(lease=lease, sequence=11) is None
        assert gate.counters == {"agents that took over": expected}


def test_a_command_counts_until_it_is_late() -> None:
    validator = validator_of(ArbiterLimits(hold_after_s=0.0625), Counter())
    assert not validator.fresh(1.0)
    assert not validator.thrust_wanted(1.0)
    validator.consider(GOOD, 1.0, pose=None, flying=False)
    for seconds, expected in ((0.0, True), (0.0624, True), (0.0625, False)):
        assert validator.fresh(1.0 + seconds) is expected
        assert validator.thrust_wanted(1.0 + seconds) is expected


def test_thrust_is_wanted_above_the_low_thrust() -> None:
    for thrust, wanted in ((0.05, False), (0.051, True)):
        gate = Gate()
        gate.consider(u=(0.4, 0.4, thrust, 0.4))
        assert gate.validator.thrust_wanted(1.0) is wanted


def test_a_command_that_is_refused_for_another_reason_does_not_take_over() -> None:
    gate = Gate()
    gate.consider()
    lease = gate.validator.leases.bid(100, 1.0, fresh=True, take_over=True)
    assert gate.consider(lease=lease, u=(9, 0, 0, 0)) is Rejection.OUT_OF_LIMITS
    assert gate.consider(lease=lease, epoch=6) is Rejection.UNKNOWN_EPOCH
    assert gate.consider(sequence=11) is None


def test_rejected_commands_do_not_refresh_the_stream() -> None:
    gate = Gate()
    gate.consider()
    before = copy(gate.validator.stream)
    for changes in ({"sequence": 10}, {"epoch": 4}, {"epoch": 6}, {"u": (9, 0, 0, 0)}, {"u": None}):
        assert gate.consider(now_s=1.5, flying=True, **{"sequence": 11, **changes}) is not None
    assert gate.validator.stream == before
    assert sum(gate.counters.values()) == 5


# epoch of the last command is 5, its sequence 10
EPOCH_CASES = [
    # flying, pose epoch, command epoch, sequence, expected
    (True, 5, 5, 11, None),
    (True, 6, 5, 11, None),
    (True, 4, 5, 11, Rejection.UNKNOWN_EPOCH),
    (True, 6, 6, 1, None),
    (True, 5, 6, 11, Rejection.UNKNOWN_EPOCH),
    (True, 7, 6, 11, Rejection.UNKNOWN_EPOCH),
    (True, None, 6, 11, Rejection.UNKNOWN_EPOCH),
    (True, 5, 4, 11, Rejection.OLDER_EPOCH),
    (True, 4, 4, 11, Rejection.OLDER_EPOCH),
    (False, 6, 6, 1, None),
    (False, 6, 5, 11, None),
    (False, 4, 5, 11, Rejection.UNKNOWN_EPOCH),
    (False, 5, 6, 11, Rejection.UNKNOWN_EPOCH),
    (False, None, 6, 1, None),
    (False, None, 4, 11, Rejection.OLDER_EPOCH),
    (False, 5, 4, 11, Rejection.OLDER_EPOCH),
    (False, 4, 4, 1, None),
]


@pytest.mark.parametrize(("flying", "pose_epoch", "epoch", "sequence", "expected"), EPOCH_CASES)
def test_a_change_of_epoch_is_believed_only_with_the_raw_poses(
    flying: bool, pose_epoch: int | None, epoch: int, sequence: int, expected: Rejection | None
) -> None:
    gate = Gate()
    gate.consider()
    assert gate.consider(epoch=epoch, sequence=sequence, pose_epoch=pose_epoch, flying=flying) is expected


def test_first_command_of_a_lease_must_belong_to_the_raw_poses() -> None:
    assert Gate().consider(pose_epoch=4) is Rejection.UNKNOWN_EPOCH
    assert Gate().consider(pose_epoch=None) is None


@pytest.mark.parametrize(
    ("pose_frame", "latency_s", "expected"),
    [
        (110, 0.0, None),
        (111, 0.0, Rejection.OLD_POSE),
        (107, 0.05, None),
        (108, 0.05, Rejection.OLD_POSE),
        (90, 0.19, None),
        (100, 0.21, Rejection.OLD_POSE),
        (90, 0.0, None),
        (89, 0.0, Rejection.FUTURE_POSE),
        (0, 1.0, Rejection.FUTURE_POSE),
    ],
)
def test_command_computed_from_a_pose_far_from_the_newest_one_is_rejected(
    pose_frame: int, latency_s: float, expected: Rejection | None
) -> None:
    gate = Gate()
    assert gate.consider(pose_frame=pose_frame, latency_s=latency_s) is expected
    assert (gate.validator.stream is not None) == (expected is None)


@pytest.mark.parametrize(("epoch_age_s", "expected"), [(0.19, None), (0.21, Rejection.OLDER_EPOCH)])
def test_command_of_the_epoch_before_is_accepted_only_for_a_moment(
    epoch_age_s: float, expected: Rejection | None
) -> None:
    gate = Gate()
    gate.consider()
    later = {"sequence": 11, "pose_epoch": 6, "pose_frame": 5000, "epoch_age_s": epoch_age_s}
    assert gate.consider(flying=True, **later) is expected


def test_commands_without_a_lease_that_was_issued_are_rejected() -> None:
    gate = Gate()
    assert gate.consider(lease=0) is Rejection.NO_LEASE
    assert gate.consider(lease=2) is Rejection.NO_LEASE
    assert gate.validator.stream is None


def test_low_thrust_is_timed_from_its_first_command() -> None:
    gate = Gate()
    for n, (thrust, expected) in enumerate(
        [(0.05, 1.0), (0.0, 1.0), (0.051, None), (0.05, 1.06), (0.0, 1.06)], start=11
    ):
        gate.consider(sequence=n, now_s=1.0 + (n - 11) * 0.02, u=(0, 0, thrust, 0))
        low_since_s = gate.validator.stream.low_since_s
        assert low_since_s == (None if expected is None else pytest.approx(expected))


def test_low_thrust_is_timed_anew_after_a_gap() -> None:
    for gap_s, expected in ((0.059, 1.0), (0.061, 1.061)):
        gate = Gate()
        gate.consider(u=(0, 0, 0, 0))
        gate.consider(sequence=11, now_s=1.0 + gap_s, u=(0, 0, 0, 0))
        assert gate.validator.stream.low_since_s == pytest.approx(expected)


anything = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=3), st.binary(max_size=3)
)


@given(st.lists(st.tuples(*[st.one_of(anything, st.lists(anything, max_size=5))] * 7), max_size=20))
def test_no_content_whatever_raises_or_stores_bad_inputs(contents: list[tuple[Any, ...]]) -> None:
    gate = Gate()
    for lease, epoch, sequence, frame, u, next_u, period_s in contents:
        command = CommandInput(lease, epoch, sequence, frame, u, next_u, period_s)
        gate.validator.consider(command, 1.0, pose=None, flying=False)
    stream = gate.validator.stream
    if stream is not None:
        for u in (stream.command.u, *stream.command.next_u):
            limits = zip(u, ArbiterLimits().lower, ArbiterLimits().upper, strict=True)
            assert all(lower <= value <= upper for value, lower, upper in limits)
