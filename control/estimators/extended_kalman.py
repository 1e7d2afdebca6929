"""The extended Kalman filter that fits a vehicle's model: with its tilt as a state, or with lags only."""

from typing import Final

from rcopterx.control.estimators.lag_kalman import ExtendedKalmanSettings, LagKalmanEstimator
from rcopterx.control.estimators.tilt_kalman import TiltKalmanEstimator
from rcopterx.vehicles.model import Model


class ExtendedKalman:
    """Builds the filter of a vehicle."""

    Settings: Final = ExtendedKalmanSettings

    def __call__(self, model: Model, period_s: float, settings: ExtendedKalmanSettings) -> LagKalmanEstimator:
        """The filter for this model (`rcopterx.control.estimators.registry.EstimatorClass`)."""
        kind = LagKalmanEstimator if model.tilt is None else TiltKalmanEstimator
        return kind(model, period_s, settings)


extended_kalman: Final = ExtendedKalman()
