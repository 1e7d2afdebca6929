"""Promises of what is handed to each process: it says what the fleet file says, or the field is named."""

import math
from pathlib import Path

import pytest
from support.fleets import HARDWARE_PAIR, PAIR

from agents.formation.limit_scaling import LEADER_LIMIT_SCALE
from agents.interfaces import FULL_LIMITS
from agents.separation.avoidance import SeparationEllipsoid
from deploy.fleet_check import check_fleet
from deploy.fleet_file.reading import parse_fleet
from deploy.fleet_file.schema import FleetError
from deploy.roles.agent import agent_settings
from deploy.roles.priorities import Priority
from deploy.roles.simulator import conditions_of, simulator_settings
from deploy.roles.tracker import tracker_address, tracker_settings
from deploy.roles.transmitters import gateway_settings, limits_of, protocol_of
from deploy.roles.vehicle_models import model_of
from transmitter_gateway.protocols.registry import PROTOCOL_NAMES, default_line
from vehicles.types import COAXIAL, QUADROTOR


@pytest.fixture(autouse=True)
def _own_run_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))


def radio(extra: str) -> str:
    return PAIR.replace("model_match = 1 }", f"model_match = 1, {extra} }}")


@pytest.mark.parametrize("text", [PAIR, HARDWARE_PAIR])
def test_a_good_fleet_passes_every_check(text: str, tmp_path: Path) -> None:
    check_fleet(parse_fleet(text), tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            PAIR + 'type = "plane"',
            r"^vehicles\.h2\.type: unknown type 'plane', allowed are coaxial, quadrotor",
        ),
        (PAIR + "model = { mass = 1.0 }", r"^vehicles\.h2\.model\.mass: unknown field, allowed are kind"),
        (PAIR + "model = { lag_s = [0.1] }", r"^vehicles\.h2\.model\.lag_s: expected .*length 4"),
        (PAIR + "model = { lag_s = [-0.1, 0, 0, 0] }", r"^vehicles\.h2\.model: lag_s: must not be below 0"),
        (
            PAIR + "model = { input_gain = [1, 1, 0, 1] }",
            r"^vehicles\.h2\.model: input_gain: must be above 0",
        ),
        (PAIR + 'control = { controller = "x" }', r"^vehicles\.h2\.control: .*'x'; allowed are .*paper"),
        (PAIR + 'control = { estimator = "x" }', r"^vehicles\.h2\.control: .*'x'; allowed are .*kalman"),
        (PAIR + "control = { settings = { x = 1 } }", r"^vehicles\.h2\.control: .*'x'; allowed are horizon"),
        (PAIR + 'control = { settings = { time_limit_s = "a" } }', r"^vehicles\.h2\.control: .*time_limit_s"),
        (
            PAIR + "control = { estimator_settings = { x = 1 } }",
            r"^vehicles\.h2\.control: .*'x'; allowed are",
        ),
        (PAIR + "control = { estimator_settings = { yaw_gate_rad = -1.0 } }", "yaw_gate_rad"),
        (PAIR + "control = { period_s = 0.03 }", r"^vehicles\.h2\.control\.period_s: 0\.03 s is no whole"),
        (
            radio("calibration = { pitch = { index = 2, gain = 1 } }"),
            r"^vehicles\.h1\.\w+\.\w+\.pitch\.gain: ",
        ),
        (radio("calibration = { pitch = 3 }"), r"^vehicles\.h1\.transmitter\.calibration\.pitch: expected"),
        (radio('calibration = { yaw = { index = "a" } }'), r"^vehicles\.h1\.\w+\.\w+\.yaw\.index: expected"),
        (radio("calibration = { yaw = { index = 99 } }"), r"^vehicles\.h1\.\w+\.\w+\.yaw: index: 99"),
        (
            radio("calibration = { yaw = { index = 1 } }"),
            r"^vehicles\.h1\.\w+\.calibration: yaw\.index: .* 1 ",
        ),
        (
            radio("calibration = { throttle = { us0 = 1600.0 } }"),
            r"calibration\.throttle: us_hover: .*us0 = 1600",
        ),
        (radio("calibration = { throttle = { us1 = 3e3 } }"), r"calibration\.throttle: us1: 3000"),
        (radio("settings = { power = 1 }"), r"^vehicles\.h1\.transmitter\.settings: multi\.power: unknown"),
        (
            radio('settings = { channels = "a" }'),
            r"^vehicles\.h1\.transmitter\.settings: multi\.channels: 'a'",
        ),
        (
            radio('protocol = "ppm", low_power = true'),
            r"^vehicles\.h1\.transmitter\.low_power: cannot be asked for with protocol 'ppm'",
        ),
        (PAIR + "[safety.settings]\nbrake = 1", r"^safety\.settings\.brake: unknown field"),
        (PAIR + "[safety.settings]\nhold_after_s = -1.0", r"^safety\.settings: hold_after_s: -1\.0"),
        (PAIR + "[safety.settings]\nhold_after_s = 5.0", r"^safety\.settings: descend_after_s: "),
        (
            PAIR + "[safety.settings]\nsurveillance = 5",
            r"^safety\.settings\.surveillance: 5, must be a table",
        ),
        (
            PAIR + "[safety.settings.surveillance]\nx = 1",
            r"^safety\.settings\.surveillance\.x: unknown field",
        ),
        (PAIR + '[tracker]\naddress = "lab"', r"^tracker\.address: 'lab', must be HOST:PORT"),
        (PAIR + '[tracker]\naddress = "lab:70000"', r"^tracker\.address: 'lab:70000', must be HOST:PORT"),
        (PAIR + '[tracker]\naddress = "lab:²"', r"^tracker\.address: 'lab:²', must be HOST:PORT"),
        (PAIR + '[tracker]\naddress = ":801"', r"^tracker\.address: ':801', must be HOST:PORT"),
        (
            PAIR.replace("[simulator]", '[simulator]\nconditions = "mars"'),
            r"^simulator\.conditions: .*'mars'",
        ),
        (PAIR.replace("[simulator]", "[simulator]\ncondition_overrides = { x = 1 }"), r"^simulator\..*'x'"),
        (
            PAIR.replace("[simulator]", "[simulator]\ncondition_overrides = { position_noise_m = -1.0 }"),
            r"^simulator\.position_noise_m: -1\.0 is not a number between",
        ),
    ],
)
def test_a_wrong_field_is_refused_by_its_path_before_anything_is_started(
    text: str, words: str, tmp_path: Path
) -> None:
    with pytest.raises(FleetError, match=words):
        check_fleet(parse_fleet(text), tmp_path)
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_the_model_is_that_of_the_type_with_changes_and_the_bounds_of_the_volume() -> None:
    fleet = parse_fleet(
        PAIR + 'type = "quadrotor"\nmodel = { delay_s = 0.04 }\n[volume]\nmax_m = [3, 3, 2.5]'
    )
    assert model_of(fleet, "h1").input_gain == COAXIAL.input_gain
    model = model_of(fleet, "h2")
    assert (model.kind, model.delay_s, model.lag_s) == ("quadrotor", 0.04, QUADROTOR.lag_s)
    assert model.state_max == (3.0, 3.0, 2.5, *QUADROTOR.state_max[3:])
    assert model.state_min[:3] == fleet.volume.min_m


