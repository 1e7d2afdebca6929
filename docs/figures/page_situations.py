"""Show the web page in ten situations, wide and as on a phone, without a fleet: pictures to be judged by eye.

Needs Chromium and `pip install 'rcopterx[browser]'`:

    python docs/figures/page_situations.py build/page            # all
    python docs/figures/page_situations.py build/page flying     # those whose name begins so
"""

import math
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from msgspec import structs
from playwright.sync_api import Page, sync_playwright

from rcopterx.bus.log_messages import RecorderStatus
from rcopterx.bus.messages import (
    AgentStatus,
    Battery,
    Diagnostics,
    LeaderLink,
    Plan,
    SetPoint,
    TransmitterStatus,
)
from rcopterx.bus.trajectory_array import TrajectoryArray
from rcopterx.control.references.columns import COLUMNS
from rcopterx.fleet.reading import parse_fleet
from rcopterx.ground_station.page.page import FleetPage, PageFrame
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.state import VehicleState

CHROMIUM = "/usr/bin/chromium"
SOFTWARE_RENDERING = ("--no-sandbox", "--disable-gpu")
WIDE, PHONE = (1280, 760), (400, 860)
PERIOD_S, WARM_UP_S, STAGES, RADIUS_M = 0.05, 40.0, 50, 0.5

States = dict[str, VehicleState]


def flying(name: str, number: int, time_s: float, leader: str | None = None) -> VehicleState:
    """A vehicle on a circle, behind the leader by an angle for each number."""
    angle = 0.5 * time_s - 0.9 * number

    def place(at: float) -> tuple[float, float, float]:
        return (
            RADIUS_M * math.cos(at),
            RADIUS_M * math.sin(at),
            1.0 + 0.2 * math.sin(2.0 * at) - 0.05 * number,
        )

    values = np.zeros((STAGES, COLUMNS))
    values[:, :3] = [place(angle + 0.5 * 0.02 * stage) for stage in range(STAGES)]
    links = () if leader is None else (LeaderLink(leader=leader, offset_m=(-0.4, -0.3, 0.0)),)
    x, y, z = place(angle)
    error_m = 0.012 + 0.02 * abs(math.sin(0.7 * time_s + number))
    plan = Plan(
        epoch=1, frame=1, source=name, ancestors=(), period_s=0.02, start_s=0.0,
        trajectory=TrajectoryArray.of(values), reference=(x, y + error_m, z, 0.0), following=links,
    )  # fmt: skip
    agent = AgentStatus(
        phase="flying", epoch=1, frame=1, set_point=SetPoint(position_m=(x, y, z), yaw_rad=angle),
        following=links, assigned=links, position_m=(x, y, z), yaw_rad=angle + math.pi / 2, error_m=error_m,
        pose_age_s=0.01,
        diagnostics=Diagnostics(
            controller="cascade", estimator="extended_kalman", horizon=50, hover_thrust=0.56,
            solve_ms_p50=1.2, solve_ms_p99=2.1, wind_m_s2=(0.1, 0.2),
            position_deviation_m=(0.0005, 0.0005, 0.001),
        ),
    )  # fmt: skip
    transmitter = TransmitterStatus(
        state="armed", reason="armed", link="open", module="ready", ready=True, command_age_s=0.01,
        battery=Battery(voltage_v=3.9 - 0.05 * number, share=0.7),
    )  # fmt: skip
    return VehicleState(name, agent, transmitter, 0.1, 0.1, 0.01, 0.01, plan)


def standing(state: VehicleState, number: int) -> VehicleState:
    """The same vehicle on the floor."""
    assert state.agent is not None
    assert state.transmitter is not None
    agent = structs.replace(
        state.agent, phase="ground", position_m=(0.5 * number - 0.5, -0.4, 0.05), error_m=None, following=()
    )
    disarmed = structs.replace(state.transmitter, state="disarmed", reason="on the floor")
    return replace(state, agent=agent, transmitter=disarmed, plan=None)


def overridden(state: VehicleState, name: str, reason: str) -> VehicleState:
    """The same vehicle flown by its transmitter gateway."""
    assert state.agent is not None
    assert state.transmitter is not None
    transmitter = structs.replace(state.transmitter, state=name, reason=f"{name}: {reason}")
    phase = "ground" if name in ("killed", "cut") else "emergency"
    return replace(state, agent=structs.replace(state.agent, phase=phase), transmitter=transmitter)


def remarked(state: VehicleState, remark: str) -> VehicleState:
    """The same vehicle with a remark."""
    assert state.agent is not None
    diagnostics = structs.replace(state.agent.diagnostics, remarks=(remark,))
    return replace(state, agent=structs.replace(state.agent, diagnostics=diagnostics))


SLOW = "ExtendedKalmanEstimator: a call took longer than 6 ms"


@dataclass(frozen=True)
class Situation:
    """What is shown: a change of the states of flying vehicles, and what a person does with the page."""

    change: Callable[[States], States] = lambda states: states
    act: Callable[[Page], object] = lambda _: None
    vehicles: int = 3
    problems: tuple[str, ...] = ()
    scheme: str = "light"


