"""Steps that take too long are interrupted; what runs within its time is left alone."""

import contextlib
import signal
import threading
import time
from collections.abc import Iterator

import pytest
from support.failing import compute_for

from rcopterx.agents.guards import time_limit
from rcopterx.agents.guards.time_limit import LONGEST_WAIT_S, AlarmTimeLimit, OutOfTimeError


@pytest.fixture
def limit() -> Iterator[AlarmTimeLimit]:
    before = signal.getsignal(signal.SIGALRM)
    yield AlarmTimeLimit()
    signal.signal(signal.SIGALRM, before)


@pytest.fixture
def patient_limit(limit: AlarmTimeLimit, monkeypatch: pytest.MonkeyPatch) -> AlarmTimeLimit:
    """Limit of computing alone, however long a busy machine makes the test wait for its turn."""
    monkeypatch.setattr(time_limit, "LONGEST_WAIT_S", 60.0)
    return limit


@contextlib.contextmanager
def called(limit: AlarmTimeLimit, limit_s: float) -> Iterator[None]:
    """A call, ended as `GuardedCall` does."""
    try:
        limit.begin(limit_s)
        yield
    finally:
        limit.end(limit_s)


def test_code_that_computes_for_ever_is_interrupted(patient_limit: AlarmTimeLimit) -> None:
    begun_s = time.thread_time()
    with pytest.raises(OutOfTimeError), called(patient_limit, 0.02):
        compute_for(60.0)
    assert 0.02 <= time.thread_time() - begun_s < 5.0


def test_code_that_waits_for_ever_is_interrupted(limit: AlarmTimeLimit) -> None:
    with pytest.raises(OutOfTimeError), called(limit, 0.01):
        threading.Event().wait(60.0)


def test_code_that_was_interrupted_is_over_every_limit(
    limit: AlarmTimeLimit, monkeypatch: pytest.MonkeyPatch
) -> None:
    with contextlib.suppress(OutOfTimeError), called(limit, 0.01):
        threading.Event().wait(60.0)
    assert limit.over(1e3)
    monkeypatch.setattr(time_limit, "LONGEST_WAIT_S", 60.0)
    with called(limit, 0.01):
        pass
    assert not limit.over(0.01)


def test_waiting_is_not_computing(patient_limit: AlarmTimeLimit) -> None:
    with called(patient_limit, 0.005):
        time.sleep(LONGEST_WAIT_S / 4)
    assert not patient_limit.over(0.005)


def test_code_that_catches_everything_has_still_used_too_much(patient_limit: AlarmTimeLimit) -> None:
    with called(patient_limit, 0.01), contextlib.suppress(BaseException):
        compute_for(60.0)
    assert patient_limit.over(0.01)


def test_afterwards_nothing_rings(patient_limit: AlarmTimeLimit) -> None:
    with called(patient_limit, 0.005):
        pass
    compute_for(0.03)
    assert not patient_limit.over(0.005)


@pytest.mark.usefixtures("limit")
def test_in_slow_motion_a_call_may_use_more_processor_time() -> None:
    slow = AlarmTimeLimit(speed=0.001)
    with called(slow, 0.01):
        compute_for(0.05)
        assert not slow.over(0.01)
    assert not slow.over(0.01)
    assert slow.over(1e-5)