def test_agents_get_their_leaders_and_the_share_their_followers_leave_them() -> None:
    fleet = parse_fleet(PAIR)
    leader, follower = agent_settings(fleet, "h1"), agent_settings(fleet, "h2")
    assert leader.following == ()
    assert leader.share.inputs == 4 * (LEADER_LIMIT_SCALE,)
    assert follower.share == FULL_LIMITS
    assert [(link.leader, link.offset_m) for link in follower.following] == [("h1", (-0.4, 0.5, 0.0))]
    assert leader.vehicles == tuple(leader.models) == ("h1", "h2")
    assert leader.volume_max_m == fleet.volume.max_m


def test_what_others_wait_for_runs_at_the_higher_priority() -> None:
    fleet = parse_fleet(PAIR)
    router, gateway = Priority.ROUTER.of(fleet), Priority.GATEWAY.of(fleet)
    leader, follower = (agent_settings(fleet, name).realtime_priority for name in ("h1", "h2"))
    simulator = Priority.SIMULATOR.of(fleet)
    assert router > gateway > leader > follower > simulator == fleet.bus.realtime_priority
    without = parse_fleet(PAIR + "[bus]\nrealtime_priority = 0")
    assert {priority.of(without) for priority in Priority} == {0}
    highest = parse_fleet(PAIR + "[bus]\nrealtime_priority = 90")
    assert max(priority.of(highest) for priority in Priority) <= 99


def test_a_gateway_gets_its_own_transmitters_and_hears_all_vehicles(tmp_path: Path) -> None:
    fleet = parse_fleet(
        HARDWARE_PAIR.replace('"radio-h1"', '"/dev/ttyUSB0", gateway = "roof"')
        + "[gateways.roof]\n[gateways.transmitters]"
    )
    settings = {name: gateway_settings(fleet, name, tmp_path) for name in fleet.gateways}
    ports = {
        name: [(radio.vehicle, radio.port) for radio in one.transmitters] for name, one in settings.items()
    }
    assert ports == {
        "roof": [("h1", "/dev/ttyUSB0")],
        "transmitters": [("h2", str(tmp_path / "radio-h2"))],
    }
    assert settings["roof"].vehicles == ("h1", "h2")


