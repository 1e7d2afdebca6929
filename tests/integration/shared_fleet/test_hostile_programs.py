"""Whatever a program outside does with the vehicle that it flies, no vehicle falls and the others fly on."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from integration_support import NAMES, Flying, Truth, fallbacks, transmitter_state
from support import hostile_program

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

EXAMPLE = Path(__file__).parents[3] / "examples" / "external_control"
FLOWN_S = 5.0
SOFT_M_S = 1.0
STEADY_M = 0.25
ALWAYS_FLOWN = ("not_finite", "dives", "attacks", "flooding")


@pytest.mark.parametrize(
    "kind",
    [
        pytest.param(kind, marks=() if kind in ALWAYS_FLOWN else pytest.mark.campaign)
        for kind in hostile_program.DEEDS
    ],
)
def test_no_vehicle_falls_whatever_a_program_outside_does(kind: str, flying: Flying, truth: Truth) -> None:
    fleet, host = flying.fleet, flying.fleet.file.hosts["main"]
    arguments = (
        "lab", "h2", f"tcp/{host.address}:{host.router_port}", fleet.file.bus.namespace or ""
    )  # fmt: skip
    places = {name: np.array(state.position_m) for name in NAMES if (state := truth(name)) is not None}
    moved = dict.fromkeys(NAMES, 0.0)
    states: dict[str, set[str]] = {name: set() for name in NAMES}

    def watch() -> bool:
        for name in NAMES:
            state = truth(name)
            assert state is not None
            assert not state.on_floor or state.touchdown_speed_m_s < SOFT_M_S
            away_m = float(np.linalg.norm(np.array(state.position_m) - places[name]))
            moved[name] = max(moved[name], away_m)
            states[name].add(transmitter_state(flying, name))
        return False

    command = [sys.executable, hostile_program.__file__, kind, str(EXAMPLE), *arguments]
    with subprocess.Popen(command) as program:
        try:
            fleet.wait_until(lambda: client_of(flying) == "hostile", 30, "the program does not fly h2")
            until_s = fleet.session.clock() + FLOWN_S
            fleet.wait_until(lambda: watch() or fleet.session.clock() > until_s, 2 * FLOWN_S, "no end")
        finally:
            program.kill()
    events = {each: fallbacks(flying, "h2", each) for each in ("external_silent", "external_unsafe")}
    print(f"{kind}: moved {moved}, states {states}, {events}")
    for name in ("h1", "h3"):
        assert moved[name] < STEADY_M
        # A flood from the same computer may delay poses by the 0.1 s after which the arbiter holds the place.
        assert states[name] <= {"armed", "hold"}
    fleet.wait_until(lambda: client_of(flying) == "", 10, "h2 is not flown by its own controller again")


def client_of(flying: Flying) -> str | None:
    """Program outside that flies h2, empty if none does."""
    status = flying.fleet.state_of("h2").agent
    return None if status is None else status.diagnostics.client
