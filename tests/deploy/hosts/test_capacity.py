"""Promises of measuring how many vehicles a computer flies."""

import os
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.fleets import PAIR
from support.waiting import wait_for

from rcopterx.bus.processes import AGENT
from rcopterx.deploy.hosts import capacity
from rcopterx.deploy.hosts.capacity import CapacityMeasurement, HostCapacity, vehicles_flown
from rcopterx.deploy.processes.forking import ForkServer
from rcopterx.deploy.processes.supervisor import Supervisor
from rcopterx.deploy.processes.table import ProcessSpec
from rcopterx.deploy.watchdog.processor_time import ThreadTime
from rcopterx.fleet.reading import parse_fleet, write_snapshot
from rcopterx_studies.benchmarks.processes import descendants

PERIOD_S = 0.02


@given(
    share=st.floats(1e-3, 1.0),
    control_s=st.floats(1e-5, 1.0),
    period_s=st.floats(1e-3, 0.1),
    processors=st.integers(1, 64),
    factor=st.integers(2, 5),
)
def test_faster_and_more_processors_fly_more(
    share: float, control_s: float, period_s: float, processors: int, factor: int
) -> None:
    flown = vehicles_flown(share, control_s, period_s, processors)
    more = vehicles_flown(share, control_s, period_s, factor * processors)
    dearer = vehicles_flown(factor * share, factor * control_s, period_s, processors)
    for number, of_more, of_dearer in zip(flown[:-1], more[:-1], dearer[:-1], strict=True):
        # Up to the rounding of a quotient that is a whole number.
        assert of_more >= factor * number - 1
        assert factor * of_dearer <= number + 1
    assert dearer[-1] <= flown[-1] <= more[-1]
    assert list(flown) == sorted(flown)


def test_a_vehicle_costs_what_it_costs_standing_and_its_control_periods() -> None:
    # 0.1 of a processor each, and 2 ms of 20: six of them use 1.2 of two processors, seven 1.4.
    assert vehicles_flown(0.0999, 0.002, PERIOD_S, 2)[0] == 6


def test_a_computer_flies_more_vehicles_the_fewer_control_periods_are_computed() -> None:
    # Standing costs 0.1 each. The last number, at a quarter of 6 ms in 20, uses 0.75 of the processors.
    assert vehicles_flown(0.1, 0.006, PERIOD_S, 2) == (3, 5, 6, 8)


def test_a_few_vehicles_fly_on_any_computer() -> None:
    assert vehicles_flown(9.0, 1.0, PERIOD_S, 2) == (0, 0, 0, 3)


@pytest.fixture(scope="module")
def forks() -> Iterator[ForkServer]:
    with closing(ForkServer(["rcopterx.deploy.roles.agent"])) as server:
        yield server


@pytest.fixture
def measuring(forks: ForkServer) -> Callable[[], int]:
    """How many processes measure."""
    before = set(descendants(os.getpid()))
    return lambda: len(set(descendants(os.getpid())) - before - {forks.pid})


def measurement_of(forks: ForkServer, tmp_path: Path, text: str = PAIR) -> CapacityMeasurement:
    snapshot = tmp_path / "fleet.json"
    write_snapshot(parse_fleet(text), snapshot)
    # This process stands for the whole fleet.
    return CapacityMeasurement(snapshot, "h2", PERIOD_S, forks, lambda: {os.getpid(): AGENT})


def result_of(measurement: CapacityMeasurement) -> tuple[int, ...] | str:
    results: list[tuple[int, ...] | str] = []

    def stepped() -> bool:
        results.extend(found for found in [measurement.step(ready=True)] if found is not None)
        return bool(results)

    wait_for(stepped, "there is no result", deadline_s=500)
    assert measurement.step(ready=True) is None
    return results[0]


@pytest.mark.timeout(600)
def test_this_computer_flies_some_vehicles_and_nothing_stays(
    tmp_path: Path, forks: ForkServer, measuring: Callable[[], int]
) -> None:
    assert isinstance(result_of(measurement_of(forks, tmp_path)), tuple)
    wait_for(lambda: measuring() == 0, "a measuring process stays")


