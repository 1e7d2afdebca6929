"""Estimators by name: the built-in ones and those that installed packages add.

A package adds an estimator through the entry-point group `rcopterx.estimators`; the entry point names a class
with an attribute `Settings` (a `msgspec.Struct` type) that is built from (model, period_s, settings), where
`period_s` is the nominal time between calls of `predict`.
An estimator's module is imported only when that estimator is built.
"""

from typing import Final

from rcopterx.control.interfaces import Estimator
from rcopterx.control.plugins.registry import Registry

ESTIMATORS: Final = Registry[Estimator](
    "estimator",
    "rcopterx.estimators",
    {
        "extended_kalman": "rcopterx.control.estimators.extended_kalman:ExtendedKalmanEstimator",
        "finite_difference": "rcopterx.control.estimators.finite_difference:FiniteDifferenceEstimator",
        "kalman": "rcopterx.control.estimators.kalman:KalmanEstimator",
    },
)
