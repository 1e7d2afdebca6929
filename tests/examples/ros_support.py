"""The bridge to ROS 2 and a fleet for it."""

import sys
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from support.bus import FLEET

from rcopterx.bus.messages import SetPoint
from rcopterx.ground_station.scripting.vehicle import RefusedError

EXAMPLE = Path(__file__).parents[2] / "examples" / "ros2_bridge"
sys.path.insert(0, str(EXAMPLE))
import ros2_bridge  # noqa: E402
import ros_commands  # noqa: E402
import ros_messages  # noqa: E402

sys.path.remove(str(EXAMPLE))

__all__ = ["SET_POINT", "FleetDouble", "ros2_bridge", "ros_commands", "ros_messages"]

SET_POINT = SetPoint(position_m=(0.5, -0.5, 1.0), yaw_rad=0.25)


class FleetDouble:
    """Records the calls of a scripting interface; `blocked` holds a take-off up."""

    def __init__(self) -> None:
        self.file = SimpleNamespace(name=FLEET, vehicles={"h1": None, "h2": None})
        self.calls: list[Any] = []
        self.blocked = threading.Event()
        self.blocked.set()

    def __getitem__(self, name: str) -> Any:
        state = SimpleNamespace(agent=SimpleNamespace(set_point=SET_POINT))
        return SimpleNamespace(state=state, go_to=lambda *place: self.calls.append(("go_to", name, *place)))

    def take_off(self, names: Any, **height: float) -> None:
        self.blocked.wait(20.0)
        self.calls.append(("take_off", names, *height.values()))

    def land(self, names: Any) -> None:
        self.calls.append(("land", names))
        raise RefusedError("h1: stands on the floor")

    def kill(self, names: Any) -> None:
        self.calls.append(("kill", tuple(names)))
