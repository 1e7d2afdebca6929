"""Promises of saved formations: they survive the page, errors are reported, leaders come first."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.agents.formation.topology import ancestors
from rcopterx.bus.messages import LeaderLink
from rcopterx.ground_station.page.saved_formations import (
    Formation,
    SavedFormations,
    SavedFormationsError,
    default_path,
    in_order,
    in_words,
)

WEDGE: Formation = {
    "h1": (),
    "h2": (LeaderLink(leader="h1", offset_m=(-0.5, 0.5, 0.0), frame="heading"),),
    "h3": (LeaderLink(leader="h2", offset_m=(0.0, -1.0, 0.0)),),
}


def test_what_was_saved_is_there_again_and_in_its_order(tmp_path: Path) -> None:
    path = tmp_path / "formations" / "trio.json"
    assert SavedFormations(path).all() == {}
    assert SavedFormations(path).save(WEDGE) == "1"
    assert SavedFormations(path).save({"h1": ()}) == "2"
    assert SavedFormations(path).all() == {"1": WEDGE, "2": {"h1": ()}}
    SavedFormations(path).forget("1")
    SavedFormations(path).forget("1")
    assert SavedFormations(path).save(WEDGE) == "1"
    assert list(SavedFormations(path).all()) == ["2", "1"]
    assert [entry.name for entry in path.parent.iterdir()] == ["trio.json"]


@pytest.mark.parametrize("content", [b"{", b'{"1": {"h2": [{"leader": ""}]}}', b'{"1": 5}'])
def test_a_file_that_holds_something_else_is_told_with_its_place(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "trio.json"
    path.write_bytes(content)
    with pytest.raises(SavedFormationsError, match=str(path)):
        SavedFormations(path).save(WEDGE)
    assert path.read_bytes() == content


def test_a_directory_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "formations").touch()
    with pytest.raises(SavedFormationsError, match=r"Not a directory|File exists"):
        SavedFormations(tmp_path / "formations" / "trio.json").save(WEDGE)


def test_formations_lie_among_the_users_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert default_path("trio") == tmp_path / "rcopterx" / "formations" / "trio.json"


def test_a_formation_is_told_by_who_leads_whom() -> None:
    assert in_words(WEDGE) == "h1 leads h2 h3"
    assert in_words({"h1": (), "h2": (), "h3": (LeaderLink(leader="h2"),)}) == "h1 alone; h2 leads h3"


@given(st.lists(st.integers(0, 6), max_size=7), st.randoms())
def test_leaders_come_before_those_who_follow_them(leaders: list[int], random: object) -> None:
    formation: Formation = {"h0": ()}
    for number, leader in enumerate(leaders, 1):
        formation[f"h{number}"] = (LeaderLink(leader=f"h{leader % number}"),)
    names = list(formation)
    random.shuffle(names)  # type: ignore[attr-defined]
    order = in_order({name: formation[name] for name in names})
    assert sorted(order) == sorted(formation)
    for place, name in enumerate(order):
        assert set(ancestors(formation, name)) <= set(order[:place])
