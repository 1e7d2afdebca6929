"""Promises about lost leaders: the table, and one successor that all agree on without asking."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.bus.messages import LeaderLink
from rcopterx.formation.succession import (
    Finding,
    FollowingMode,
    Policy,
    following_mode,
    link_to_successor,
    successor_of,
)
from rcopterx.formation.topology import cycle, places

NAMES = ("h1", "h2", "h3", "h4", "h5")


@given(st.sampled_from(Finding), st.sampled_from(Policy), st.sampled_from((None, "h1", "h2")))
def test_every_situation_has_its_following_mode(
    finding: Finding, policy: Policy, successor: str | None
) -> None:
    mode = following_mode(finding, policy, "h1", successor)
    assert (mode is FollowingMode.FOLLOW) == (finding is Finding.HERE), (
        "a leader that returns is followed again"
    )
    assert (mode is FollowingMode.USE_LAST_PLAN) == (finding is Finding.LATE)
    if finding is Finding.GONE:
        assert mode is FollowingMode.HOLD, "leaders are waited for"
    if mode in (FollowingMode.LEAD, FollowingMode.FOLLOW_SUCCESSOR):
        assert policy is Policy.PROMOTE
        assert successor is not None
    assert (mode is FollowingMode.LAND) == (finding is Finding.LOST and policy is Policy.LAND)


@pytest.mark.parametrize(
    ("policy", "successor", "mode"),
    [
        (Policy.HOLD, None, FollowingMode.HOLD),
        (Policy.PROMOTE, "h1", FollowingMode.LEAD),
        (Policy.PROMOTE, "h2", FollowingMode.FOLLOW_SUCCESSOR),
        (Policy.PROMOTE, None, FollowingMode.HOLD),
        (Policy.LAND, None, FollowingMode.LAND),
    ],
)
def test_a_lost_leader_is_answered_as_the_fleet_file_says(
    policy: Policy, successor: str | None, mode: FollowingMode
) -> None:
    assert following_mode(Finding.LOST, policy, "h1", successor) is mode


@st.composite
def orphans(draw: st.DrawFn) -> dict[str, tuple[LeaderLink, ...]]:
    """Followers of h1, some of them by way of others as well, with offsets to it."""
    number = st.floats(-2, 2)
    return {
        name: (
            LeaderLink(
                leader="h1",
                offset_m=(draw(number), draw(number), draw(number)),
                yaw_offset_rad=draw(number),
                frame=draw(st.sampled_from(["inertial", "heading"])),
            ),
        )
        for name in NAMES[1:]
    }


@given(orphans(), st.sets(st.sampled_from(NAMES[1:]), min_size=1), st.permutations(NAMES), st.floats(-4, 4))
def test_all_orphans_agree_and_keep_their_places(
    links: dict[str, tuple[LeaderLink, ...]], ready: set[str], order: list[str], yaw_rad: float
) -> None:
    successors = {name: successor_of("h1", links, ready | {name}, order) for name in ready}
    assert len(set(successors.values())) == 1
    (successor,) = set(successors.values())
    assert successor == next(name for name in order if name in ready)
    before = places({"h1": (), **links}, {"h1": np.array([0.3, -0.2, 1.0, yaw_rad])})
    after = {successor: ()}
    for name in ready - {successor}:
        link = link_to_successor(name, successor, "h1", links, yaw_rad)
        assert link is not None
        after[name] = (link,)
    assert cycle(after) == ()
    for name, place in places(after, {successor: before[successor]}).items():
        assert place == pytest.approx(before[name], abs=1e-6)


def test_only_who_followed_the_lost_leader_succeeds_it() -> None:
    links = {"h2": (LeaderLink(leader="h5"),), "h3": (LeaderLink(leader="h1"),)}
    assert successor_of("h1", links, {"h2", "h3"}, NAMES) == "h3"
    assert successor_of("h1", links, {"h2"}, NAMES) is None
    assert link_to_successor("h3", "h2", "h1", links, 0.0) is None