@pytest.mark.parametrize("name", [name for name in PROTOCOL_NAMES if name != "sc8000p"])
def test_hardware_speaks_the_protocol_the_file_names(name: str) -> None:
    protocol = protocol_of(parse_fleet(HARDWARE_PAIR + f'[defaults.transmitter]\nprotocol = "{name}"'), "h2")
    assert protocol.name == name
    assert protocol.line == default_line(name)


def test_simulated_lines_have_no_parity_and_carry_the_model_match() -> None:
    protocol = protocol_of(parse_fleet(PAIR), "h2")
    assert protocol.line.parity == "N"
    assert protocol.encode([1100.0])[2] & 0x0F == 2


def test_the_fence_is_the_volume_unless_it_is_switched_off() -> None:
    fence = limits_of(parse_fleet(PAIR), "h1").surveillance.fence
    assert fence is not None
    assert (fence.lower_m, fence.upper_m) == ((-1.2, -1.2, 0.0), (1.2, 1.2, 2.0))
    assert limits_of(parse_fleet(PAIR + "[safety]\ngeofence = false"), "h1").surveillance.fence is None


def test_the_arbiter_limits_are_those_of_the_model_and_of_the_file() -> None:
    limits = limits_of(
        parse_fleet(
            PAIR
            + "model = { input_max = [0.5, 0.5, 0.9, 0.3] }\n[safety.settings]\nhold_after_s = 0.08\n"
            + "[safety.settings.surveillance]\nminimum_distance_m = 0.2"
        ),
        "h2",
    )
    assert limits.upper == (0.5, 0.5, 0.9, 0.3)
    assert limits.hold_after_s == 0.08
    assert limits.surveillance.minimum_distance_m == 0.2
    assert limits.surveillance.fence is not None


def test_the_tracker_gateway_maps_subjects_to_vehicles() -> None:
    fleet = parse_fleet(PAIR + '[tracker]\naddress = "vicon-pc:801"')
    settings = tracker_settings(fleet)
    assert (settings.host, settings.port) == ("vicon-pc", 801) == tracker_address(fleet)
    assert settings.subjects == {"heli1": "h1", "heli2": "h2"}


def test_vehicles_of_the_simulator_stand_in_formation_unless_placed_elsewhere(tmp_path: Path) -> None:
    start = "[simulator.start]\nh2 = [1.0, 0.5, 0.0, 1.5]"
    vehicles = simulator_settings(parse_fleet(PAIR), tmp_path).vehicles
    assert [(one.start.position_m, one.start.yaw_rad) for one in vehicles] == [
        ((0.0, 0.0, 0.0), 0.0),
        ((-0.4, 0.5, 0.0), 0.0),
    ]
    placed = simulator_settings(parse_fleet(PAIR.replace("[simulator]", start)), tmp_path).vehicles[1].start
    assert (placed.position_m, placed.yaw_rad) == ((1.0, 0.5, 0.0), 1.5)


def test_conditions_are_the_preset_with_single_changes_and_no_second_radio_delay() -> None:
    table = '[simulator]\nconditions = "ideal"\ncondition_overrides = { turbulence_rms = [1, 1, 1, 0] }'
    conditions = conditions_of(parse_fleet(PAIR.replace("[simulator]", table)))
    assert conditions.turbulence_rms == (1, 1, 1, 0)
    assert conditions.transport_delay_s == 0.0
    assert math.isclose(conditions.volume_max_m[2], 2.0)


def test_a_fleet_that_flies_hardware_has_nothing_to_simulate(tmp_path: Path) -> None:
    with pytest.raises(FleetError, match=r"simulator: this fleet flies hardware"):
        simulator_settings(parse_fleet(HARDWARE_PAIR), tmp_path)


def test_avoidance_is_on_unless_the_file_says_otherwise() -> None:
    assert agent_settings(parse_fleet(PAIR), "h1").clearance == SeparationEllipsoid(0.35, 0.6)
    wider = PAIR + "[avoidance]\nhorizontal_m = 0.5\n"
    assert agent_settings(parse_fleet(wider), "h1").clearance == SeparationEllipsoid(0.5, 0.6)
    off = PAIR + "[avoidance]\nenabled = false\n"
    assert agent_settings(parse_fleet(off), "h1").clearance is None
    with pytest.raises(FleetError, match=r"^avoidance\.vertical_m: .*0\.0"):
        parse_fleet(PAIR + "[avoidance]\nvertical_m = -1.0\n")
