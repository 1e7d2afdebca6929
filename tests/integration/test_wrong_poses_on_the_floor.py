"""No vehicle takes off on a pose that is wrong before it stands armed: `check` names the cause."""

from collections.abc import Callable, Iterator

import pytest
from integration_support import Flying, Truth, transmitter_state
from support.bus import free_port

from rcopterx.ground_station.scripting.vehicle import RefusedError
from rcopterx.ground_station.scripting.waiting import NotReachedError
from rcopterx.simulator import faults
from rcopterx.simulator.faults import Fault
from rcopterx_studies.faults.scenario import inject_faults

pytestmark = [pytest.mark.integration, pytest.mark.lockstep]

TWO = """
name = "two"
[hosts.main]
router_port = {router}
[volume]
min_m = [-1.2, -1.2, 0.0]
max_m = [1.2, 1.2, 2.0]
[tracker]
address = "127.0.0.1:{tracker}"
[simulator]
rate_hz = 50
profile = "tracker1"
conditions = "helicopter"
seed = 1
[vehicles.h1]
subject = "heli1"
transmitter = {{ port = "radio-h1", model_match = 1 }}
[vehicles.h2]
subject = "heli2"
transmitter = {{ port = "radio-h2", model_match = 2 }}
follow = [{{ leader = "h1", offset_m = [-0.4, 0.5, 0.0] }}]
"""
FROZEN = "h1: its position has repeated itself exactly for "
Y_UP = "h2 stands at z = -0.50 m, below the floor: Y up, or another origin?"
ONE_BODY = "h1 is shown where h2 is: one body for two subjects?"
CASES: tuple[tuple[Fault, str, str], ...] = (
    (faults.FreezePose("heli1"), "h1", FROZEN),
    (faults.YUp(), "h1", Y_UP),
    (faults.YUp(), "h2", Y_UP),
    (faults.Millimetres(), "h2", "heli2 is shown at (-400, 500, 0) m: millimetres?"),
    (faults.DisplacePose("heli1", offset_m=(-0.4, 0.5, 0.0)), "h1", ONE_BODY),
    (faults.DisplacePose("heli1", offset_m=(0.0, 0.0, -0.3)), "h1", "h1 stands at z = -0.30 m, below the"),
    (faults.DisplacePose("heli1", offset_m=(0.0, 0.0, 0.6)), "h1", "h1 stands at z = 0.60 m, 0.60 m above"),
    (faults.DisplacePose("heli1", offset_m=(2.0, 0.0, 0.0)), "h1", "h1 is shown at (2.00, "),
    (faults.DisplacePose("heli1", velocity_m_s=(0.05, 0.0, 0.0)), "h1", "h1 moves: "),
)


@pytest.fixture(scope="module")
def two(launch_once: Callable[..., Flying]) -> Flying:
    """Two vehicles on the floor before a Tracker that cannot report its axes."""
    return launch_once(TWO.format(router=free_port(), tracker=free_port()))


@pytest.fixture
def inject(two: Flying) -> Iterator[Callable[[Fault], None]]:
    """Inject a fault that ends after the test; vehicles are disarmed then, and ready again."""
    yield lambda fault: inject_faults(two.fleet.session, fault)
    inject_faults(two.fleet.session, faults.Recover())
    two.fleet.land()
    two.fleet.wait_ready()


@pytest.mark.parametrize(("fault", "vehicle", "words"), CASES)
def test_wrong_pose_is_a_problem_and_the_vehicle_is_not_armed(
    two: Flying, inject: Callable[[Fault], None], fault: Fault, vehicle: str, words: str
) -> None:
    fleet, truth = two.fleet, Truth(two)
    assert not fleet.problems()
    inject(fault)

    def named() -> bool:
        return any(line.startswith(words) for line in fleet.problems([vehicle]))

    fleet.wait_until(named, 2.0, f"no problem {words!r}, but {fleet.problems([vehicle])}")
    assert sum(line.startswith(words) for line in fleet.problems()) == 1
    fleet.wait(0.2)
    with pytest.raises(NotReachedError, match="not ready: "):
        fleet.wait_ready([vehicle], timeout_s=0.3)
    with pytest.raises(RefusedError, match="pose"):
        fleet[vehicle].arm()
    assert transmitter_state(two, vehicle) == "disarmed"
    assert truth.height_m(vehicle) <= 0.0


def test_armed_vehicle_is_disarmed_when_its_pose_freezes(
    two: Flying, inject: Callable[[Fault], None]
) -> None:
    fleet = two.fleet
    fleet.arm()
    fleet.wait_until(lambda: transmitter_state(two, "h1") == "armed", 2.0, "not armed")
    inject(faults.FreezePose("heli1"))
    fleet.wait_until(lambda: transmitter_state(two, "h1") == "disarmed", 2.0, "h1 stays armed")
    assert any(line.startswith(FROZEN) for line in fleet.problems())
    assert fleet.state_of("h1").reason.startswith(f"on the floor: {FROZEN}")
    assert transmitter_state(two, "h2") == "armed"
    with pytest.raises(RefusedError):
        fleet["h1"].take_off(1.0)
