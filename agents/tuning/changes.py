"""Changes in flight: a thread builds and warms up the new objects, swapped in between control periods."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from rcopterx.agents.pilot import Pilot
from rcopterx.agents.tuning.configuration import Configuration, FlownParts
from rcopterx.agents.work_ahead import WorkAhead
from rcopterx.bus.messages import Diagnostics
from rcopterx.control.interfaces import Controller, Estimate, Estimator, NoSolutionError
from rcopterx.control.references.trajectory import hold
from rcopterx.user_text import described
from rcopterx.vehicles.state import YAW

WARM_UP_STEPS = 3  # steps of a new controller or estimator; one for new settings


@dataclass(frozen=True, slots=True)
class Replacement:
    """New objects; None for one that stays."""

    configuration: Configuration
    controller: Controller | None
    estimator: Estimator | None
    parts: FlownParts | None  # everything, for another model


class Tuning:
    """The present configuration of a pilot, the one before, and at most one change under way."""

    def __init__(
        self,
        configuration: Configuration,
        pilot: Pilot,
        period_s: float,
        wake: Callable[[], None] = lambda: None,
    ) -> None:
        self.configuration = configuration
        self.previous: Configuration | None = None  # configuration before the last change, if any
        self.remark = ""  # why another configuration flies than the chosen one, after deaths of the process
        self._restored: Configuration | None = None
        self._learned_s = 0.0  # when what the vehicle has learned was first used
        self._pilot = pilot
        self._model = pilot.model  # of the fleet file
        self._period_s = period_s
        self._work: WorkAhead[Replacement | ValueError] = WorkAhead("tuning", wake)

    @property
    def intended(self) -> Configuration:
        """Present configuration, or that of a predecessor while it is being prepared."""
        return self.configuration if self._restored is None else self._restored

    @property
    def busy(self) -> bool:
        """Whether a change is under way."""
        return self._work.busy

    def begin(self, wanted: Configuration) -> None:
        """Begin to prepare another configuration; only while not `busy`."""
        pilot = self._pilot
        motion = np.zeros(8) if not pilot.clock.started else pilot.estimate.motion.copy()
        estimate = Estimate(motion, pilot.input_history.newest.copy(), np.zeros(4))
        frame_period_s = pilot.clock.period_s or self._period_s
        self._work.begin(lambda: self._prepared(wanted, estimate, frame_period_s))

    def restore(self, configuration: Configuration) -> None:
        """Begin to go back to what a predecessor flew with, unless that is what flies."""
        if configuration != self.configuration and not self.busy:
            self._restored = configuration
            self.begin(configuration)

    def use_defaults(self, remark: str) -> None:
        """Fly with the default controller and the default estimator from now on, and say why."""
        self._pilot.use_defaults()
        self.note_replaced()
        self.previous, self.remark = None, remark

    def diagnostics(self) -> Diagnostics:
        """Return diagnostics that name what flies; other parts of the agent add theirs."""
        flown = self.configuration.message
        return Diagnostics(
            controller=flown.controller,
            estimator=flown.estimator,
            controller_settings=flown.controller_settings,
            estimator_settings=flown.estimator_settings,
            horizon=self._pilot.controller.horizon,
            effort_factor=max(self.configuration.effort_factors),
            remarks=(self.remark,),
            model=flown.model,
            learned=flown.learned,
            learned_age_s=self._pilot.clock.time_s - self._learned_s if flown.learned else None,
        )

    def note_replaced(self) -> bool:
        """Note what the pilot has replaced after failures; return whether the configuration changes."""
        before, pilot = self.configuration, self._pilot
        if not (pilot.step_guard.replaced or pilot.estimator.replaced):
            return False
        if pilot.step_guard.replaced:
            self.configuration = self.configuration.with_default_controller()
        if pilot.estimator.replaced:
            self.configuration = self.configuration.with_default_estimator()
        return self.configuration != before

    def _prepared(
        self, wanted: Configuration, estimate: Estimate, frame_period_s: float
    ) -> Replacement | ValueError:
        try:
            return self._build(wanted, estimate, frame_period_s)
        except ValueError as error:
            return error
        except Exception as error:  # noqa: BLE001 - a plug-in may raise anything
            return ValueError(f"{wanted.controller}, {wanted.estimator} cannot be built: {described(error)}")

    def _build(self, wanted: Configuration, estimate: Estimate, frame_period_s: float) -> Replacement:
        """Build what differs from the present configuration, and let it run a few steps as a warm-up."""
        present, model, last_input = self.configuration, self._model, estimate.actuator
        parts = controller = estimator = None
        if wanted.model != present.model:
            parts = wanted.parts(model, self._period_s)
            controller, estimator = parts.controller, parts.estimator
        if (wanted.controller, wanted.controller_settings) != (
            present.controller,
            present.controller_settings,
        ):
            controller = controller or wanted.controller_for(model, self._period_s)
        if (wanted.estimator, wanted.estimator_settings) != (present.estimator, present.estimator_settings):
            estimator = estimator or wanted.estimator_for(model, self._period_s)
        if controller is not None:
            motion = estimate.motion
            reference = hold(motion[:3], float(motion[YAW]), self._period_s, controller.horizon)
            controller.reset(estimate, last_input)
            for _ in range(WARM_UP_STEPS if wanted.controller != present.controller else 1):
                with suppress(NoSolutionError):
                    controller.step(estimate, reference, last_input)
        if estimator is not None:
            estimator.take_over(estimate)
            for _ in range(WARM_UP_STEPS if wanted.estimator != present.estimator else 1):
                estimator.predict(last_input, frame_period_s)
        return Replacement(wanted, controller, estimator, parts)

    def wait(self) -> None:
        """Wait for the end of the preparation."""
        self._work.wait()

    def finish(self) -> str | ValueError | None:
        """Swap in what is ready between two periods; return what flies or why not, None if not ready."""
        found = self._work.finish()
        if found is None:
            return None
        (result,) = found
        restored, self._restored = self._restored is not None, None
        if isinstance(result, ValueError):
            return result
        if result.parts is not None:
            self._pilot.use_model(
                result.parts.model, result.parts.default_controller, result.parts.default_estimator
            )
        if result.controller is not None:
            self._pilot.use_controller(result.controller)
        if result.estimator is not None:
            self._pilot.use_estimator(result.estimator)
        if not restored:
            self.previous, self.remark = self.configuration, ""
        if result.configuration.model != self.configuration.model:
            self._learned_s = self._pilot.clock.time_s
        self.configuration = result.configuration
        now = result.configuration
        horizon, frame = self._pilot.controller.horizon, self._pilot.clock.current_frame
        return f"{now.controller}, {now.estimator}, horizon {horizon}, from frame {frame}"
