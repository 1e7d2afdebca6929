from rcopterx.bus.host_messages import SubjectState
from rcopterx.vicon_gateway.frame import CapturedFrame, SubjectPose
from rcopterx.vicon_gateway.process import SubjectMap


def seen(name: str) -> SubjectPose:
    return SubjectPose(name, False, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), None)


def hidden(name: str) -> SubjectPose:
    return SubjectPose(name, True, None, None, None)


def frame(received_s: float, *subjects: SubjectPose) -> CapturedFrame:
    return CapturedFrame(0, 1, 0.02, received_s, 0.0, subjects)


def test_subjects_are_given_to_their_vehicles_occluded_or_not() -> None:
    subjects = SubjectMap({"Heli One": "h1", "Heli Two ": "h2"})
    poses = subjects.update(frame(0.0, seen("Heli One"), hidden("Heli Two ")))
    assert poses == [("h1", seen("Heli One")), ("h2", hidden("Heli Two "))]


def test_unknown_and_missing_subjects_are_listed() -> None:
    subjects = SubjectMap({"Heli One": "h1", "Heli Two": "h2"})
    assert subjects.update(frame(0.0, seen("Heli One"), seen("wand"))) == [("h1", seen("Heli One"))]
    assert [(state.subject, state.vehicle, state.listed) for state in subjects.states(0.0)] == [
        ("Heli One", "h1", True),
        ("Heli Two", "h2", False),
        ("wand", None, True),
    ]
    subjects.update(frame(0.1, seen("Heli Two")))
    assert [(state.subject, state.listed) for state in subjects.states(0.1)] == [
        ("Heli One", False),
        ("Heli Two", True),
    ]


def test_names_are_compared_exactly() -> None:
    subjects = SubjectMap({"Heli": "h1"})
    assert subjects.update(frame(0.0, seen("Heli "), seen("heli"))) == []
    assert [state.subject for state in subjects.states(0.0) if state.vehicle is None] == ["Heli ", "heli"]


def test_time_of_occlusion_counts_from_the_first_frame_without_pose() -> None:
    subjects = SubjectMap({"a": "h1", "b": "h2", "c": "h3"})
    subjects.update(frame(10.0, seen("a"), hidden("b")))
    subjects.update(frame(11.0, hidden("a"), hidden("b")))
    assert subjects.states(12.5) == (
        SubjectState(subject="a", vehicle="h1", listed=True, occluded_s=1.5),
        SubjectState(subject="b", vehicle="h2", listed=True, occluded_s=2.5),
        SubjectState(subject="c", vehicle="h3", listed=False, occluded_s=None),
    )
    subjects.update(frame(13.0, seen("a"), hidden("b"), hidden("wand")))
    assert subjects.states(13.0)[0] == SubjectState(subject="a", vehicle="h1", listed=True, occluded_s=None)
    assert subjects.states(13.0)[3] == SubjectState(subject="wand", vehicle=None, listed=True, occluded_s=0.0)


def test_occlusion_starts_anew_for_a_subject_that_was_not_listed_meanwhile() -> None:
    subjects = SubjectMap({"a": "h1"})
    for received_s, poses in ((1.0, (hidden("a"),)), (2.0, ()), (3.0, (hidden("a"),))):
        subjects.update(frame(received_s, *poses))
    assert subjects.states(3.5) == (SubjectState(subject="a", vehicle="h1", listed=True, occluded_s=0.5),)


def test_subject_listed_twice_is_ambiguous_and_gets_no_pose() -> None:
    subjects = SubjectMap({"a": "h1", "b": "h2"})
    poses = subjects.update(frame(0.0, seen("a"), seen("b"), seen("a")))
    assert poses == [("h2", seen("b"))]
    assert [state.ambiguous for state in subjects.states(2.0)] == [True, False]


def test_number_of_remembered_names_is_bounded_by_the_last_frame() -> None:
    subjects = SubjectMap({})
    for number in range(100):
        subjects.update(frame(0.0, hidden(f"s{number}")))
    assert len(subjects.states(0.0)) == 1


def at(name: str, *position_m: float) -> SubjectPose:
    x, y, z = position_m
    return SubjectPose(name, False, (x, y, z), (0.0, 0.0, 0.0, 1.0), None)


def test_position_in_no_room_is_published_as_occluded_and_reported_with_its_place() -> None:
    subjects = SubjectMap({"heli1": "h1", "heli2": "h2"})
    poses = subjects.update(frame(0.0, at("heli1", 0.5, 0.0, 0.0), at("heli2", 1000.0, 500.0, 20.0)))
    assert poses == [("h1", at("heli1", 0.5, 0.0, 0.0)), ("h2", hidden("heli2"))]
    one, two = subjects.states(0.0)
    assert (one.shown_at_m, two.shown_at_m) == (None, (1000.0, 500.0, 20.0))
    assert two.occluded_s is None, "it is seen"
    assert subjects.far == 1


def test_subjects_at_one_place_are_reported_also_one_of_no_vehicle() -> None:
    subjects = SubjectMap({"heli1": "h1", "heli2": "h2"})
    subjects.update(
        frame(0.0, at("heli1", 0.5, 0.0, 0.0), at("heli2", 0.0, 0.0, 0.0), at("old", 0.502, 0, 0))
    )
    assert [state.same_place_as for state in subjects.states(0.0)] == ["old", "", "heli1"]
