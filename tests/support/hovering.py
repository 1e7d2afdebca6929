"""A pilot that hovers in the simulated laboratory, for tests of what takes over in flight."""

from typing import Any

import numpy as np

from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.agents.flight.guidance import Guidance
from rcopterx.agents.pilot import ControlOutput, Pilot
from rcopterx.agents.tuning.changes import Tuning
from rcopterx.agents.tuning.configuration import Configuration
from rcopterx.bus.requests import Tune
from rcopterx.control.interfaces import Measurement
from rcopterx.simulator.laboratory import Laboratory
from rcopterx.simulator.plant import BodyPose
from support.conditions import LABORATORY
from support.vehicle_types import COAXIAL_LAG
from support.waiting import wait_for

PERIOD_S = 0.02


class HoveringFlight:
    """A pilot that hovers in a simulated laboratory with gusts, mismatch, lag and noise."""

    def __init__(self, controller: str, estimator: str = "extended_kalman") -> None:
        configuration = Configuration(controller, estimator, {"horizon": 20})
        self.pilot = Pilot(
            COAXIAL_LAG,
            configuration.controller_for(COAXIAL_LAG, PERIOD_S),
            configuration.estimator_for(COAXIAL_LAG, PERIOD_S),
            Guidance(),
        )
        self.tuning = Tuning(configuration, self.pilot, PERIOD_S)
        self.laboratory = Laboratory({"h1": COAXIAL_LAG}, {"h1": BodyPose((0.0, 0.0, 1.0))}, LABORATORY, 4)
        self.frame = 0
        self.flown: list[ControlOutput] = []
        self._see()
        self.pilot.note_applied("armed", 0, COAXIAL_LAG.hover_input)

    def _see(self) -> None:
        pose = self.laboratory.measured_pose("h1")
        measurement = Measurement(np.array(pose.position_m), pose.yaw_rad)
        self.pilot.observe(StampedMeasurement(1, self.frame, PERIOD_S, measurement))

    def fly(self, periods: int) -> None:
        for _ in range(periods):
            self.laboratory.advance(PERIOD_S)
            self.frame += 1
            self._see()
            self.flown.append(self.pilot.control({}))
            self.laboratory.plants["h1"].set_input(self.flown[-1].input)

    def change(self, **wanted: Any) -> str | ValueError:
        """Prepare a change beside the flight, and let it take over."""
        self.tuning.begin(self.tuning.configuration.changed(Tune(**wanted)))
        outcomes: list[str | ValueError] = []

        def ready() -> bool:
            outcome = self.tuning.finish()
            if outcome is not None:
                outcomes.append(outcome)
            return bool(outcomes)

        wait_for(ready, "the change is prepared", 20.0)
        return outcomes[0]

    def bump(self) -> float:
        """Step of the inputs in the last period."""
        return float(np.abs(self.flown[-1].input - self.flown[-2].input).max())

    def error_m(self) -> float:
        return float(np.linalg.norm(self.laboratory.plants["h1"].motion[:3] - np.array([0.0, 0.0, 1.0])))
