import math
import statistics

import msgspec
import pytest
from support.records import replace

from rcopterx.simulator.faults import (
    AddNoise,
    AddSubject,
    BreakRadio,
    Burst,
    Close,
    DisplacePose,
    Dribble,
    Fault,
    FaultError,
    Freeze,
    FreezePose,
    Millimetres,
    Occlude,
    Recover,
    RemoveSubject,
    RenameRootSegment,
    Reset,
    ResetFrameId,
    SetQuality,
    Silence,
    SkipFrames,
    StandIn,
    SwapSubjects,
    TimedFault,
    TurnPose,
    UnknownObject,
    WrongMagic,
    YUp,
)
from rcopterx.simulator.plant import BodyPose
from rcopterx.simulator.tracker_faults import TrackerFaults
from rcopterx.simulator.tracker_frame import PROFILES, TrackedBody, TrackerFrame

H1, H2 = TrackedBody("h1", (1.0, 0.0, 0.0)), TrackedBody("h2", (2.0, 0.0, 0.0))


def frame(number: int = 0) -> TrackerFrame:
    return TrackerFrame(number, (H1, H2))


def faults(profile: str = "tracker3") -> TrackerFaults:
    found = TrackerFaults(PROFILES[profile])
    found.transform(frame())
    return found


def seen(fault: Fault) -> tuple[TrackedBody, ...]:
    active = faults()
    active.apply(fault, 0.0)
    return active.transform(frame()).bodies


def test_frame_without_faults_stays_as_it_is() -> None:
    assert faults().transform(frame(7)) == frame(7)


def test_faults_of_subjects_change_what_is_captured() -> None:
    assert seen(Occlude("h1")) == (replace(H1, occluded=True), H2)
    assert seen(SetQuality("h2", 0.25)) == (H1, replace(H2, quality=0.25))
    assert seen(RenameRootSegment("h1", "body")) == (replace(H1, root_segment="body"), H2)
    assert seen(RemoveSubject("h1")) == (H2,)
    assert seen(AddSubject("ghost", (0.0, 1.0, 2.0))) == (H1, H2, TrackedBody("ghost", (0.0, 1.0, 2.0)))
    assert seen(SwapSubjects("h1", "h2")) == (replace(H2, name="h1"), replace(H1, name="h2"))


def test_lasting_fault_ends_by_itself() -> None:
    active = faults()
    active.apply(Occlude("h1", duration_s=0.5), 10.0)
    assert active.table.next_change_s() == 10.5
    active.advance(10.499)
    assert active.transform(frame()).bodies[0].occluded
    active.advance(10.5)
    assert not active.transform(frame()).bodies[0].occluded
    assert active.table.next_change_s() == math.inf


def test_lasting_fault_without_duration_stays_until_recovery() -> None:
    active = faults()
    active.apply(Silence(), 0.0)
    active.apply(Occlude("h1"), 0.0)
    active.advance(1e9)
    assert active.active(Silence) is not None
    active.apply(Recover(), 1e9)
    assert active.active(Silence) is None
    assert active.transform(frame()) == frame()


def test_same_fault_again_replaces_the_first_but_another_subject_is_another_fault() -> None:
    active = faults()
    active.apply(SetQuality("h1", 0.1, duration_s=1.0), 0.0)
    active.apply(SetQuality("h1", 0.2), 0.0)
    active.apply(SetQuality("h2", 0.3), 0.0)
    active.advance(5.0)
    assert [body.quality for body in active.transform(frame()).bodies] == [0.2, 0.3]


def test_frame_id_goes_on_from_the_reset() -> None:
    active = faults()
    active.apply(ResetFrameId(3), 0.0)
    assert [active.transform(frame(number)).frame for number in (100, 101, 103)] == [3, 4, 6]


def test_frame_id_never_takes_the_value_that_means_none() -> None:
    active = faults()
    active.apply(ResetFrameId(0xFFFFFFFE), 0.0)
    assert [active.transform(frame(number)).frame for number in (0, 1)] == [0xFFFFFFFE, 0]


