"""A simulated flight for estimators: a vehicle steered by its true state, watched by an estimator."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from support.conditions import LABORATORY
from support.vehicle_types import COAXIAL_LAG

from rcopterx.control.interfaces import Measurement
from rcopterx.control.plugins import ESTIMATORS
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.laboratory import Laboratory
from rcopterx.simulator.plant import BodyPose
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array, heading_matrix

PERIOD_S = 0.02


class Flight:
    """One vehicle that flies to `set_point` (x, y, z, yaw) while an estimator follows it."""

    def __init__(
        self,
        estimator: str = "extended_kalman",
        *,
        model: Model = COAXIAL_LAG,
        conditions: Conditions = LABORATORY,
        seed: int = 0,
        start: BodyPose | None = None,
        frames_per_period: int = 1,
        settings: Mapping[str, object] | None = None,
    ) -> None:
        self.model = model
        self.set_point = np.array([0.0, 0.0, 1.0, 0.0])
        self.frame_s = PERIOD_S / frames_per_period
        self._frames = frames_per_period
        self.laboratory = Laboratory(
            {"h1": model}, {"h1": start or BodyPose((0.0, 0.0, 1.0))}, conditions, seed
        )
        self.estimator = ESTIMATORS.build(estimator, model, self.frame_s, settings or {})
        self.estimator.reset(self.measurement())
        self.motors_on = self.laboratory.plants["h1"].motors_running
        self._under_way = model.hover_input if self.motors_on else np.zeros(4)

    def measurement(self) -> Measurement:
        pose = self.laboratory.measured_pose("h1")
        return Measurement.of_pose(pose.position_m, pose.quaternion_xyzw)

    @property
    def true_motion(self) -> Array:
        return np.array(self.laboratory.plants["h1"].motion)

    @property
    def error(self) -> Array:
        """Estimated minus true motion."""
        return self.estimator.estimate.motion - self.true_motion

    def steer(self) -> Array:
        motion, model = self.true_motion, self.model
        rotation = heading_matrix(motion[3])
        pull = np.clip(2.5 * (self.set_point[:2] - motion[:2]), -1.5, 1.5)
        push = rotation.T @ pull - 3.0 * motion[4:6]
        climb = model.gravity_m_s2 + 4 * (self.set_point[2] - motion[2]) - 4 * motion[6]
        turn = np.clip(12 * (self.set_point[3] - motion[3]), -12, 12) - 2 * motion[7]
        return np.clip(np.array([*push, climb, turn]) / model.b, model.u_min, model.u_max)

    def step(
        self, see: Callable[[Measurement], Measurement | None] = lambda measurement: measurement
    ) -> bool:
        """Fly one control period; `see` may falsify or hide (None) its poses. True if all were accepted."""
        if self.motors_on:
            sent = self.steer()
            self.laboratory.plants["h1"].set_input(sent)
        else:
            sent = np.zeros(4)
            self.laboratory.plants["h1"].stop_motors()
        accepted = True
        for _ in range(self._frames):
            self.laboratory.advance(self.frame_s)
            self.estimator.predict(self._under_way, self.frame_s)
            seen = see(self.measurement())
            if seen is not None:
                accepted = self.estimator.correct(seen) and accepted
        self._under_way = sent
        return accepted

    def fly(self, seconds: float) -> Array:
        """Fly with all poses seen; errors of the motion, shape (periods, 8)."""
        errors = []
        for _ in range(round(seconds / PERIOD_S)):
            self.step()
            errors.append(self.error)
        return np.array(errors)


@pytest.fixture
def new_flight() -> type[Flight]:
    """Build flights by this class."""
    return Flight
