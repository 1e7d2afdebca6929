"""A show with lights and headings, flown by emulated Crazyflies: suspended, resumed, called home."""

from pathlib import Path

import numpy as np
import pytest
from examples_support import fleet_file
from support.example_programs import light_programs, light_show

from rcopterx.bus import channels
from rcopterx.fleet.reading import at_speed, load_fleet
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx_studies.importing.skybrush import Drone, read_show
from rcopterx_studies.search.one_process import in_one_process

pytestmark = [pytest.mark.integration, pytest.mark.lockstep, pytest.mark.timeout(300)]

SHOW = Path(__file__).parents[1] / "fixtures" / "import_skybrush" / "lights_and_headings.skyc"
Colour = tuple[int, int, int]
SUSPEND_S, RESUME_S, HOME_S = 5.0, 11.0, 15.0
EASED_S = 2.0  # until all vehicles know, have come to rest or fly on
LATE_S = 0.6  # of the shown colours: the run-in, then statuses and requests
DARK = {None, (0, 0, 0)}


class Watched:
    """A show that is suspended, resumed and called home, and what was shown meanwhile."""

    def __init__(self, fleet: Fleet) -> None:
        self.fleet = fleet
        self.laboratory = fleet.session.subscribe(channels.LABORATORY, channels.SIMULATOR_UNIT)
        self.begun_s: float | None = None
        self.requests = [(SUSPEND_S, fleet.suspend), (RESUME_S, fleet.resume), (HOME_S, fleet.home)]
        self.shown: list[tuple[float, dict[str, Colour], float]] = []  # time, colours, heading of h2

    def wait(self, seconds: float) -> None:
        """In place of `fleet.wait`."""
        Fleet.wait(self.fleet, seconds)
        now_s, received = self.fleet.session.clock(), self.laboratory.latest()
        if self.fleet["h2"].state.agent is None or received is None:
            return
        if self.begun_s is None and light_show.path_left_s(self.fleet, "h1") > 0.0:
            self.begun_s = now_s
        if self.begun_s is None:
            return
        passed_s = now_s - self.begun_s
        colours = {name: vehicle.light for name, vehicle in received.message.vehicles.items()}
        self.shown.append((passed_s, colours, self.fleet["h2"].state.agent.yaw_rad))
        if self.requests and passed_s > self.requests[0][0]:
            self.requests.pop(0)[1]()

    def between(self, begin_s: float, end_s: float) -> list[tuple[float, dict[str, Colour], float]]:
        return [each for each in self.shown if begin_s <= each[0] < end_s]


def test_lights_and_headings_pause_go_on_and_end_with_the_trajectories(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    drones = read_show(SHOW)
    watched: list[Watched] = []

    def script(fleet: Fleet) -> None:
        fleet.wait_ready(timeout_s=60.0)
        watched.append(Watched(fleet))
        monkeypatch.setattr(fleet, "wait", watched[0].wait, raising=False)
        light_show.fly(fleet, drones)
        assert not any(vehicle.state.airborne for vehicle in fleet)

    file = at_speed(load_fleet(fleet_file(tmp_path, "crazyflies")), None, lockstep=True)
    with in_one_process(file, lambda _: None) as process:
        process.run(script)
    assert not process.turns.failures
    check(watched[0], drones[0])
    printed = capsys.readouterr().out
    assert "without lights" not in printed
    assert printed.count("leaves the show") == 3


def check(watched: Watched, drone: Drone) -> None:
    """Check the colours of h1, the heading of h2, and that h3 stays dark."""
    begun = watched.between(1.0 + LATE_S, SUSPEND_S)
    assert len(begun) > 20
    for at_s, colours, _ in begun:
        show_s = np.linspace(drone.times_s[0] + at_s - 1.0 - LATE_S, drone.times_s[0] + at_s - 1.0, 7)
        allowed = np.array([light_show.colour_of(light_programs.played(drone), each_s) for each_s in show_s])
        assert (allowed.min(axis=0) - 5 <= colours["h1"]).all()
        assert (allowed.max(axis=0) + 5 >= colours["h1"]).all()
    paused = watched.between(SUSPEND_S + EASED_S, RESUME_S)
    assert len({colours["h1"] for _, colours, _ in paused}) == 1
    assert np.ptp([yaw_rad for *_, yaw_rad in paused]) < np.radians(5.0)
    assert len({colours["h2"] for _, colours, _ in watched.between(SUSPEND_S + EASED_S, RESUME_S)}) == 1
    resumed = watched.between(RESUME_S + EASED_S, HOME_S)
    assert len({colours["h1"] for _, colours, _ in resumed}) > 3
    assert np.ptp([yaw_rad for *_, yaw_rad in resumed]) > np.radians(30.0)
    assert {colours["h3"] for _, colours, _ in watched.shown} <= DARK
    assert watched.shown[-1][1]["h1"] in DARK
    assert watched.shown[-1][1]["h2"] in DARK
