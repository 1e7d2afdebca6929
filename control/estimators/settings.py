"""Settings every estimator shares."""

from typing import Annotated

import msgspec

Positive = Annotated[float, msgspec.Meta(gt=0.0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0.0)]
FourPositive = tuple[Positive, Positive, Positive, Positive]


class EstimatorSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Settings of the innovation gate, common to all estimators that come with the package."""

    position_gate_m: Positive = 0.06
    """A pose is refused when it departs from the prediction by more than this plus five deviations."""
    yaw_gate_rad: Positive = 0.35
    """The same for the heading."""
    gate_limit_s: Positive = 0.25
    """Poses that agree with each other for so long while the gate refuses them are believed after all."""
