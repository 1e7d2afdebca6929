"""Promises of vehicle types: those that come with the package, those of others, and what is refused."""

import math
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import tomlkit
from support.equation_one import motion_derivative

from rcopterx.fleet import vehicle_types
from rcopterx.fleet.radios import calibration_of, protocol_of, type_calibration
from rcopterx.fleet.reading import load_fleet, parse_fleet, write_snapshot
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.fleet.vehicle_models import limits_of, model_of
from rcopterx.fleet.vehicle_types import VehicleType, type_names, type_of, vehicle_type
from rcopterx.ground_station.terminal.margins import fleet_margins

every_type = pytest.mark.parametrize("kind", [vehicle_type(name) for name in type_names()], ids=type_names())
FLEET = """
name = "lab"
[vehicles.h1]
type = "{type}"
subject = "heli1"
transmitter = {{ port = "radio-h1" }}
"""


def table_of(kind: VehicleType) -> dict[str, Any]:
    """A type as a table that can be written."""
    plain: dict[str, Any] = msgspec.to_builtins(kind.file)
    del plain["base"]
    return plain


def written(path: Path, table: dict[str, Any]) -> Path:
    path.write_text(tomlkit.dumps(table))
    return path


@every_type
def test_hover_input_balances_gravity_within_the_limits(kind: VehicleType) -> None:
    model = kind.model
    assert np.all(model.hover_input >= model.u_min)
    assert np.all(model.hover_input <= model.u_max)
    assert np.allclose(motion_derivative(model, np.zeros(8), model.hover_input, np.zeros(4)), 0.0)
    assert model.hover_thrust == pytest.approx(model.hover_input[2], rel=0.02)


@every_type
def test_limits_are_consistent(kind: VehicleType) -> None:
    model = kind.model
    assert np.all(np.array(model.state_min) < np.array(model.state_max))
    assert np.all(model.u_min < model.u_max)
    assert np.all(model.k <= 0)
    assert np.all(model.b > 0)


@every_type
def test_full_thrust_climbs_and_no_thrust_falls(kind: VehicleType) -> None:
    model = kind.model
    assert model.b[2] * model.u_max[2] > model.gravity_m_s2
    assert model.u_min[2] == 0.0


@every_type
def test_every_type_makes_a_complete_vehicle(kind: VehicleType) -> None:
    fleet = parse_fleet(FLEET.format(type=kind.name))
    assert model_of(fleet, "h1").kind == kind.name
    assert limits_of(fleet, "h1").lower == kind.model.input_min
    radio = protocol_of(fleet, "h1")
    radio.check(calibration_of(fleet, "h1").pulses_us((0.0, 0.0, 0.0, 0.0)))


def test_a_fleet_file_names_the_path_of_a_type_file_that_snapshots_contain(tmp_path: Path) -> None:
    table = table_of(vehicle_type("quadrotor"))
    table["model"]["delay_s"] = 0.055
    table["transmitter"] = {"protocol": "dsmp", "calibration": {"pitch": {"gain_us": 300.0}}}
    (tmp_path / "types").mkdir()
    written(tmp_path / "types" / "mine.toml", table)
    path = tmp_path / "lab.toml"
    path.write_text(FLEET.format(type="types/mine.toml"))
    write_snapshot(load_fleet(path), tmp_path / "snapshot.json")
    fleet = load_fleet(tmp_path / "snapshot.json")
    assert (model_of(fleet, "h1").kind, model_of(fleet, "h1").delay_s) == ("mine", 0.055)
    assert protocol_of(fleet, "h1").name == "dsmp"
    assert calibration_of(fleet, "h1").pitch.gain_us == 300.0


def test_a_fleet_file_holds_a_type_of_its_own() -> None:
    table = {"types": {"tiny": table_of(vehicle_type("coaxial"))}}
    fleet = parse_fleet(FLEET.format(type="tiny") + tomlkit.dumps(table))
    assert type_of(fleet, "h1").name == "tiny"
    assert model_of(fleet, "h1").airframe == "coaxial"


