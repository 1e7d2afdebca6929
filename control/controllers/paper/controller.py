"""The paper's scheme ("set-point MPC"): the baseline that everything else is measured against.

One quadratic program (3)-(4) in the scaled variables (5), 11 states, linearised once over the whole horizon
at the heading of the reference's last stage.
"""

from typing import Annotated, ClassVar, Final, Literal

import msgspec
import numpy as np

from rcopterx.control.controllers.base import BaseController, Solution
from rcopterx.control.controllers.paper.model import (
    BOUNDED_STATES,
    INPUT_WEIGHTS,
    STATE_SIZE,
    STATE_WEIGHTS,
    X_INT,
    PaperModel,
    TerminalCost,
)
from rcopterx.control.controllers.paper.stage_qp import StageQP, StageStructure
from rcopterx.control.controllers.settings import ControllerSettings, ElevenWeights, FourWeights, TimeLimit
from rcopterx.control.interfaces import Estimate
from rcopterx.control.references.trajectory import COLUMNS, Trajectory
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import MOTION_SIZE, XD_BODY, YAW, Array

WIDENING: Final = 1e-3
"""How far beyond the rolled-out plan a state bound is put, in scaled variables."""
TRIM_RANGE: Final = 0.2
"""An input further than this from hovering, in scaled variables, is a manoeuvre and not a trim."""


class PaperSettings(ControllerSettings, frozen=True, kw_only=True):
    """Settings of the paper's scheme; the defaults are the paper's."""

    state_weights: ElevenWeights = STATE_WEIGHTS
    """Diagonal of Q: x y z psi xd_B yd_B zd_B psid x_int y_int z_int."""
    input_weights: FourWeights = INPUT_WEIGHTS
    """Diagonal of R: pitch, roll, thrust, yaw."""
    relinearize: Literal["on_change", "every_step"] = "on_change"
    """Rebuild the matrices only when the reference's last heading changed, or at every step."""
    terminal_cost: bool = True
    """Riccati solution as terminal cost; False weighs the last stage like the others, as in [11]."""
    z_integrator: bool = True
    """False leaves z_int out as in [11]."""
    integral_limit_m_s: Annotated[float, msgspec.Meta(gt=0.0, le=100.0)] = 2.0
    """Integral states stop here (anti-windup)."""
    time_limit_s: TimeLimit = 0.012
    """Time budget of the solver in one step."""


