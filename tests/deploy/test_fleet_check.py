"""Promises of the check before a start: a wrong field is named, and nothing is started."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from support.fleets import HARDWARE_PAIR, PAIR

from rcopterx.deploy import fleet_check
from rcopterx.deploy.fleet_check import check_fleet, check_in_process
from rcopterx.deploy.processes.forking import ForkServer
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetError


@pytest.fixture(autouse=True)
def _own_run_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))


def radio(extra: str) -> str:
    return PAIR.replace("model_match = 1 }", f"model_match = 1, {extra} }}")


@pytest.mark.parametrize(
    "text",
    [
        PAIR,
        HARDWARE_PAIR,
        radio('protocol = "ppm", settings = { channels = 4 }'),
        radio('protocol = "dsmp", settings = { channels = 4 }'),
        radio("settings = { channels = 4 }"),
    ],
)
def test_a_good_fleet_passes_every_check(text: str, tmp_path: Path) -> None:
    check_fleet(parse_fleet(text), tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            PAIR + 'type = "plane"',
            r"^vehicles\.h2\.type: unknown type 'plane', allowed are ardupilot_quadrotor, betaflight, ",
        ),
        (PAIR + "model = { mass = 1.0 }", r"^vehicles\.h2\.model\.mass: unknown field, allowed are kind"),
        (PAIR + "model = { lag_s = [0.1] }", r"^vehicles\.h2\.model\.lag_s: expected .*length 4"),
        (PAIR + "model = { lag_s = [-0.1, 0, 0, 0] }", r"^vehicles\.h2\.model: lag_s: must not be below 0"),
        (
            PAIR + "model = { input_gain = [1, 1, 0, 1] }",
            r"^vehicles\.h2\.model: input_gain: must be above 0",
        ),
        (PAIR + 'control = { controller = "x" }', r"^vehicles\.h2\.control: .*'x'; allowed are .*paper"),
        (
            PAIR + 'control = { estimator = "x" }',
            r"^vehicles\.h2\.control: .*'x'; allowed are extended_kalman",
        ),
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
        (radio("settings = { power = 1 }"), r"^vehicles\.h1\.transmitter\.settings\.power: unknown"),
        (
            radio('settings = { channels = "a" }'),
            r"^vehicles\.h1\.transmitter\.settings\.channels: expected `int`, got `str`",
        ),
        (
            radio('protocol = "ppm", low_power = true'),
            r"^vehicles\.h1\.transmitter\.low_power: cannot be asked for with protocol 'ppm'",
        ),
        (
            radio("calibration = { pitch = { index = 2, hi_us = 2100.0, gain_us = 650.0 } }"),
            r"^vehicles\.h1\.transmitter\.calibration: multi: elevator pulse 2100",
        ),
        (
            radio("calibration = { arming = { index = 6 } }"),
            r"^vehicles\.h1\.transmitter\.calibration: multi: .* channel 6, but only channels 0 to 5 are",
        ),
        (
            radio('protocol = "dsmp", settings = { channels = 3 }'),
            r"^vehicles\.h1\.transmitter\.settings: dsmp\.channels: 3 is outside 4\.\.12",
        ),
        (PAIR + "[safety.settings]\nbrake = 1", r"^safety\.settings\.brake: unknown field"),
        (PAIR + "[safety.settings]\nhold_after_s = -1.0", r"^safety\.settings: hold_after_s: -1\.0"),
        (PAIR + "[safety.settings]\nhold_after_s = 5.0", r"^safety\.settings: descend_after_s: "),
        (
            PAIR + "[safety.settings]\nsurveillance = 5",
            r"^safety\.settings\.surveillance: expected `object`, got `int`",
        ),
        (
            PAIR + "[safety.settings.surveillance]\nx = 1",
            r"^safety\.settings\.surveillance\.x: unknown field",
        ),
        (
            PAIR + "[watchdog]\nflight_s = 0.3",
            r"^watchdog\.flight_s: 0\.3 must be shorter than descend_after_s = 0\.2 of h1",
        ),
        (
            HARDWARE_PAIR + '[tracker]\nbrand = "optitrack"\naddress = "lab:1510"\nrate_hz = 120',
            r"period_s: 0\.02 s is no whole .* tracker\.rate_hz = 120 Hz; 0\.0166667 s or 100 Hz would fit",
        ),
        (
            PAIR + "[volume]\nmin_m = [-1500, -1500, 0]\nmax_m = [1500, 1500, 2000]",
            r"^volume\.min_m\[0\]: -1500 m is more than 100 m: in millimetres\?",
        ),
        (
            PAIR + '[tracker]\naddress = "host:801:801"',
            r"^tracker\.address: 'host:801:801', must be HOST:PORT, an",
        ),
        (
            PAIR + '[tracker]\naddress = "fe80::1:801"',
            r"^tracker\.address: 'fe80::1:801', must be .*brackets",
        ),
        (PAIR + '[hosts.main]\naddress = "127.0.0.1:80"', r"^hosts\.main\.address: .* router_port"),
        (PAIR + '[tracker]\naddress = "lab"', r"^tracker\.address: 'lab', must be HOST:PORT"),
        (PAIR + '[tracker]\naddress = "lab:70000"', r"^tracker\.address: 'lab:70000', must be HOST:PORT"),
        (PAIR + '[tracker]\naddress = "lab:²"', r"^tracker\.address: 'lab:²', must be HOST:PORT"),
        (PAIR + '[tracker]\naddress = ":801"', r"^tracker\.address: ':801', must be HOST:PORT"),
        (
            PAIR.replace("[simulator]", '[simulator]\nconditions = "mars"'),
            r"^simulator\.conditions: .*'mars'",
        ),
        (
            PAIR.replace("[simulator]", "[simulator]\ncondition_overrides = { x = 1 }"),
            r"^simulator\.condition_overrides\.x: unknown field, allowed are turbulence_rms, ",
        ),
        (
            PAIR.replace("[simulator]", "[simulator]\ncondition_overrides = { position_noise_m = 'small' }"),
            r"^simulator\.condition_overrides\.position_noise_m: expected `float`, got `str`",
        ),
        (
            PAIR.replace("[simulator]", "[simulator]\ncondition_overrides = { trim_offset = true }"),
            r"^simulator\.condition_overrides\.trim_offset: expected `float`, got `bool`",
        ),
        (
            PAIR.replace("[simulator]", "[simulator]\ncondition_overrides = { actuator_lag = 1 }"),
            r"^simulator\.condition_overrides\.actuator_lag: expected `bool`, got `int`",
        ),
        (
            PAIR.replace("[simulator]", "[simulator]\ncondition_overrides = { turbulence_rms = [1.0, 1.0] }"),
            r"^simulator\.condition_overrides\.turbulence_rms: expected .*length 4",
        ),
        (
            PAIR.replace("[simulator]", "[simulator]\ncondition_overrides = { position_noise_m = -1.0 }"),
            r"^simulator\.condition_overrides: position_noise_m: -1\.0 is not a number between",
        ),
    ],
)
def test_a_wrong_field_is_refused_by_its_path_before_anything_is_started(
    text: str, words: str, tmp_path: Path
) -> None:
    with pytest.raises(FleetError, match=words):
        check_fleet(parse_fleet(text), tmp_path)
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


@pytest.fixture(scope="module")
def forks() -> Iterator[ForkServer]:
    with closing(ForkServer(["rcopterx.deploy.roles.agent", "rcopterx.deploy.roles.simulator"])) as server:
        yield server


def test_a_good_fleet_passes_in_a_process_and_a_wrong_field_is_named(
    tmp_path: Path, forks: ForkServer
) -> None:
    check_in_process(parse_fleet(PAIR), tmp_path, forks)
    wrong = parse_fleet(PAIR + 'control = { controller = "x" }')
    with pytest.raises(FleetError, match=r"^vehicles\.h2\.control: no controller is called 'x'"):
        check_in_process(wrong, tmp_path, forks)
    # Nothing stays behind.
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_a_check_that_fails_for_another_reason_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, forks: ForkServer
) -> None:
    monkeypatch.setattr(fleet_check, "MODULE", "no_such_module")
    with pytest.raises(OSError, match=r"(?s)the fleet cannot be checked, exit code 1: .*no_such_module"):
        check_in_process(parse_fleet(PAIR), tmp_path, forks)


def test_a_launcher_imports_none_of_the_libraries_of_agents() -> None:
    script = (
        "import sys, rcopterx.deploy.hosts.launcher; print(*{'numba', 'scipy', 'osqp'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