def test_an_installed_package_adds_a_type(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "fast_types"
    package.mkdir()
    (package / "__init__.py").touch()
    written(package / "fast.toml", table_of(vehicle_type("quadrotor")))
    monkeypatch.syspath_prepend(tmp_path)
    added = [
        EntryPoint("fast", "fast_types", vehicle_types.GROUP),
        EntryPoint("lost", "no_such_package", vehicle_types.GROUP),
    ]
    monkeypatch.setattr(vehicle_types, "entry_points", lambda group: added)
    assert {"fast", "lost", "coaxial"} <= set(type_names())
    assert model_of(parse_fleet(FLEET.format(type="fast")), "h1").kind == "fast"
    with pytest.raises(FleetError, match=r"type 'lost' of no_such_package: cannot be read"):
        vehicle_type("lost")


@pytest.mark.parametrize(
    ("keys", "value", "message"),
    [
        (("model", "input_gan"), [1.0], r"mine.toml: model.input_gan: unknown field, allowed are kind"),
        (("model", "tilt"), {"frequency_rad_s": 12.0}, r"mine.toml: model.tilt: .*damping_ratio"),
        (("model", "kind"), "x", r"mine.toml: model.kind: it is the name of the type"),
        (("model", "lag_s"), [0.1, 0.1, 0.1], r"mine.toml: model.lag_s: expected `array` of length 4"),
        (("text",), "", r"mine.toml: text: "),
        (("colour",), "red", r"mine.toml: .*`colour`, allowed are text"),
        (
            ("transmitter", "protocol"),
            "morse",
            r"mine.toml: transmitter.protocol: .*allowed are crazyflie, dsm2_serial",
        ),
        (
            ("transmitter", "settings", "rate"),
            3,
            r"mine.toml: transmitter.settings.rate: unknown field, allowed are rx_num",
        ),
        (
            ("transmitter", "calibration", "pitch"),
            {"sign": 2},
            r"mine.toml: transmitter.calib.*sign: 2",
        ),
        (("safety", "low_thrust"), -1.0, r"mine.toml: safety: low_thrust: -1.0 must be a positive number"),
        (("lowest_ceiling_m",), -1.0, r"mine.toml: lowest_ceiling_m: "),
    ],
)
def test_a_wrong_type_is_refused_with_its_file_and_key(
    tmp_path: Path, keys: tuple[str, ...], value: object, message: str
) -> None:
    table = table_of(vehicle_type("quadrotor"))
    place = table
    for key in keys[:-1]:
        place = place.setdefault(key, {})
    place[keys[-1]] = value
    written(tmp_path / "mine.toml", table)
    (tmp_path / "lab.toml").write_text(FLEET.format(type="mine.toml"))
    with pytest.raises(FleetError, match=message):
        _check(load_fleet(tmp_path / "lab.toml"))


def _check(fleet: FleetFile) -> None:
    """What agents and transmitter gateways check of a vehicle."""
    limits_of(fleet, "h1")
    calibration_of(fleet, "h1")
    protocol_of(fleet, "h1")


def test_a_type_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text(FLEET.format(type="gone.toml"))
    with pytest.raises(FleetError, match=r"gone\.toml: .*cannot be read: No such file"):
        load_fleet(tmp_path / "lab.toml")


def test_a_room_that_is_too_low_for_the_type_is_refused() -> None:
    table = table_of(vehicle_type("quadrotor")) | {"lowest_ceiling_m": 2.5}
    fleet = parse_fleet(FLEET.format(type="tall") + tomlkit.dumps({"types": {"tall": table}}))
    with pytest.raises(FleetError, match=r"volume.max_m\[2\]: 2 m is too low for h1"):
        limits_of(fleet, "h1")


def test_a_type_leaves_out_what_its_base_has() -> None:
    table = {"text": "like it", "base": "betaflight", "model": {"delay_s": 0.06}}
    fleet = parse_fleet(FLEET.format(type="mine") + tomlkit.dumps({"types": {"mine": table}}))
    assert model_of(fleet, "h1").delay_s == 0.06
    assert model_of(fleet, "h1").input_gain == vehicle_type("betaflight").model.input_gain
    assert calibration_of(fleet, "h1").arming == type_calibration(vehicle_type("betaflight")).arming
    table["base"] = "balloon"
    wrong = parse_fleet(FLEET.format(type="mine") + tomlkit.dumps({"types": {"mine": table}}))
    with pytest.raises(FleetError, match=r"types.mine: unknown type 'balloon', allowed are"):
        model_of(wrong, "h1")


@every_type
def test_margins_of_every_type_cover_its_uncertainty(kind: VehicleType) -> None:
    document = fleet_margins(parse_fleet(FLEET.format(type=kind.name)), ["h1"])
    for axis, found in document["vehicles"]["h1"]["axes"].items():
        assert not found["below_rule"], axis


def test_the_uncertainty_of_a_quadrotor_covers_angle_limits_of_20_to_50_degrees() -> None:
    model = vehicle_type("quadrotor").model
    for limit_deg in (20.0, 50.0):
        gain = 9.81 * math.tan(math.radians(limit_deg))
        factor = max(gain / model.input_gain[0], model.input_gain[0] / gain)
        assert factor <= model.uncertainty.gain_factor[0]


def test_full_stick_of_the_crazyflie_is_the_same_for_its_model_and_its_protocol() -> None:
    kind = vehicle_type("crazyflie")
    protocol = protocol_of(parse_fleet(FLEET.format(type="crazyflie")), "h1")
    full = protocol.settings
    tilt_rad = kind.model.input_gain[0] / 9.81
    assert tilt_rad / math.radians(full.full_tilt_deg) == pytest.approx(0.78, rel=0.01), "as identified"
    yaw_rate = kind.model.input_gain[3] / -kind.model.damping[3]
    assert yaw_rate == pytest.approx(math.radians(full.full_yaw_rate_deg_s), rel=0.01)
    low, hover, high = (type_calibration(kind).throttle.pulse_us(u) for u in (0.0, 0.55, 1.0))
    assert (low, hover, high) == (1100.0, 1540.0, 1900.0), "thrust is linear"


@pytest.mark.parametrize(
    ("name", "mode", "hover_us"),
    [("mavlink_quadrotor", "offboard", 1500.0), ("ardupilot_quadrotor", "guided_nogps", 1396.0)],
)
def test_full_stick_of_a_quadrotor_with_mavlink_is_the_same_for_its_model_and_its_protocol(
    name: str, mode: str, hover_us: float
) -> None:
    kind = vehicle_type(name)
    full = protocol_of(parse_fleet(FLEET.format(type=name)), "h1").settings
    assert full.mode == mode
    tilt = 9.81 * math.tan(math.radians(full.full_tilt_deg))
    assert kind.model.input_gain[:2] == pytest.approx((tilt, tilt), rel=0.01)
    yaw_rate = kind.model.input_gain[3] / -kind.model.damping[3]
    assert yaw_rate == pytest.approx(math.radians(full.full_yaw_rate_deg_s), rel=0.01)
    pulses_us = [type_calibration(kind).throttle.pulse_us(u) for u in (0.0, kind.model.hover_thrust, 1.0)]
    assert pulses_us == pytest.approx([1100.0, hover_us, 1900.0]), "thrust is linear"


@pytest.mark.parametrize("kind", ["crazyflie", "mavlink_quadrotor", "ardupilot_quadrotor"])
def test_gains_follow_the_full_sticks_of_the_radio_unless_the_file_gives_them(kind: str) -> None:
    settings = "settings = {{ full_tilt_deg = 20.0, full_yaw_rate_deg_s = 100.0 }}"
    text = FLEET.replace('"radio-h1"', f'"radio-h1", {settings}')
    usual, found = (model_of(parse_fleet(one.format(type=kind)), "h1") for one in (FLEET, text))
    tilt = math.tan(math.radians(20.0)) / math.tan(math.radians(30.0))
    expected = np.array(usual.input_gain) * (tilt, tilt, 1.0, 0.5)
    assert found.input_gain == pytest.approx(tuple(expected))
    own = text + "model = {{ input_gain = [1.0, 2.0, 20.0, 30.0] }}"
    assert model_of(parse_fleet(own.format(type=kind)), "h1").input_gain == (1.0, 2.0, 20.0, 30.0)