def test_frozen_tracker_repeats_its_last_frame_number_and_all() -> None:
    active = faults()
    active.apply(ResetFrameId(50), 0.0)
    last = active.transform(frame(7))
    active.apply(Freeze(duration_s=1.0), 0.0)
    moved = TrackerFrame(8, (replace(H1, position_m=(9.0, 9.0, 9.0)), H2))
    assert active.transform(moved) == last
    active.advance(1.0)
    assert active.transform(replace(moved, frame=9)) == replace(moved, frame=52)


def test_frozen_pose_stays_where_it_was_while_frames_and_others_go_on() -> None:
    active = faults()
    active.apply(FreezePose("h1"), 0.0)
    for number in range(3):
        place = (float(number), 0.0, 1.0)
        bodies = replace(H1, position_m=place), replace(H2, position_m=place)
        seen_now = active.transform(TrackerFrame(number, bodies))
        assert seen_now.frame == number
        assert [body.position_m for body in seen_now.bodies] == [(0.0, 0.0, 1.0), place]
    active.apply(Recover(), 0.0)
    assert active.transform(frame(4)).bodies == (H1, H2)
    active.apply(FreezePose("h1"), 0.0)
    assert active.transform(frame(5)).bodies[0] == H1


def test_displaced_pose_jumps_and_then_drifts_with_the_time() -> None:
    active = faults()
    active.apply(DisplacePose("h1", (0.5, 0.0, 0.0), (0.0, 0.1, 0.0), duration_s=3.0), 10.0)
    for now_s, place_m in ((10.0, (1.5, 0.0, 0.0)), (12.0, (1.5, 0.2, 0.0)), (13.0, (1.0, 0.0, 0.0))):
        active.advance(now_s)
        assert active.transform(frame()).bodies == (replace(H1, position_m=place_m), H2)


def test_noise_has_its_deviation_about_where_everybody_is() -> None:
    active = faults()
    active.apply(AddNoise(0.01), 0.0)
    frames = [active.transform(frame()).bodies for _ in range(1000)]
    for number, body in enumerate((H1, H2)):
        places = [bodies[number].position_m for bodies in frames]
        for axis in range(3):
            values = [place[axis] - body.position_m[axis] for place in places]
            assert statistics.fmean(values) == pytest.approx(0.0, abs=0.002)
            assert statistics.stdev(values) == pytest.approx(0.01, rel=0.1)


def test_one_of_so_many_frames_is_sent_while_the_rate_is_lowered() -> None:
    active = faults()
    assert [active.skips() for _ in range(3)] == [False] * 3
    active.apply(SkipFrames(3, duration_s=1.0), 0.0)
    assert [active.skips() for _ in range(6)] == [True, True, False] * 2
    active.advance(1.0)
    assert not active.skips()


def test_fault_of_a_subject_that_is_added_by_the_same_time_table_is_accepted() -> None:
    active = faults()
    active.schedule([TimedFault(1.0, AddSubject("ghost")), TimedFault(2.0, Occlude("ghost"))], 0.0)
    active.advance(1.5)
    active.advance(2.5)
    assert list(active.refused) == []
    assert active.transform(frame()).bodies[2].occluded


def test_time_table_leaves_radios_to_others() -> None:
    active = faults()
    active.schedule([TimedFault(0.0, BreakRadio("h1"))], 0.0)
    assert active.table.next_change_s() == math.inf


def test_time_table_is_carried_out_in_its_order() -> None:
    active = faults()
    table = [TimedFault(2.0, Close()), TimedFault(1.0, Burst(3)), TimedFault(2.0, Reset())]
    active.schedule(table, 100.0)
    assert active.table.next_change_s() == 101.0
    active.advance(100.9)
    assert active.take_pending() == []
    active.advance(101.0)
    assert active.take_pending() == [Burst(3)]
    active.advance(150.0)
    assert active.take_pending() == [Close(), Reset()]
    assert active.take_pending() == []


def test_duration_of_a_planned_fault_counts_from_its_own_time() -> None:
    active = faults()
    active.schedule([TimedFault(1.0, Silence(duration_s=0.5))], 0.0)
    active.advance(1.2)
    assert active.table.next_change_s() == 1.5


