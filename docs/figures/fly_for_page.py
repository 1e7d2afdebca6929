"""Fly what the moving picture of the web page shows; `record_page.py` says how it is recorded.

Three helicopters hold formation; the leader is led around; `h3` follows another leader; the agent of `h2` is
killed and nothing happens. Writes when each begins to the file that is named.
"""

import json
import math
import os
import signal
import sys
from pathlib import Path

from rcopterx import Fleet, launched

ROUND_S = 8.0
STEP_S = 0.4
"""Time between two set points, as of a dragged handle."""
RADIUS_M = 0.3
SPEED = 0.4
"""Slow motion, so that a busy computer flies it without missed periods."""


def lead_around(fleet: Fleet, begin_rad: float, turn_rad: float, seconds: float) -> None:
    """Move the leader's set point along a circle around the middle of the room."""
    steps = round(seconds / STEP_S)
    for step in range(1, steps + 1):
        angle = begin_rad + turn_rad * step / steps
        fleet["h1"].go_to(
            (RADIUS_M * math.cos(angle), RADIUS_M * math.sin(angle), 1.0 + 0.2 * math.sin(angle))
        )
        fleet.wait(STEP_S)


def main() -> None:
    """Fly, and write when what begins: pairs of seconds since the begin of the log and a caption."""
    captions: list[tuple[float, str]] = []
    with launched("trio", speed=SPEED) as fleet:
        clock = fleet.session.clock
        joined_s = clock()

        def note(text: str) -> None:
            captions.append((clock() - joined_s, text))

        fleet.take_off()
        fleet["h1"].go_to((RADIUS_M, 0.0, 1.0))
        fleet.wait_for_arrival(["h1"])
        fleet.wait_for_formation()
        note("h1 is led around, h2 and h3 anticipate: they know its plan")
        lead_around(fleet, 0.0, math.pi, 0.5 * ROUND_S)
        note("h3 follows h2 from now on")
        fleet["h3"].follow("h2", (-0.4, -0.5, 0.0))
        fleet.wait(3.0)
        lead_around(fleet, math.pi, 0.5 * math.pi, 0.25 * ROUND_S)
        note("kill -9 of the agent of h2")
        agent = fleet.state_of("h2").agent
        assert agent is not None
        os.kill(agent.diagnostics.process, signal.SIGKILL)
        lead_around(fleet, 1.5 * math.pi, 1.0 * math.pi, 0.75 * ROUND_S)
        note("")
    Path(sys.argv[1]).write_text(json.dumps(captions), encoding="utf-8")


if __name__ == "__main__":
    main()
