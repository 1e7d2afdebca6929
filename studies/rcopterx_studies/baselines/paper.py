"""The paper's scheme ("set-point MPC"): the baseline that everything else is measured against.

One optimal control problem (3)-(4) with 11 states and 4 inputs, linearised once over the whole horizon at the
heading of the reference's last stage. The scaling (5) changes no solution; problems are stated in SI units.
State bounds are soft, because a measured state may lie beyond them.
"""

from collections.abc import Callable
from typing import Annotated, Final

import msgspec
import numpy as np

from rcopterx.control.controllers.base import EARLY_STOP, BaseController
from rcopterx.control.controllers.settings import FourWeights, MpcSettings
from rcopterx.control.interfaces import ControlStep, Estimate
from rcopterx.control.references.columns import ACCELERATIONS, COLUMNS, RATES, X_RATE
from rcopterx.control.references.paths import in_frames
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.control.solver.problem import HARD, OptimalControlProblem, Solver, repeated
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, MOTION_SIZE, XD_BODY, YAW, Array
from rcopterx_studies.baselines import paper_model

SOFT_WEIGHT: Final = 1e5  # weight of the squared excess over a state bound, SI units
TRIM_CAP: Final = np.array([0.2, 0.2, 0.1])  # further from hovering an input is a manoeuvre and no trim


class PaperSettings(MpcSettings, frozen=True, kw_only=True):
    """Settings of the paper's scheme; the defaults are the paper's."""

    state_weights: paper_model.ElevenWeights = paper_model.STATE_WEIGHTS
    """Diagonal of Q: x y z psi xd_B yd_B zd_B psid x_int y_int z_int."""
    input_weights: FourWeights = paper_model.INPUT_WEIGHTS
    """Diagonal of R: pitch, roll, thrust, yaw."""
    terminal_cost: bool = True
    """Riccati solution as terminal cost; False weighs the last stage like the others, as in [11]."""
    z_integrator: bool = True
    """False leaves z_int out as in [11]."""
    integral_limit_m_s: Annotated[float, msgspec.Meta(gt=0.0, le=100.0)] = 2.0
    """Integral states stop here (anti-windup)."""


