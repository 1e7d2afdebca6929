"""Emulated Crazyflies with real processes: they fly, survive their gateway, and stop when they are killed."""

from collections.abc import Callable

import pytest
from integration_support import (
    NAMES,
    Flying,
    Truth,
    fleet_text,
    flown_by,
    fly_to,
    landed_gently,
    of_types,
    transmitter_state,
)
from radio_support import RadioLog, kill_gateway_in_flight, module
from support.radio_addresses import radio_paths

from rcopterx.ground_station.page.alarms import causes_of
from rcopterx.ground_station.scripting.vehicle import RefusedError
from rcopterx.simulator.faults import BreakRadio, Recover
from rcopterx_studies.faults.scenario import inject_faults

pytestmark = [pytest.mark.lockstep, pytest.mark.timeout(180)]

Fly = Callable[..., None]
UNTHRUSTED_US = 1110.0
WEAK = """
[vehicles.h3]
type = "crazyflie"
subject = "heli3"
transmitter = {{ port = "{}" }}
battery = {{ warn_v = 3.8, land_v = 3.76 }}
"""
"""The voltage of a full emulated battery falls to 3.84 V in a hover, and by 0.1 V in the next 30 s."""
STOPPED_S = 1.0
"""Very loose, for a busy machine; `test_kill_times` measures."""


def test_crazyflies_fly_a_formation_survive_their_gateway_and_stop_when_they_are_killed(fly: Fly) -> None:
    fly(fly_and_kill, of_types(dict.fromkeys(NAMES, "crazyflie"), radio_paths(3)))


def test_radios_without_lights_refuse_colours(fly: Fly) -> None:
    fly(refuse_colours, fleet_text())


def refuse_colours(flying: Flying) -> None:
    with pytest.raises(RefusedError, match="h1: multi: no lights"):
        flying.fleet["h1"].light((255, 255, 255))


def fly_and_kill(flying: Flying) -> None:
    fleet, truth, log = flying.fleet, Truth(flying), RadioLog(flying)
    fleet.wait_until(lambda: " V, link 100 %" in module(flying, "h1"), 30, "no battery")
    fleet.take_off(NAMES, height_m=0.7, timeout_s=40)
    fleet.wait_for_formation()
    truth.start_watch()
    fleet["h2"].light((255, 0, 64))
    fleet.wait_until(lambda: getattr(truth("h2"), "light", None) == (255, 0, 64), 5, "its lights are dark")
    assert getattr(truth("h1"), "light", None) is None
    fly_to(flying, truth, (0.3, 0.2, 0.9))

    kill_gateway_in_flight(flying)
    fly_to(flying, truth, (-0.2, 0.1, 0.8))
    truth.assert_none_touched_down()

    log.frames("h3")
    killed_s = flying.now_s()
    fleet["h3"].kill()
    fleet.wait_until(lambda: "locked" in module(flying, "h3"), 30, "not locked", ["h3"])

    def unthrusted() -> list[float]:
        return [at_s for at_s, us in log.frames("h3") if at_s > killed_s and us < UNTHRUSTED_US]

    fleet.wait_until(lambda: bool(unthrusted()), 30, "the motors turn", ["h3"])
    assert unthrusted()[0] - killed_s < STOPPED_S
    assert all(flown_by(flying, name) is not None for name in ("h1", "h2"))

    # A kill that is not reset locks the vehicle anew.
    fleet["h3"].reset()
    fleet.wait_until(lambda: transmitter_state(flying, "h3") == "disarmed", 30, "still killed")
    inject_faults(fleet.session, BreakRadio("h3", "off"))
    fleet.wait_until(lambda: "silent" in module(flying, "h3"), 30, "battery not out")
    inject_faults(fleet.session, Recover())
    fleet.wait_until(lambda: module(flying, "h3").startswith("ready"), 30, "does not start")
    fleet.land(["h1", "h2"])
    fleet.wait_until(lambda: all(landed_gently(truth, name) for name in ("h1", "h2")), 30, "not landed")


def test_a_crazyflie_lands_by_itself_before_its_battery_is_empty_and_takes_off_no_more(fly: Fly) -> None:
    text = fleet_text(vehicles=WEAK.format(radio_paths(1)[0]))
    fly(empty_a_battery, text)


def empty_a_battery(flying: Flying) -> None:
    fleet, truth = flying.fleet, Truth(flying)
    fleet.take_off(["h3"], height_m=0.7, timeout_s=40)

    def warned() -> bool:
        return any(cause.text.startswith("low voltage: ") for cause in causes_of(fleet.state_of("h3")))

    fleet.wait_until(warned, 30, "no warning")
    assert fleet.state_of("h3").airborne
    fleet.wait_until(lambda: transmitter_state(flying, "h3") == "land", 30, "does not land")
    assert "battery empty: below 3.76 V for 5 s" in fleet.state_of("h3").reason
    fleet.wait_until(lambda: transmitter_state(flying, "h3") in ("cut", "disarmed"), 30, "not landed")
    vehicle = truth("h3")
    assert vehicle is not None
    assert vehicle.on_floor
    assert vehicle.touchdown_speed_m_s < 1.0
    assert "battery empty" in "".join(fleet.problems(["h3"]))
    with pytest.raises(RefusedError):
        fleet["h3"].take_off(0.7)
