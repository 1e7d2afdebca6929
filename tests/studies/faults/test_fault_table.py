"""The table of fault flights is complete, and every row of it can be flown."""

from collections import Counter
from pathlib import Path

import pytest

from rcopterx.deploy.processes.table import processes_of
from rcopterx.deploy.roles.simulator import conditions_of
from rcopterx.fleet.reading import fleet_path, load_fleet
from rcopterx.fleet.schema import FleetFile
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.ground_station.acceptance.flight import DEFAULT_FLEET
from rcopterx.simulator.faults import (
    FaultError,
    FreezePose,
    Occlude,
    TimedFault,
    timed_faults,
)
from rcopterx.simulator.laboratory import Laboratory
from rcopterx.simulator.plant import BodyPose
from rcopterx.simulator.vehicle_faults import VehicleFaults
from rcopterx_studies.faults.bench import FaultFlight
from rcopterx_studies.faults.laboratory_injectors import LaboratoryFault
from rcopterx_studies.faults.process_injectors import Pair
from rcopterx_studies.faults.promise import LIMITS, Promise
from rcopterx_studies.faults.scenario import injected_faults
from rcopterx_studies.faults.table import FAULT_FLIGHTS, PROCESSES, ROWS
from rcopterx_studies.faults.take_off_table import BESIDE, FAULTS, SIGNS, moments_of
from rcopterx_studies.faults.take_off_table import FLEET as TYPES_FILE

FLEET = load_fleet(fleet_path(DEFAULT_FLEET))
TYPES = load_fleet(TYPES_FILE)
TURN_S = {
    "coaxial": 0.0,
    "crazyflie": 0.55,
    "betaflight": 1.1,
    "mavlink_quadrotor": 0.0,
    "ardupilot_quadrotor": 0.55,
}
ENDINGS = (
    "killed", "stopped-0.1-s", "stopped-0.5-s", "stopped-2-s", "stopped-30-s", "spins", "starved", "slow",
    "dies-at-start", "crash-loop",
)  # fmt: skip


def fleet_of(row: FaultFlight) -> FleetFile:
    return FLEET if row.fleet is None else load_fleet(row.fleet)


def test_every_fault_begins_at_every_moment_of_a_take_off_of_every_type() -> None:
    assert {name: vehicle.type for name, vehicle in TYPES.vehicles.items()} == {name: name for name in BESIDE}
    assert set(BESIDE) == {"coaxial", "crazyflie", "betaflight", "mavlink_quadrotor", "ardupilot_quadrotor"}
    for kind in FAULTS:
        for moment, (_, after_s) in moments_of(kind).items():
            for name in BESIDE:
                row = FAULT_FLIGHTS[f"take-off-{kind}-{moment}-{name}"]
                assert row.take_off is not None
                assert row.take_off.vehicle == name
                if after_s is None:
                    assert row.take_off.after_s is None
                else:
                    assert row.take_off.after_s == pytest.approx(TURN_S[name] + after_s)
                height_m = 0.3 if kind in SIGNS else 0.15
                assert (row.allowed.height_m, row.allowed.touchdown_m_s) == (height_m, 1.0)
                assert not row.launched


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("crazyflies", "crazyflie"),
        ("brushless", "crazyflie"),
        ("ardupilots", "ardupilot_quadrotor"),
        ("px4", "mavlink_quadrotor"),
        ("betaflights", "betaflight"),
    ],
)
def test_every_type_that_laboratories_own_has_a_fleet_that_flies_the_rows(name: str, kind: str) -> None:
    fleet = load_fleet(TYPES_FILE.with_name(f"three_{name}.toml"))
    assert [vehicle.type for vehicle in fleet.vehicles.values()] == 3 * [kind]
    assert conditions_of(fleet).brushless is (name == "brushless")
    assert {*fleet.vehicles} == {*FLEET.vehicles}


def test_there_are_at_least_sixty_faults_and_no_name_twice() -> None:
    assert len(FAULT_FLIGHTS) == len(ROWS) >= 60


@pytest.mark.parametrize("what", PROCESSES)
@pytest.mark.parametrize("ending", ENDINGS)
def test_everything_happens_to_every_kind_of_process(what: str, ending: str) -> None:
    assert FAULT_FLIGHTS[f"{what}-{ending}"].launched


@pytest.mark.parametrize("kind", ["killed", "stopped", "starved"])
def test_every_process_fails_up_to_200_ms_after_every_process(kind: str) -> None:
    rows = [FAULT_FLIGHTS[f"pair-{kind}-{first}-{second}"] for first in PROCESSES for second in PROCESSES]
    apart_s = [fault.apart_s for row in rows for fault in row.faults if isinstance(fault, Pair)]
    assert Counter(apart_s) == dict.fromkeys([0.0, 0.04, 0.08, 0.12, 0.16, 0.2], 6)


def test_the_processes_of_the_table_are_those_of_the_fleet() -> None:
    names = {spec.name for spec in processes_of(FLEET, "main")}
    assert set(PROCESSES.values()) == names - {"simulator", "learner", "agent-h3"}


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_faults_of_the_laboratory_are_ones_that_it_knows(row: FaultFlight) -> None:
    fleet = fleet_of(row)
    lines = [TimedFault(0.0, fault.of(fleet)) for fault in row.faults if isinstance(fault, LaboratoryFault)]
    assert timed_faults(injected_faults(lines)) == tuple(lines)
    subjects = {vehicle.subject for vehicle in fleet.vehicles.values()}
    assert {line.fault.subject for line in lines if isinstance(line.fault, Occlude | FreezePose)} <= subjects
    assert row.allowed == (row.limits or LIMITS[row.promise])


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_vehicles_come_down_exactly_where_that_is_promised(row: FaultFlight) -> None:
    assert set(row.down) <= set(FLEET.vehicles)
    assert bool(row.down) == (row.promise not in (Promise.FLIES_ON, Promise.REFUSED, Promise.STAYS_DOWN))


@pytest.mark.parametrize(
    ("path", "refused"),
    [
        (fleet_path(DEFAULT_FLEET), {f"vehicle-attitude-{name}" for name in ("weak", "strong", "damaged")}),
        (fleet_path("crazyflies"), {"vehicle-drifts"}),
        (TYPES_FILE.with_name("three_ardupilots.toml"), {"vehicle-drifts"}),
        (TYPES_FILE.with_name("three_betaflights.toml"), {"vehicle-drifts"}),
        (TYPES_FILE.with_name("three_crazyflies.toml"), {"vehicle-drifts"}),
    ],
    ids=lambda value: getattr(value, "stem", ""),
)
def test_faults_of_a_swash_plate_and_of_attitude_loops_are_for_vehicles_that_have_them(
    path: Path, refused: set[str]
) -> None:
    fleet = load_fleet(path)
    models = {name: model_of(fleet, name) for name in fleet.vehicles}
    starts = {name: BodyPose((0.0, 0.0, 1.0)) for name in models}
    vehicles = VehicleFaults(Laboratory(models, starts, conditions_of(fleet)).plants, {})
    of_vehicles = [row for row in ROWS if row.name.startswith("vehicle-")]
    assert {row.name for row in of_vehicles if not accepted(row, vehicles)} == refused


def accepted(row: FaultFlight, vehicles: VehicleFaults) -> bool:
    faults = [fault.fault for fault in row.faults if isinstance(fault, LaboratoryFault)]
    try:
        vehicles.check([TimedFault(0.0, fault) for fault in faults])
    except FaultError:
        return False
    return True