class PaperController(BaseController):
    """Set-point MPC of the paper.

    Parameters
    ----------
    model
        The vehicle.
    period_s
        Control period T_s.
    settings
        Horizon, weights, bounds and switches.

    Raises
    ------
    SettingsError
        Bounds that the vehicle cannot have.
    """

    Settings = PaperSettings
    workspace: ClassVar[type[StageQP]] = StageQP
    """Solver of the quadratic program; benchmarks put peers in its place."""

    def __init__(self, model: Model, period_s: float, settings: PaperSettings) -> None:
        super().__init__(model, period_s, settings.horizon, settings.limits(model))
        self._settings = settings
        self._paper_model = PaperModel(model, period_s, settings.z_integrator)
        state_weights = np.array(settings.state_weights)
        input_weights = np.array(settings.input_weights)
        self._terminal = TerminalCost(self._paper_model, state_weights, input_weights)
        self._state_weights = state_weights
        self._state_scale = np.array(model.state_scale)
        self._state_shift = np.array(model.state_shift)
        self._input_scale = np.array(model.input_scale)
        self._input_shift = np.array(model.input_shift)
        bounded = np.array(BOUNDED_STATES)
        scale, shift = self._state_scale[bounded], self._state_shift[bounded]
        self._state_bounds = (
            (self._limits.state_min - shift) / scale,
            (self._limits.state_max - shift) / scale,
        )
        self._input_bounds = (
            (self._limits.input_min - self._input_shift) / self._input_scale,
            (self._limits.input_max - self._input_shift) / self._input_scale,
        )
        self._input_reference = np.tile(self._scaled_inputs(model.hover_input), (settings.horizon - 1, 1))
        self._integral = np.zeros(3)
        self._bumpless_from: Array | None = None
        self._linearized_at = 0.0
        self._scaled_dynamics = self._scale_dynamics(0.0)
        self._qp = self._workspace()

    def _workspace(self) -> StageQP:
        everywhere = np.abs(self._scale_dynamics(0.7)) > 0
        return self.workspace(
            StageStructure(
                stages=self._horizon,
                dynamics_pattern=everywhere,
                input_pattern=self._scaled_input_matrix() != 0,
                terminal_pattern=np.abs(self._scaled_terminal_cost(0.7)) > 0,
                bounded_states=np.array(BOUNDED_STATES),
            ),
            self._scaled_dynamics,
            self._scaled_input_matrix(),
            self._scaled_terminal_cost(0.0),
            self._state_weights * self._state_scale**2,
            np.array(self._settings.input_weights) * self._input_scale**2,
            self._settings.time_limit_s,
        )

    def _start(
        self,
        estimate: Estimate,  # noqa: ARG002 - the first step knows where the vehicle is
        last_input: Array,
    ) -> None:
        self._integral[:] = 0.0
        self._bumpless_from = last_input
        self._qp.forget()

    def _compute(
        self,
        estimate: Estimate,
        reference: Trajectory,
        last_input: Array,  # noqa: ARG002 - changes of the input cost nothing here
    ) -> Solution | None:
        yaw = float(reference.yaw_rad[-1])
        position = reference.position_m[-1]
        self._take_over_trim(yaw)
        self._linearize(yaw)
        state = np.concatenate((estimate.motion, self._integral))
        guess = self._guess()
        guess_states = self._paper_model.rollout(state, guess, yaw, position)
        state_reference = self._scaled_states(self._state_reference(reference))
        self._qp.warm_start(self._scaled_states(guess_states), self._scaled_inputs(guess))
        found = self._qp.solve(
            self._scaled_states(state),
            self._scaled_affine(position),
            state_reference,
            self._input_reference,
            self._widened_bounds(guess_states),
            self._input_bounds,
        )
        self._integrate(estimate, reference)
        if found is None:
            return None
        inputs = found.inputs * self._input_scale + self._input_shift
        inputs = np.clip(inputs, self._limits.input_min, self._limits.input_max)
        states = self._paper_model.rollout(state, inputs, yaw, position)
        if not found.solved:
            cost, known = (
                self._qp.cost(
                    self._scaled_states(x), self._scaled_inputs(u), state_reference, self._input_reference
                )
                for x, u in ((states, inputs), (guess_states, guess))
            )
            if not cost <= known:
                return None
        return Solution(inputs, self._plan(states), found.iterations, early=not found.solved)

    def _guess(self) -> Array:
        """Previous inputs shifted by one stage: a feasible point of the widened problem."""
        inputs = self._planned_inputs()
        if inputs is None:
            return np.tile(self._model.hover_input, (self._horizon - 1, 1))
        return np.clip(inputs, self._limits.input_min, self._limits.input_max)

    def _widened_bounds(self, guess_states: Array) -> tuple[Array, Array]:
        """State bounds of stages 2 to N, widened just enough to contain the guess."""
        lower, upper = self._state_bounds
        known = self._scaled_states(guess_states)[1:, BOUNDED_STATES]
        return np.minimum(lower, known - WIDENING), np.maximum(upper, known + WIDENING)

    def _linearize(self, yaw: float) -> None:
        unchanged = abs(yaw - self._linearized_at) < 1e-9
        if unchanged and self._settings.relinearize == "on_change":
            return
        self._linearized_at = yaw
        self._scaled_dynamics = self._scale_dynamics(yaw)
        self._qp.set_dynamics(self._scaled_dynamics)
        if self._settings.terminal_cost:
            self._qp.set_terminal_cost(self._scaled_terminal_cost(yaw))

    def _state_reference(self, reference: Trajectory) -> Array:
        """Reference states, shape (N, 11); body velocities with the reference's own heading, equation (6)."""
        samples = reference.samples
        states = np.zeros((self._horizon, STATE_SIZE))
        states[:, :MOTION_SIZE] = samples[:, :MOTION_SIZE]
        c, s = np.cos(samples[:, YAW]), np.sin(samples[:, YAW])
        vx, vy = samples[:, 4], samples[:, 5]
        states[:, XD_BODY] = c * vx + s * vy
        states[:, XD_BODY + 1] = c * vy - s * vx
        return states

    def _plan(self, states: Array) -> Trajectory:
        """Plan in the inertial frame; velocities with the planned heading of their stage."""
        samples = np.empty((self._horizon, COLUMNS))
        samples[:, :MOTION_SIZE] = states[:, :MOTION_SIZE]
        c, s = np.cos(states[:, YAW]), np.sin(states[:, YAW])
        xd, yd = states[:, XD_BODY], states[:, XD_BODY + 1]
        samples[:, 4] = c * xd - s * yd
        samples[:, 5] = s * xd + c * yd
        samples[:-1, 8:] = np.diff(samples[:, 4:8], axis=0) / self._period_s
        samples[-1, 8:] = samples[-2, 8:]
        return Trajectory(samples, self._period_s)

    def _integrate(self, estimate: Estimate, reference: Trajectory) -> None:
        error = estimate.motion[:3] - reference.position_m[0]
        limit = self._settings.integral_limit_m_s
        self._integral += self._period_s * self._paper_model.integrator_gains * error
        np.clip(self._integral, -limit, limit, out=self._integral)

    def _take_over_trim(self, yaw: float) -> None:
        """Set the integral states so that the feedback's steady input is the one that flew before."""
        if self._bumpless_from is None:
            return
        trim = (self._bumpless_from - self._model.hover_input) / self._input_scale
        trim = np.clip(trim, -TRIM_RANGE, TRIM_RANGE) * self._input_scale
        gain = self._terminal.gain(yaw)[:3, X_INT:]
        active = self._paper_model.integrator_gains > 0
        self._integral[active] = -np.linalg.lstsq(gain[:, active], trim[:3], rcond=None)[0]
        limit = self._settings.integral_limit_m_s
        np.clip(self._integral, -limit, limit, out=self._integral)
        self._bumpless_from = None

    def _scaled_states(self, states: Array) -> Array:
        scaled: Array = (states - self._state_shift) / self._state_scale
        return scaled

    def _scaled_inputs(self, inputs: Array) -> Array:
        scaled: Array = (inputs - self._input_shift) / self._input_scale
        return scaled

    def _scale_dynamics(self, yaw: float) -> Array:
        scale = self._state_scale
        scaled: Array = self._paper_model.dynamics(yaw) * scale / scale[:, None]
        return scaled

    def _scaled_input_matrix(self) -> Array:
        scaled: Array = self._paper_model.input_matrix() * self._input_scale / self._state_scale[:, None]
        return scaled

    def _scaled_affine(self, position: Array) -> Array:
        """c of the scaled variables, which absorbs the shifts (the paper's formula after (5))."""
        physical = self._paper_model.affine(position) + self._state_shift
        moved = self._paper_model.dynamics(self._linearized_at) @ self._state_shift
        scaled: Array = (
            physical - moved - self._paper_model.input_matrix() @ self._input_shift
        ) / self._state_scale
        return scaled

    def _scaled_terminal_cost(self, yaw: float) -> Array:
        scale = self._state_scale
        cost = self._terminal.at(yaw) if self._settings.terminal_cost else np.diag(self._state_weights)
        scaled: Array = cost * scale * scale[:, None]
        return scaled