@pytest.mark.timeout(600)
def test_processes_of_a_standing_fleet_are_shared_out_among_its_agents(
    tmp_path: Path, forks: ForkServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    running = {1: AGENT, 2: AGENT, 3: "router", 4: AGENT}
    ran_s, now_s = [0.0], [0.0]
    write_snapshot(parse_fleet(PAIR), tmp_path / "fleet.json")
    monkeypatch.setattr(
        capacity, "threads_of", lambda process: {process: ThreadTime("S", process * ran_s[0], 0.0)}
    )

    shares: list[float] = []

    def flown(share: float, *_: float) -> tuple[int, ...]:
        shares.append(share)
        return (7,)

    monkeypatch.setattr(capacity, "vehicles_flown", flown)
    measurement = CapacityMeasurement(
        tmp_path / "fleet.json", "h1", PERIOD_S, forks, lambda: running, lambda: now_s[0]
    )
    assert measurement.step(ready=True) is None
    # One agent has ended meanwhile, and another process is new.
    running = {1: AGENT, 2: AGENT, 3: "router", 5: AGENT}
    ran_s, now_s = [0.1], [4.0]
    assert result_of(measurement) == (7,)
    assert shares == [pytest.approx((0.1 + 0.2 + 0.3) / 4.0 / 2)]


@pytest.mark.timeout(600)
def test_processes_of_late_agents_need_all_processors_until_they_are_measured_again(
    tmp_path: Path, forks: ForkServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(capacity, "STANDING_S", 0.1)
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1})
    shares: list[float] = []

    def flown(share: float, *_: float) -> tuple[int, ...]:
        shares.append(share)
        return (7,)

    monkeypatch.setattr(capacity, "vehicles_flown", flown)
    measurement = measurement_of(forks, tmp_path)
    wait_for(lambda: measurement.step(ready=True, late=True) == (7,), "there is no result", deadline_s=500)
    assert shares == [2.0]
    assert not measurement.done
    assert result_of(measurement) == (7,)
    assert shares[1] < 2.0
    assert measurement.done


def test_a_measurement_that_fails_says_so(
    tmp_path: Path, forks: ForkServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(capacity, "MODULE", "no_such_module")
    result = str(result_of(measurement_of(forks, tmp_path)))
    assert result.startswith("how many vehicles this computer flies cannot be measured: exit code 1 ")
    assert "no_such_module" in result


@pytest.mark.timeout(600)
def test_a_vehicle_that_cannot_be_built_says_why(tmp_path: Path, forks: ForkServer) -> None:
    result = result_of(measurement_of(forks, tmp_path, PAIR + 'control = { controller = "x" }'))
    assert "no controller is called 'x'" in str(result)


@pytest.mark.timeout(600)
def test_a_measurement_that_takes_too_long_is_given_up(
    tmp_path: Path, forks: ForkServer, measuring: Callable[[], int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(capacity, "LIMIT_S", 0.0)
    assert "it takes more than 0 s" in str(result_of(measurement_of(forks, tmp_path)))
    wait_for(lambda: measuring() == 0, "a measuring process stays")


def test_nothing_is_begun_before_the_computer_is_ready_and_agents_run(tmp_path: Path) -> None:
    forks = ForkServer()
    assert measurement_of(forks, tmp_path).step(ready=False) is None
    alone = CapacityMeasurement(tmp_path / "fleet.json", "h2", PERIOD_S, forks, lambda: {1: "router"})
    assert alone.step(ready=True) is None
    assert forks.pid is None


@pytest.mark.timeout(600)
def test_a_measurement_is_given_up_for_a_flight_and_begun_again_after_it(
    tmp_path: Path, forks: ForkServer, measuring: Callable[[], int]
) -> None:
    measurement = measurement_of(forks, tmp_path)
    assert measurement.step(ready=True) is None
    assert measuring() == 1
    assert measurement.step(ready=False) is None
    wait_for(lambda: measuring() == 0, "the measuring process stays")
    assert not measurement.done
    assert isinstance(result_of(measurement), tuple)
    assert measurement.done


@pytest.mark.timeout(600)
def test_a_measurement_that_is_closed_has_no_result_and_leaves_nothing(
    tmp_path: Path, forks: ForkServer, measuring: Callable[[], int]
) -> None:
    measurement = measurement_of(forks, tmp_path)
    assert measurement.step(ready=True) is None
    measurement.close()
    assert measurement.step(ready=True) is None
    wait_for(lambda: measuring() == 0, "the measuring process stays")


def test_that_it_is_not_known_what_the_host_flies_is_said_from_the_beginning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(capacity, "SURE", 0.0)
    supervisor = supervisor_of(1, tmp_path)
    unused = CapacityMeasurement(tmp_path / "lab.toml", "h1", PERIOD_S, ForkServer(), dict)
    assert HostCapacity(supervisor, lambda: unused).measuring
    assert not HostCapacity(supervisor, None).measuring


def test_only_so_few_agents_as_any_computer_serves_take_off_before_that_is_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1})
    unused = CapacityMeasurement(tmp_path / "lab.toml", "h1", PERIOD_S, ForkServer(), dict)

    def measured_first(agents: int) -> bool:
        return HostCapacity(supervisor_of(agents, tmp_path), lambda: unused).measuring

    assert list(filter(measured_first, range(20))) == list(range(4, 20))


def supervisor_of(agents: int, directory: Path) -> Supervisor:
    specs = [ProcessSpec("router", "router", "main")]
    specs += [ProcessSpec(f"agent-h{number}", "agent", f"h{number}") for number in range(agents)]
    return Supervisor(specs, directory / "lab.toml", directory, ForkServer())
