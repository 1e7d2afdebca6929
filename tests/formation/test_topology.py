"""Promises of the graph of leaders: lines, cycles, places, and roles that change without any movement."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.garbage import no_garbage

from rcopterx.bus.messages import LeaderLink
from rcopterx.formation.topology import (
    TopologyError,
    ancestors,
    cycle,
    exchanged,
    followers,
    in_words,
    line_between,
    places,
    roots,
)

NAMES = tuple(f"h{number}" for number in range(1, 8))


def link(leader: str, x: float = -0.5, y: float = 0.0, frame: str = "inertial") -> LeaderLink:
    return LeaderLink(leader=leader, offset_m=(x, y, 0.0), frame=frame)


CHAIN = {"h1": (), "h2": (link("h1"),), "h3": (link("h2"),), "h4": (link("h3"),)}
DIAMOND = {"h1": (), "h2": (link("h1"),), "h3": (link("h1"),), "h4": (link("h2"), link("h3"))}


@st.composite
def graphs(draw: st.DrawFn) -> dict[str, tuple[LeaderLink, ...]]:
    """Any acyclic graph: each vehicle follows some of those before it."""
    size = draw(st.integers(2, len(NAMES)))
    number = st.floats(-2, 2)
    found: dict[str, tuple[LeaderLink, ...]] = {}
    for index, name in enumerate(NAMES[:size]):
        leaders = draw(st.sets(st.sampled_from(NAMES[:index]), max_size=3)) if index else set()
        found[name] = tuple(
            LeaderLink(
                leader=leader,
                offset_m=(draw(number), draw(number), draw(number)),
                yaw_offset_rad=draw(number),
                frame=draw(st.sampled_from(["inertial", "heading"])),
                weight=draw(st.floats(0.1, 10)),
            )
            for leader in sorted(leaders)
        )
    order = draw(st.permutations(list(found)))
    return {name: found[name] for name in order}


@st.composite
def placed(draw: st.DrawFn) -> tuple[dict[str, tuple[LeaderLink, ...]], dict[str, np.ndarray]]:
    links = draw(graphs())
    heads = {
        name: np.array(draw(st.tuples(*[st.floats(-3, 3)] * 4))) for name, own in links.items() if not own
    }
    return links, places(links, heads)


def test_the_line_of_ancestors_is_told_nearest_first() -> None:
    assert ancestors(CHAIN, "h4") == ("h3", "h2", "h1")
    assert ancestors(DIAMOND, "h4") == ("h2", "h3", "h1")
    assert ancestors(CHAIN, "h1") == ()
    assert in_words(line_between(CHAIN, "h4", "h1")) == "h4 follows h3 follows h2 follows h1"
    assert line_between(CHAIN, "h1", "h4") == ()


def test_heads_and_followers_of_a_formation() -> None:
    assert roots(DIAMOND, "h4") == ("h1",)
    assert roots(DIAMOND, "h1") == ("h1",)
    assert set(followers(DIAMOND, "h1")) == {"h2", "h3", "h4"}
    assert followers(DIAMOND, "h4") == ()


def test_a_cycle_is_found_with_the_line_that_closes_it() -> None:
    assert cycle(CHAIN) == ()
    closed = CHAIN | {"h1": (link("h3"),)}
    line = cycle(closed)
    assert line[0] == line[-1]
    assert set(line) == {"h1", "h2", "h3"}
    assert places(closed, {}) == {}


@given(graphs())
def test_nobody_is_its_own_ancestor_in_an_acyclic_graph(links: dict[str, tuple[LeaderLink, ...]]) -> None:
    assert cycle(links) == ()
    for name in links:
        assert name not in ancestors(links, name)
        for ancestor in ancestors(links, name):
            line = line_between(links, name, ancestor)
            assert (line[0], line[-1]) == (name, ancestor)
            assert name in followers(links, ancestor)


@given(placed(), st.data())
def test_everybody_keeps_its_place_when_two_change_roles(
    formation: tuple[dict[str, tuple[LeaderLink, ...]], dict[str, np.ndarray]], data: st.DataObject
) -> None:
    links, where = formation
    first, second = data.draw(st.permutations(list(links)))[:2]
    changes = exchanged(links, where, first, second)
    after = dict(links)
    for name, following in changes.items():
        after[name] = following
        assert cycle(after) == ()
    heads = {name: where[name] for name, own in after.items() if not own}
    settled = places(after, heads)
    assert settled.keys() == where.keys()
    for name, place in where.items():
        assert settled[name] == pytest.approx(place, abs=1e-6)
    roles = {first: second, second: first}
    for name in links:
        expected = {roles.get(leader, leader) for leader in ancestors(links, roles.get(name, name))}
        assert set(ancestors(after, name)) == expected


@given(placed(), st.data())
def test_changing_roles_twice_gives_the_formation_of_before(
    formation: tuple[dict[str, tuple[LeaderLink, ...]], dict[str, np.ndarray]], data: st.DataObject
) -> None:
    links, where = formation
    first, second = data.draw(st.permutations(list(links)))[:2]
    once = links | exchanged(links, where, first, second)
    twice = once | exchanged(once, where, second, first)
    for name in links:
        assert [(item.leader, item.frame, item.weight) for item in twice[name]] == [
            (item.leader, item.frame, item.weight) for item in links[name]
        ]


def test_only_those_who_get_other_leaders_are_told() -> None:
    where = places(CHAIN, {"h1": np.zeros(4)})
    changes = exchanged(CHAIN, where, "h1", "h2")
    assert changes.keys() == {"h1", "h2", "h3"}
    assert changes["h2"] == ()
    assert changes["h1"][0].offset_m == pytest.approx((0.5, 0.0, 0.0))
    assert changes["h3"][0].leader == "h1"
    assert changes["h3"][0].offset_m == pytest.approx((-1.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        ("h1", "h9", "h9 does not fly in this formation"),
        ("h2", "h2", "h2 cannot change roles with itself"),
        ("h1", "h2", "the place of h[12] is not known"),
    ],
)
def test_impossible_changes_of_roles_are_refused(first: str, second: str, words: str) -> None:
    with pytest.raises(TopologyError, match=words):
        exchanged(CHAIN, {}, first, second)


def test_places_leave_no_reference_cycles() -> None:
    with no_garbage():
        for _ in range(100):
            places(CHAIN, {"h1": np.zeros(4)})
