"""Control schemes that the experiments compare, by name."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from rcopterx.bus.messages import LeaderLink
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import BodyPose
from rcopterx_studies.experiments.knowledge import Knowledge, known_model, plant_type
from rcopterx_studies.experiments.rig import RigVehicle

NO_HURRY: Final[dict[str, object]] = {"time_limit_s": 1.0}
"""With a time limit of the solver a flight would depend on the speed of the computer."""
HORIZON: Final = 50


@dataclass(frozen=True)
class FlownScheme:
    """A controller with settings behind the extended Kalman filter, and the knowledge of its pilot."""

    name: str
    title: str
    controller: str
    settings: Mapping[str, object] = field(default_factory=dict)
    estimator_settings: Mapping[str, object] = field(default_factory=dict)
    knowledge: Knowledge = "default"
    horizon: int = HORIZON

    def vehicle(
        self,
        name: str,
        start: BodyPose,
        conditions: Conditions,
        seed: int,
        following: tuple[LeaderLink, ...] = (),
    ) -> RigVehicle:
        """A vehicle of the conditions' type that is flown by this scheme."""
        measured_tilt = bool(self.estimator_settings.get("measured_tilt", True))
        return RigVehicle(
            name,
            known_model(self.knowledge, conditions, name, seed, measured_tilt),
            start,
            self.controller,
            self.settings,
            estimator_settings=self.estimator_settings,
            horizon=self.horizon,
            following=following,
            plant_type=plant_type(conditions),
            as_published=self.controller == "paper",
        )


KUNZ: Final = FlownScheme(
    "kunz_2013",
    "Implementation of [11]",
    "paper",
    {**NO_HURRY, "terminal_cost": False, "z_integrator": False, "integral_limit_m_s": 20.0},
)
PAPER: Final = FlownScheme("paper", "Paper's scheme", "paper", NO_HURRY)
CASCADE: Final = FlownScheme("cascade", "Cascade", "cascade")

TUNED_PAPER: Final = replace(
    PAPER, title="Paper's scheme, tuned", settings={**NO_HURRY, "input_weights": (2.5, 2.5, 5.0, 100.0)}
)
TUNED_LQR: Final = FlownScheme("lqr", "LQR, tuned", "lqr", {"input_weights": (1.0, 1.0, 5.0, 100.0)})
TUNED_PID: Final = FlownScheme(
    "pid",
    "PID, tuned",
    "pid",
    {
        "proportional": (4.9, 4.9, 11.76, 17.28),
        "damping": (3.92, 3.92, 6.3, 8.4),
        "integral": (1.6464, 1.6464, 5.488),
    },
)
"""The simple schemes with the best settings of several for helicopters, see `docs/experiments.md`."""
NO_FEED_FORWARD: Final = FlownScheme(
    "cascade_no_feed_forward", "Cascade, no feed-forward", "cascade", {"feed_forward": False}
)
TUNED: Final = {scheme.name: scheme for scheme in (TUNED_PAPER, TUNED_LQR, TUNED_PID, NO_FEED_FORWARD)}
"""Schemes of the arena with settings of their own, by name."""
