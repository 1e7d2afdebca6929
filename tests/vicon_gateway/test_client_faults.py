"""Every fault of docs/motion_capture.md, as our own client lives through it."""

from contextlib import closing

import pytest
from support.records import replace
from tracker_bench import BODIES, PATIENT, QUICK, Bench

from rcopterx.simulator import faults
from rcopterx.simulator.tracker import TrackerServer
from rcopterx.vicon_gateway.client import MAX_DRAIN_BYTES


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        (faults.Close(), "the server closed the connection"),
        (faults.Reset(), "Connection reset by peer"),
    ],
)
def test_a_connection_that_ends_is_reported_and_made_again(fault: faults.TrackerFault, reason: str) -> None:
    with Bench() as bench:
        bench.run_until_up()
        bench.server.apply(fault)
        bench.run_until(lambda: bench.client.state.name != "up")
        assert bench.client.state.last_error == reason
        bench.run_until_up(connects=2)
        assert bench.run_frames(3)[-1].connection == 2


def test_silent_connection_is_given_up_and_found_again_when_frames_flow() -> None:
    with Bench(replace(QUICK, connect_s=0.1)) as bench:
        bench.run_until_up()
        bench.server.apply(faults.Silence())
        bench.run_until(lambda: bench.client.state.name != "up")
        assert bench.client.state.last_error == "no frame for 0.15 s"
        bench.run_until(lambda: "no offer" in str(bench.client.state.last_error))
        bench.server.apply(faults.Recover())
        bench.run_until_up(connects=2)


def test_silence_limit_follows_the_frame_period() -> None:
    with Bench(replace(QUICK, silence_periods=60.0)) as bench:
        bench.run_until_up()
        bench.server.apply(faults.Silence())
        bench.run_until(lambda: bench.client.state.name != "up")
        assert bench.client.state.last_error == "no frame for 0.3 s"


def test_short_silence_is_only_counted_as_lost_frames() -> None:
    with Bench(PATIENT) as bench:
        bench.run_until_up()
        bench.server.apply(faults.Silence(duration_s=0.1))
        bench.run_until(lambda: bench.client.state.counters.lost > 0)
        assert bench.client.state.connects == 1


def test_restarted_tracker_is_found_again() -> None:
    with Bench() as bench:
        bench.run_until_up()
        host, port = bench.server.address
        bench.server.close()
        assert bench.client.next_frame(0.01) is None
        bench.number = 0
        with closing(TrackerServer(host, port, rate_hz=200.0, clock=bench.clock)) as bench.server:
            bench.run_until_up(connects=2)
            bench.run_frames(3)


def test_frames_arriving_a_few_bytes_at_a_time_are_complete() -> None:
    with Bench(PATIENT, period_s=0.02) as bench:
        bench.run_until_up()
        bench.server.apply(faults.Dribble(chunk_bytes=7, interval_s=0.00005))
        for frame in bench.run_frames(10):
            assert [subject.position_m for subject in frame.subjects] == [body.position_m for body in BODIES]
        assert (bench.client.state.connects, bench.client.state.counters.rejected) == (1, 0)


def test_delayed_frames_arrive_in_order_and_complete() -> None:
    with Bench(PATIENT) as bench:
        bench.run_frames(3)
        bench.server.apply(faults.Delay(delay_s=0.1))
        first, began_s = bench.number, bench.clock()
        bench.run_until(lambda: bench.last.frame >= first)
        assert bench.clock() - began_s >= 0.1
        numbers = [frame.frame for frame in bench.frames]
        assert numbers == sorted(numbers)
        assert bench.client.state.counters.lost == 0


def test_burst_of_ten_frames_delivers_only_the_newest() -> None:
    with Bench(PATIENT) as bench:
        bench.run_frames(3)
        bench.publishing = False
        bench.client.next_frame(0.005)
        before = bench.client.state.counters.skipped
        bench.server.apply(faults.Burst(frames=10))
        for _ in range(9):
            bench.publish()
            bench.server.poll()
        assert bench.client.next_frame(0.005) is None
        bench.publish()
        (frame,) = bench.run_frames(1)
        assert frame.frame == bench.number - 1
        assert (bench.client.state.counters.skipped, bench.client.state.counters.lost) == (before + 9, 0)


def test_occluded_subject_is_delivered_without_pose() -> None:
    with Bench(PATIENT) as bench:
        bench.run_until_up()
        bench.server.apply(faults.Occlude("h1"))
        bench.run_until(lambda: bench.last.subjects[0].occluded)
        h1, h2 = bench.last.subjects
        assert (h1.name, h1.position_m, h1.quaternion_xyzw) == ("h1", None, None)
        assert not h2.occluded
        bench.server.apply(faults.Recover())
        bench.run_until(lambda: not bench.last.subjects[0].occluded)


