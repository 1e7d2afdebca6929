"""Radios of every kind fly, and whatever happens to a transmitter leaves no vehicle uncontrolled."""

import math
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from integration_support import (
    NAMES,
    Flying,
    Truth,
    at,
    counter,
    fleet_text,
    flown_by,
    free_port,
    land_gently,
    landed_gently,
    transmitter_state,
)

from rcopterx.fleet.radios import calibration_of
from rcopterx.fleet.reading import load_fleet
from rcopterx.simulator.faults import BreakRadio, Recover
from rcopterx_studies.faults.scenario import inject_faults

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]

RADIOS = {"h1": "dsm2_serial", "h2": "dsmp", "h3": "ppm"}


def trio_text(radios: dict[str, str] | None = None, **options: str) -> str:
    """Fleet of three vehicles without leaders, with the radio of each."""
    kinds = dict.fromkeys(NAMES, "multi") | (radios or {})
    vehicles = "\n".join(
        f"""
[vehicles.{name}]
subject = "{name}"
transmitter = {{ port = "radio-{name}", model_match = {number}, protocol = "{kinds[name]}" }}
"""
        for number, name in enumerate(NAMES, 1)
    )
    # Without its radio a vehicle flies on by its last sticks until the receiver cuts; this one stays upright,
    # and nothing has moved its sticks from those of hover.
    start = 'conditions = "ideal"\n'
    start += "[simulator.start]\nh1 = [0.6, 0, 0, 0]\nh2 = [-0.4, 0.6, 0, 0]\nh3 = [-0.4, -0.6, 0, 0]"
    port = free_port()
    return fleet_text(
        free_port(), {"main": ("127.0.0.1", port)}, vehicles=vehicles, simulator=start, **options
    )


@pytest.mark.campaign
@pytest.mark.lockstep
def test_vehicles_with_different_radios_fly_together(launch: Launch) -> None:
    flying = launch(trio_text(RADIOS))
    assert {v.transmitter.protocol for v in load_fleet(flying.path).vehicles.values()} == set(RADIOS.values())
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.7, timeout_s=40)
    truth.start_watch()
    places = {"h1": (0.5, 0.1, 0.9), "h2": (-0.5, 0.5, 0.9), "h3": (-0.3, -0.5, 0.9)}
    for name, place in places.items():
        flying.fleet[name].go_to(place)
    flying.fleet.wait_until(
        lambda: all(at(truth, name, place) for name, place in places.items()), 30, "not all have arrived"
    )
    truth.assert_none_touched_down()
    land_gently(flying, truth)


SAFE_FALL_M = 0.11
"""A vehicle without radio falls when its receiver gives up; from here it lands at less than 1.7 m/s."""
STILL_M_S = 0.02
STILL_S = 1.0
"""Until then it flies on by its last sticks, and would climb if it moved."""


class Still:
    """Whether a vehicle has hung still in the air for a while."""

    def __init__(self, flying: Flying, truth: Truth, name: str) -> None:
        self._truth, self._name, self._now_s = truth, name, flying.now_s
        self._since_s = self._now_s()

    def __call__(self) -> bool:
        vehicle = self._truth(self._name)
        if vehicle is None or vehicle.on_floor or math.hypot(*vehicle.velocity_m_s) > STILL_M_S:
            self._since_s = self._now_s()
        return self._now_s() > self._since_s + STILL_S


@pytest.mark.lockstep
@pytest.mark.parametrize(
    ("condition", "reported"),
    [
        ("unplugged", "no such device"),
        pytest.param("off", "module gone", marks=pytest.mark.campaign),
        pytest.param("refusing", "protocol", marks=pytest.mark.campaign),
    ],
)
def test_failed_radio_is_reported_grounds_its_vehicle_and_no_other(
    fly: Callable[..., None], condition: str, reported: str
) -> None:
    fly(partial(lose_a_radio, condition=condition, reported=reported), trio_text())


def lose_a_radio(flying: Flying, condition: str, reported: str) -> None:
    truth = Truth(flying)
    flying.fleet.take_off(["h1", "h3"], height_m=0.8, timeout_s=40)
    flying.fleet.take_off(["h2"], height_m=SAFE_FALL_M, timeout_s=40)
    truth.start_watch()
    flying.fleet.wait_until(Still(flying, truth, "h2"), 30, "h2 does not hang still")
    inject_faults(flying.fleet.session, BreakRadio("h2", condition))

    def told() -> bool:
        status = flying.fleet.state_of("h2").transmitter
        return status is not None and not status.ready and reported in status.module

    flying.fleet.wait_until(told, 30, f"{reported!r} is not reported")
    flying.fleet.wait_until(lambda: landed_gently(truth, "h2"), 30, "h2 did not come down gently")
    flying.fleet.wait_until(
        lambda: transmitter_state(flying, "h2") in ("disarmed", "cut"), 30, "h2 is not disarmed"
    )
    for name in ("h1", "h3"):
        vehicle = truth(name)
        assert vehicle is not None
        assert not vehicle.on_floor
        assert counter(flying, name, "entered DESCEND") == 0
    flying.fleet.wait_until(
        lambda: all(flown_by(flying, name) is not None for name in ("h1", "h3")), 30, "others do not fly on"
    )
    inject_faults(flying.fleet.session, Recover())
    flying.fleet.wait_until(
        lambda: (status := flying.fleet.state_of("h2").transmitter) is not None and status.ready,
        30,
        "the radio is not found again",
    )
    flying.fleet.wait_until(lambda: flying.fleet.state_of("h2").phase == "ground", 30, "agent unaware")
    flying.fleet.take_off(["h2"], height_m=0.5, timeout_s=40)


@pytest.mark.campaign
def test_hover_trim_is_measured_in_flight_and_written_to_the_file(launch: Launch, tmp_path: Path) -> None:
    flying = launch(trio_text())
    copy = tmp_path / "copy.toml"
    shutil.copy(flying.path, copy)
    words = [sys.executable, "-m", "rcopterx", "calibrate", "h2", "--step", "trim", "--seconds", "3"]
    refused = subprocess.run([*words, "--fleet", str(copy)], capture_output=True, text=True, check=False)
    assert refused.returncode == 1
    assert "hover first" in refused.stderr
    flying.fleet.take_off(["h2"], height_m=0.8, timeout_s=40)
    flying.fleet.wait_for_arrival(["h2"])
    in_flight = subprocess.run(
        [*words[:5], "--fleet", str(copy)], capture_output=True, text=True, check=False
    )
    assert in_flight.returncode == 1
    assert "land the fleet" in in_flight.stderr
    done = subprocess.run([*words, "--fleet", str(copy)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    calibration = calibration_of(load_fleet(copy), "h2")
    trimmed = any(channel.trim_us for channel in (calibration.pitch, calibration.roll, calibration.yaw))
    assert trimmed != ("all below" in done.stdout)
    assert transmitter_state(flying, "h2") == "armed"