@pytest.mark.parametrize(
    "fault", [Occlude("h9"), SwapSubjects("h1", "h9"), AddSubject("h1"), UnknownObject(object_type=9)]
)
def test_request_that_makes_no_sense_is_refused_and_says_why(fault: Fault) -> None:
    active = faults()
    with pytest.raises(FaultError, match=r"known type|tracked"):
        active.apply(fault, 0.0)
    with pytest.raises(FaultError):
        active.schedule([TimedFault(0.0, Close()), TimedFault(1.0, fault)], 0.0)
    active.advance(10.0)
    assert active.take_pending() == []
    assert active.transform(frame()) == frame()


def test_fault_that_the_profile_cannot_show_is_refused() -> None:
    with pytest.raises(FaultError, match="does not offer"):
        faults("tracker1").apply(SetQuality("h1", 0.5), 0.0)


def test_tracker_that_cannot_report_its_axes_may_be_y_up_all_the_same() -> None:
    active = faults("tracker1")
    active.apply(YUp(), 0.0)
    assert active.active(YUp) is not None


def test_positions_in_millimetres_are_a_thousand_times_as_large() -> None:
    one, two = seen(Millimetres())
    assert (one.position_m, two.position_m) == ((1000.0, 0.0, 0.0), (2000.0, 0.0, 0.0))


def test_turned_object_has_another_heading_and_the_same_tilt() -> None:
    tilted = BodyPose((0.0, 0.0, 0.0), 0.3, 0.1, -0.2)
    active = faults()
    active.apply(TurnPose("h1", yaw_rad=1.0), 0.0)
    body = replace(H1, quaternion_xyzw=tilted.quaternion_xyzw)
    x, y, z, w = active.transform(TrackerFrame(1, (body, H2))).bodies[0].quaternion_xyzw
    bx, by, bz, bw = tilted.quaternion_xyzw
    assert math.hypot(x, y) == pytest.approx(math.hypot(bx, by))
    yaw_rad = 2 * math.atan2(z, w) - 2 * math.atan2(bz, bw)
    assert math.remainder(yaw_rad, math.tau) == pytest.approx(1.0)


def test_body_that_stands_in_for_a_subject_stays_there_with_its_own_noise() -> None:
    active = faults()
    active.apply(StandIn("h1", deviation_m=0.001), 0.0)
    places = []
    for number in range(400):
        moved = replace(H1, position_m=(1.0 + number, 0.0, 0.0))
        places.append(active.transform(TrackerFrame(number, (moved, H2))).bodies[0].position_m[0])
    assert statistics.mean(places) == pytest.approx(1.0, abs=0.0003)
    assert statistics.stdev(places) == pytest.approx(0.001, rel=0.2)
    assert len(set(places)) == len(places)


def test_planned_fault_whose_subject_is_gone_is_refused_and_listed() -> None:
    active = TrackerFaults(PROFILES["tracker3"])
    active.schedule([TimedFault(0.0, Occlude("h9"))], 0.0)
    active.transform(frame())
    active.advance(1.0)
    assert list(active.refused) == ["no subject 'h9'; tracked are 'h1', 'h2'"]


@pytest.mark.parametrize(
    ("message", "fault"),
    [
        ({"kind": "close"}, Close()),
        ({"kind": "wrong_magic"}, WrongMagic()),
        ({"kind": "silence", "duration_s": 0.5}, Silence(duration_s=0.5)),
        ({"kind": "occlude", "subject": "h1"}, Occlude("h1")),
        ({"kind": "swap_subjects", "subject": "h1", "other": "h2"}, SwapSubjects("h1", "h2")),
        ({"kind": "dribble", "chunk_bytes": 3}, Dribble(chunk_bytes=3)),
    ],
)
def test_faults_are_read_from_plain_messages(message: dict[str, object], fault: Fault) -> None:
    assert msgspec.convert(message, Fault) == fault
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(fault), type=Fault) == fault


@pytest.mark.parametrize(
    "message", [{"kind": "explode"}, {"kind": "close", "now": True}, {"kind": "occlude"}]
)
def test_unknown_fault_messages_are_refused(message: dict[str, object]) -> None:
    with pytest.raises(msgspec.ValidationError):
        msgspec.convert(message, Fault)