def _floor(states: States) -> States:
    return {name: standing(state, number) for number, (name, state) in enumerate(states.items())}


def _all(change: Callable[[VehicleState], VehicleState]) -> Callable[[States], States]:
    return lambda states: {name: change(state) for name, state in states.items()}


def _tuned(page: Page) -> None:
    page.locator("#rows tr[data-vehicle=h2]").click()
    for part in ("#tune", "#details", "#formation"):
        page.locator(f"{part} > summary").click()


def _paused(page: Page) -> None:
    page.get_by_role("button", name="Pause").click()
    page.locator("#time [name=scrub]").fill("150")


SITUATIONS: Mapping[str, Situation] = {
    "ready": Situation(_floor),
    "not_ready": Situation(
        _floor,
        problems=("h2: the motion capture does not see it for 3.2 s", "h3: transmitter not ready: no module"),
    ),
    "flying": Situation(),
    "flying_dark": Situation(scheme="dark"),
    "selected": Situation(act=_tuned),
    "twelve": Situation(vehicles=12),
    "brought_down": Situation(lambda all_: all_ | {"h2": overridden(all_["h2"], "land", "commands silent")}),
    "slow_computer": Situation(_all(lambda state: remarked(state, SLOW))),
    "killed": Situation(_all(lambda state: overridden(state, "killed", "ground station"))),
    "down": Situation(_all(lambda state: replace(state, agent_age_s=9.0, transmitter_age_s=9.0))),
    "past": Situation(act=_paused),
}


class ShownFleet:
    """What `FleetPage` reads of a fleet."""

    def __init__(self, situation: Situation) -> None:
        tables = "\n".join(
            f'[vehicles.h{number}]\nsubject = "h{number}"\ntransmitter = {{ port = "radio-{number}" }}'
            for number in range(1, situation.vehicles + 1)
        )
        self.file = parse_fleet(f'name = "trio"\n{tables}\n')
        self.now_s = 100.0
        self.session = self.source = SimpleNamespace(
            subscribe_all=lambda _: SimpleNamespace(inboxes={}), clock=lambda: self.now_s
        )
        self._situation = situation
        self.changed = False

    def state_of(self, name: str) -> VehicleState:
        """State of a vehicle."""
        return self._states()[name]

    def _states(self) -> States:
        names = list(self.file.vehicles)
        states = {
            name: flying(name, number, self.now_s, names[(number - 1) // 2] if number else None)
            for number, name in enumerate(names)
        }
        return self._situation.change(states) if self.changed else states

    def watch_latency(self) -> None:
        """Nothing to watch."""

    def watch_motion(self) -> None:
        """Nothing to watch."""

    def problems(self) -> list[str]:
        """Problems of the situation."""
        return list(self._situation.problems)

    def notes(self) -> list[str]:
        """No notes."""
        return []

    def recorders(self) -> dict[str, RecorderStatus]:
        """A log that records."""
        return {"main": RecorderStatus(state="recording")}


@contextmanager
def served(situation: Situation) -> Iterator[str]:
    """Serve the page of a situation after a flight of some seconds; yields its address."""
    fleet = ShownFleet(situation)
    frame = PageFrame(8100, fleet.file.name, "pictures")
    page = FleetPage(cast(Fleet, fleet), frame)
    end = threading.Event()
    begin_s = fleet.now_s
    while fleet.now_s < begin_s + WARM_UP_S:
        fleet.now_s += PERIOD_S
        page.update(fleet.now_s)
    fleet.changed = True

    def keep() -> None:
        while not end.wait(PERIOD_S):
            fleet.now_s += PERIOD_S
            page.update(fleet.now_s)

    loop = threading.Thread(target=keep)
    loop.start()
    try:
        yield frame.server.address
    finally:
        end.set()
        loop.join()
        frame.server.stop()


def main() -> None:
    """Write `NAME-wide.png` and `NAME-phone.png` for each situation."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    wanted = sys.argv[2] if len(sys.argv) > 2 else ""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(SOFTWARE_RENDERING))
        for name, situation in SITUATIONS.items():
            if not name.startswith(wanted):
                continue
            for kind, (width, height) in (("wide", WIDE), ("phone", PHONE)):
                with served(situation) as address:
                    page = browser.new_page(
                        viewport={"width": width, "height": height}, color_scheme=cast(Any, situation.scheme)
                    )
                    errors: list[str] = []
                    page.on("pageerror", lambda error, found=errors: found.append(str(error)))
                    page.on("console", lambda line, found=errors: found.append(line.text))
                    page.goto(address)
                    page.locator("#rows tbody tr").first.wait_for(timeout=20_000)
                    page.wait_for_timeout(1500)
                    situation.act(page)
                    page.wait_for_timeout(1500)
                    page.screenshot(path=folder / f"{name}-{kind}.png")
                    figures = page.evaluate("JSON.stringify(window.rcopterx)")
                    print(name, kind, figures, *errors)
                    page.close()
        browser.close()


if __name__ == "__main__":
    main()
