"""Promises of one supervised process: when it is started again."""

from hypothesis import given
from hypothesis import strategies as st

from rcopterx.deploy.processes.supervisor import MAX_PAUSE_S, QUICK_RESTARTS, restart_pause_s


@given(st.integers(0, 60))
def test_pauses_grow_up_to_a_limit(deaths: int) -> None:
    pause_s = restart_pause_s(deaths)
    assert 0 <= pause_s <= restart_pause_s(deaths + 1) <= MAX_PAUSE_S
    assert (pause_s == 0) == (deaths < QUICK_RESTARTS)
