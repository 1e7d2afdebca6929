"""Promises of scenarios: every mistake names the file, the fault and what is allowed."""

from pathlib import Path

import pytest

from rcopterx.fleet.schema import FleetError
from rcopterx.simulator.faults import (
    AddSubject,
    BreakRadio,
    Burst,
    Occlude,
    SwapSubjects,
    TimedFault,
    fault_text,
)
from rcopterx_studies.faults.scenario import (
    FAULTS,
    fault_from,
    fault_list,
    field_from,
    read_scenario,
)


def scenario(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "faults.toml"
    path.write_text(text)
    return path


def test_scenario_is_read_in_the_order_of_its_times(tmp_path: Path) -> None:
    path = scenario(
        tmp_path,
        """
        [[fault]]
        at_s = 4
        kind = "swap_subjects"
        subject = "heli1"
        other = "heli2"

        [[fault]]
        at_s = 1.5
        kind = "break-radio"
        vehicle = "h2"
        condition = "off"
        duration_s = 0.2
        """,
    )
    assert read_scenario(path) == (
        TimedFault(1.5, BreakRadio("h2", "off", duration_s=0.2)),
        TimedFault(4.0, SwapSubjects("heli1", "heli2")),
    )


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[[fault]", "not TOML"),
        ("x = " + 5000 * "[" + 5000 * "]", "nested more than 16 times"),
        ("", r"1 to 200 tables \[\[fault\]\]"),
        ("seed = 1\n[[fault]]\nat_s = 0\nkind = 'close'", "and nothing else"),
        ("fault = 3", r"tables \[\[fault\]\]"),
        ("fault = [3]", "fault 1: must be a table"),
        ("[[fault]]\nkind = 'close'", "fault 1: at_s is missing"),
        ("[[fault]]\nat_s = 0", "fault 1: kind is missing"),
        ("[[fault]]\nat_s = -1\nkind = 'close'", "fault 1: at_s: expected `float` >= 0"),
        ("[[fault]]\nat_s = 'now'\nkind = 'close'", "fault 1: at_s: expected `float`"),
        ("[[fault]]\nat_s = 0\nkind = 'explode'", "fault 1: unknown fault 'explode', known are close, reset"),
        (
            "[[fault]]\nat_s = 0\nkind = 'occlude'",
            "fault 1: occlude: object missing .* `subject`",
        ),
        (
            "[[fault]]\nat_s = 0\nkind = 'close'\n[[fault]]\nat_s = 0\nkind = 'burst'\nsubject = 'x'",
            "fault 2: burst: object contains unknown field `subject`, allowed are frames",
        ),
        ("[[fault]]\nat_s = 0\nkind = 'burst'\nframes = 'many'", "fault 1: burst.frames: expected `int`"),
    ],
)
def test_wrong_scenario_is_refused_with_what_is_allowed(text: str, reason: str, tmp_path: Path) -> None:
    path = scenario(tmp_path, text)
    with pytest.raises(FleetError, match=rf"^{path}: .*{reason}"):
        read_scenario(path)


def test_scenario_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(FleetError, match=r"nowhere.toml: cannot be read: No such file"):
        read_scenario(tmp_path / "nowhere.toml")


def test_faults_are_read_from_words() -> None:
    assert fault_from("burst", dict([field_from("frames=20")])) == Burst(20)
    position = dict([field_from("subject=ghost"), field_from("position_m=[0, 1, 2.5]")])
    assert fault_from("add-subject", position) == AddSubject("ghost", (0.0, 1.0, 2.5))
    for words in ("frames", "position_m=[0"):
        with pytest.raises(FleetError):
            field_from(words)


def test_every_fault_is_listed_with_its_fields_and_purpose() -> None:
    listed = {kind: (fields, purpose) for kind, fields, purpose in fault_list()}
    assert listed.keys() == FAULTS.keys()
    assert listed["dribble"][0] == "chunk_bytes=7 interval_s=0.0002 duration_s"
    assert all(purpose for _, purpose in listed.values())


def test_faults_are_told_in_words() -> None:
    assert fault_text(Occlude("heli1", duration_s=0.5)) == "occlude (subject heli1, duration_s 0.5)"
    assert fault_text(Burst()) == "burst (frames 10)"
    assert fault_text(FAULTS["close"]()) == "close"
