import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing

import pytest
from support.records import replace
from support.waiting import DEADLINE_S
from tracker_bench import BODIES, PATIENT, QUICK, Bench

from rcopterx.simulator.faults import Close
from rcopterx.simulator.tracker_frame import PROFILES
from rcopterx.vicon_gateway.client import ClientLimits, DataStreamClient


def run_until(client: DataStreamClient, condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + DEADLINE_S
    while not condition():
        assert client.next_frame(0.005) is None
        assert time.monotonic() < deadline_s, client.state


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as found:
        found.settimeout(DEADLINE_S)
        yield found


def client_of(listener: socket.socket, **limits: float) -> DataStreamClient:
    return DataStreamClient(*listener.getsockname(), limits=replace(QUICK, **limits))


@pytest.mark.parametrize("profile", PROFILES)
def test_client_delivers_what_the_tracker_captures(profile: str) -> None:
    with Bench(PATIENT, profile=profile) as bench:
        frames = bench.run_frames(10)
        for frame in frames:
            assert (frame.connection, frame.period_s) == (1, 0.005)
            assert [(s.name, s.occluded, s.position_m) for s in frame.subjects] == [
                (body.name, False, body.position_m) for body in BODIES
            ]
            for subject, body in zip(frame.subjects, BODIES, strict=True):
                assert subject.quaternion_xyzw == pytest.approx(body.quaternion_xyzw, abs=1e-15)
                assert subject.quality == (body.quality if profile == "tracker3" else None)
        state = bench.client.state
        assert (state.name, state.connects, state.counters.rejected) == ("up", 1, 0)
        assert state.doing == "receiving 200 Hz from {}:{}".format(*bench.server.address)
        numbers = [frame.frame for frame in frames]
        assert numbers == sorted(set(numbers))


def test_state_is_up_only_after_the_first_frame() -> None:
    with Bench(PATIENT) as bench:
        bench.publishing = False
        bench.run_until(lambda: "waiting for the first frame with segments" in bench.client.state.doing)
        assert bench.client.state.name == "negotiating"
        bench.publishing = True
        bench.run_frames(1)
        assert bench.client.state.name == "up"


def test_absent_tracker_is_tried_again_with_growing_pauses_and_said_so() -> None:
    # A bound socket that does not listen: no other program gets its number meanwhile.
    absent = socket.socket()
    absent.bind(("127.0.0.1", 0))
    port = absent.getsockname()[1]
    now_s = 0.0
    client = DataStreamClient("127.0.0.1", port, clock=lambda: now_s)
    deadline_s = time.monotonic() + DEADLINE_S
    pauses = []
    for number in range(2, 9):
        while f"(try {number})" not in client.state.doing:
            assert client.next_frame(0.0) is None
            assert time.monotonic() < deadline_s, client.state
        assert client.state.name == "waiting"
        assert client.state.last_error == "Connection refused"
        assert client.state.doing.startswith(f"trying 127.0.0.1:{port} again in")
        pauses.append(client.state.doing.split(" in ")[1].split(" s ")[0])
        now_s += 2.0
    absent.close()
    assert pauses == ["0.1", "0.2", "0.4", "0.8", "1.6", "2.0", "2.0"]
    assert client.state.connects == 0


def test_pauses_start_again_short_once_frames_have_arrived() -> None:
    limits = replace(PATIENT, retry_min_s=0.01, retry_max_s=1000.0)
    with Bench(limits) as bench:
        # Pauses that went on doubling would have passed the deadline long before the last round.
        for connects in range(1, 16):
            bench.run_until_up(connects)
            bench.server.apply(Close())
            bench.run_until(lambda: bench.client.state.name != "up")


def test_other_server_on_the_port_is_told_apart(listener: socket.socket) -> None:
    with closing(client_of(listener)) as client:
        run_until(client, lambda: client.state.name == "negotiating")
        link, _ = listener.accept()
        with link:
            link.sendall(b"vrpn: ver. 07.35  0\0\0\0\0\0")
            run_until(client, lambda: client.state.last_error is not None)
        assert "not a DataStream server" in str(client.state.last_error)
        assert client.state.counters.rejected == 1


def test_server_that_says_nothing_is_given_up(listener: socket.socket) -> None:
    with closing(client_of(listener, connect_s=0.1)) as client:
        run_until(client, lambda: client.state.name == "negotiating")
        run_until(client, lambda: client.state.name != "negotiating")
        assert client.state.last_error == "connected, but no offer within 0.1 s: not a DataStream server?"


def test_server_without_frames_is_given_up() -> None:
    with Bench(replace(QUICK, connect_s=0.2)) as bench:
        bench.publishing = False
        bench.run_until(lambda: bench.client.state.name == "negotiating")
        bench.run_until(lambda: bench.client.state.name != "negotiating")
        assert bench.client.state.last_error == "no frame with segments within 0.2 s after the selection"
        bench.run_until(lambda: bench.client.state.connects >= 2)


def test_host_that_cannot_be_found_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> list[object]:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", refuse)
    client = DataStreamClient("tracker-pc", limits=QUICK)
    run_until(client, lambda: client.state.last_error is not None)
    assert "host 'tracker-pc': [Errno -2] Name or service not known" in str(client.state.last_error)


def test_look_up_that_hangs_does_not_hold_up_the_caller(monkeypatch: pytest.MonkeyPatch) -> None:
    release = threading.Event()

    def hang(*_: object) -> list[object]:
        release.wait(DEADLINE_S)
        raise OSError("released")

    monkeypatch.setattr(socket, "getaddrinfo", hang)
    client = DataStreamClient("tracker-pc", limits=replace(QUICK, connect_s=0.05))
    run_until(client, lambda: client.state.last_error is not None)
    assert client.state.last_error == "host 'tracker-pc': no answer to the look-up"
    release.set()


def test_closed_client_delivers_nothing_and_raises_nothing() -> None:
    with Bench() as bench:
        bench.run_until_up()
        bench.client.close()
        assert bench.client.next_frame(60.0) is None
        assert bench.client.state.name == "closed"
        bench.run_until(lambda: bench.server.clients == 0)


def test_limits_default_to_those_of_the_specification() -> None:
    limits = ClientLimits()
    assert (limits.silence_periods, limits.silence_min_s) == (5.0, 0.1)
    assert (limits.retry_min_s, limits.retry_max_s) == (0.1, 2.0)