class PaperController(BaseController):
    """Set-point MPC of the paper; `new_solver` makes another solver than the one that the settings name.

    Raises `SettingsError`: bounds that the vehicle cannot have.
    """

    Settings = PaperSettings

    def __init__(
        self,
        model: Model,
        period_s: float,
        settings: PaperSettings,
        new_solver: Callable[[], Solver] | None = None,
    ) -> None:
        super().__init__(model, period_s, settings.horizon, settings.limits(model))
        self._settings = settings
        self._paper_model = paper_model.PaperModel(model, period_s, settings.z_integrator)
        Q, R = np.array(settings.state_weights), np.array(settings.input_weights)
        self._terminal = paper_model.TerminalCost(self._paper_model, Q, R)
        self._solver = (new_solver or settings.new_solver)()
        self._integral = np.zeros(3)
        self._bumpless_from: Array | None = None
        self._linearized_at: float | None = None
        rows = paper_model.STATE_SIZE + INPUT_SIZE
        C, D = np.eye(rows, paper_model.STATE_SIZE), np.eye(rows, INPUT_SIZE, -paper_model.STATE_SIZE)
        bounded, sticks = np.array(paper_model.BOUNDED_STATES), slice(paper_model.STATE_SIZE, None)
        s = np.zeros(rows)
        s[bounded], s[sticks] = SOFT_WEIGHT, HARD
        A, B = self._paper_model.dynamics(0.0), self._paper_model.input_matrix()
        p = repeated(settings.horizon - 1, A, B, C, D, np.concatenate((Q, R)), s, np.diag(Q))
        motions = np.hstack((self._limits.position, self._limits.velocity))
        p.low[:, :MOTION_SIZE], p.high[:, :MOTION_SIZE] = motions
        p.low[:, sticks], p.high[:, sticks] = self._limits.input_min, self._limits.input_max
        p.s[0, : paper_model.STATE_SIZE] = 0.0
        p.r[:, sticks] = model.hover_input
        self._problem = p

    def _start(
        self,
        estimate: Estimate,  # noqa: ARG002 - the first step has the estimate
        last_input: Array,
    ) -> None:
        self._integral[:] = 0.0
        self._bumpless_from = last_input
        self._solver.reset()

    def _compute(self, estimate: Estimate, reference: Trajectory, expired: Callable[[], bool]) -> ControlStep:
        yaw = float(reference.yaw_rad[-1])
        self._take_over_trim(yaw)
        same_cost = yaw == self._linearized_at
        self._linearized_at = yaw
        plan = self._solver.solve(self._stated(estimate, reference, yaw), same_cost, expired)
        self._integrate(estimate, reference)
        fallback = None if plan.optimal else EARLY_STOP
        return ControlStep(plan.u, self._plan(plan.x), fallback, plan.iterations)

    def _stated(self, estimate: Estimate, reference: Trajectory, yaw: float) -> OptimalControlProblem:
        """Equations (3)-(4), linearised at a heading; the arrays are used again for the next problem."""
        p, states = self._problem, self._state_reference(reference)
        p.A[:] = self._paper_model.dynamics(yaw)
        p.c[:] = -self._paper_model.affine(reference.position_m[-1])
        p.r[:, : paper_model.STATE_SIZE] = states[:-1]
        if self._settings.terminal_cost:
            p.P[:] = self._terminal.at(yaw)
        p.x_end[:], p.x_0[:] = states[-1], np.concatenate((estimate.motion, self._integral))
        return p

    def _state_reference(self, reference: Trajectory) -> Array:
        """Reference states, shape (N, 11); body velocities with the reference's own heading, equation (6)."""
        samples = reference.samples
        states = np.zeros((self.horizon, paper_model.STATE_SIZE))
        states[:, :MOTION_SIZE] = samples[:, :MOTION_SIZE]
        states[:, XD_BODY : XD_BODY + 2] = in_frames(samples[:, YAW], samples[:, X_RATE : X_RATE + 2])
        return states

    def _plan(self, states: Array) -> Trajectory:
        """Plan in the inertial frame; velocities with the planned heading of their stage."""
        samples = np.empty((self.horizon, COLUMNS))
        samples[:, :MOTION_SIZE] = states[:, :MOTION_SIZE]
        samples[:, X_RATE : X_RATE + 2] = in_frames(-states[:, YAW], states[:, XD_BODY : XD_BODY + 2])
        samples[:-1, ACCELERATIONS] = np.diff(samples[:, RATES], axis=0) / self.period_s
        samples[-1, ACCELERATIONS] = samples[-2, ACCELERATIONS]
        return Trajectory(samples, self.period_s)

    def _integrate(self, estimate: Estimate, reference: Trajectory) -> None:
        error = estimate.motion[:3] - reference.position_m[0]
        limit = self._settings.integral_limit_m_s
        self._integral += self.period_s * self._paper_model.integrator_gains * error
        np.clip(self._integral, -limit, limit, out=self._integral)

    def _take_over_trim(self, yaw: float) -> None:
        """Set the integral states so that the feedback's steady input is the one that flew before."""
        if self._bumpless_from is None:
            return
        trim = np.clip((self._bumpless_from - self._model.hover_input)[:3], -TRIM_CAP, TRIM_CAP)
        gain = self._terminal.gain(yaw)[:3, paper_model.X_INT :]
        active = self._paper_model.integrator_gains > 0
        self._integral[active] = -np.linalg.lstsq(gain[:, active], trim, rcond=None)[0]
        limit = self._settings.integral_limit_m_s
        np.clip(self._integral, -limit, limit, out=self._integral)
        self._bumpless_from = None