def test_frame_id_that_starts_again_is_passed_on() -> None:
    with Bench(PATIENT) as bench:
        bench.run_until(lambda: bool(bench.frames) and bench.last.frame > 20)
        bench.server.apply(faults.ResetFrameId(5))
        bench.run_until(lambda: bench.last.frame < 20)
        assert (bench.client.state.counters.restarts, bench.client.state.connects) == (1, 1)


def test_subjects_come_and_go_in_flight() -> None:
    with Bench(PATIENT) as bench:
        bench.run_until_up()
        bench.server.apply(faults.AddSubject("ghost", (0.0, 0.0, 3.0)))
        bench.run_until(lambda: [s.name for s in bench.last.subjects] == ["h1", "h2", "ghost"])
        assert bench.last.subjects[2].position_m == (0.0, 0.0, 3.0)
        bench.server.apply(faults.Recover())
        bench.server.apply(faults.RemoveSubject("h1"))
        bench.run_until(lambda: [s.name for s in bench.last.subjects] == ["h2"])
        bench.server.apply(faults.RemoveSubject("h2"))
        bench.run_until(lambda: bench.last.subjects == ())


def test_quality_changes_without_wiping_the_subjects() -> None:
    with Bench(PATIENT) as bench:
        bench.run_until_up()
        for quality in (0.5, 0.25, 0.125):
            bench.server.apply(faults.SetQuality("h1", quality))
            bench.run_until(lambda wanted=quality: bench.last.subjects[0].quality == wanted)
            assert len(bench.last.subjects) == 2
            assert not bench.last.subjects[0].occluded


def test_unknown_objects_are_passed_over() -> None:
    with Bench(PATIENT) as bench:
        bench.run_until_up()
        bench.server.apply(faults.UnknownObject())
        bench.run_frames(5)
        assert (bench.client.state.connects, bench.client.state.counters.rejected) == (1, 0)


def test_wrong_magic_ends_the_connection_and_a_new_one_is_made() -> None:
    with Bench() as bench:
        bench.run_until_up()
        bench.server.apply(faults.WrongMagic())
        bench.run_until(lambda: bench.client.state.name != "up")
        assert str(bench.client.state.last_error).startswith("packet starts with 0d f0 ad 0b")
        assert bench.client.state.counters.rejected == 1
        bench.run_until_up(connects=2)


def test_unanswered_pings_leave_the_network_latency_out_and_harm_nothing() -> None:
    with Bench(PATIENT) as bench:
        bench.server.apply(faults.IgnorePings())
        bench.run_frames(5)
        assert bench.last.latency_s == 0.0
        bench.server.apply(faults.Recover())
        # The next ping is due a second after the first.
        bench.run_until(lambda: bench.last.latency_s > 0.0)


def test_swapped_subjects_exchange_their_poses() -> None:
    with Bench(PATIENT) as bench:
        bench.run_until_up()
        bench.server.apply(faults.SwapSubjects("h1", "h2"))
        bench.run_until(lambda: bench.last.subjects[0].position_m == BODIES[1].position_m)
        assert bench.last.subjects[1].position_m == BODIES[0].position_m


def test_root_segment_with_another_name_changes_nothing() -> None:
    with Bench(PATIENT) as bench:
        bench.run_until_up()
        bench.server.apply(faults.RenameRootSegment("h1", "airframe"))
        for frame in bench.run_frames(10):
            assert frame.subjects[0].position_m == BODIES[0].position_m


def test_y_up_tracker_gives_the_same_poses() -> None:
    with Bench(PATIENT) as bench:
        bench.run_until_up()
        bench.server.apply(faults.YUp())
        for frame in bench.run_frames(10):
            for subject, body in zip(frame.subjects, BODIES, strict=True):
                assert subject.position_m == body.position_m
                assert subject.quaternion_xyzw == pytest.approx(body.quaternion_xyzw, abs=1e-15)


def test_empty_packets_are_no_frames() -> None:
    with Bench() as bench:
        bench.run_until_up()
        bench.server.apply(faults.EmptyPackets())
        bench.run_until(lambda: bench.client.state.name != "up")
        assert bench.client.state.last_error == "no frame for 0.15 s"
        assert bench.client.state.counters.rejected == 0
        bench.server.apply(faults.Recover())
        bench.run_until_up(connects=2)


def test_client_that_did_not_read_for_long_goes_on_with_the_same_connection() -> None:
    with Bench(PATIENT) as bench:
        bench.run_frames(2)
        bench.server.apply(faults.UnknownObject(size_bytes=65_536))
        bench.publishing = False
        for _ in range(2 * MAX_DRAIN_BYTES // 65_536):
            bench.publish()
            bench.server.poll()
        dropped = bench.server.dropped
        assert dropped > 0
        newest = bench.number - dropped - 1
        bench.run_until(lambda: bench.last.frame >= newest)
        bench.server.apply(faults.Recover())
        bench.publishing = True
        bench.run_frames(2)
        assert bench.client.state.connects == 1
