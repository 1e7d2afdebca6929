"""What a flight shows beyond a model of the horizontal motion: the noise under which it is likeliest."""

from collections.abc import Sequence
from dataclasses import astuple, replace
from typing import Final

import numpy as np
from scipy.optimize import minimize

from rcopterx.control.identification.motions import Candidate, horizontal, unexplained
from rcopterx.control.identification.recording import FlightRecording
from rcopterx.vehicles.model import Unexplained
from rcopterx.vehicles.state import Array

_SPREAD: Final = 1.0  # of the logarithms around what is usual, before a flight shows more
_FARTHEST: Final = 4.0  # spreads


def likeliest(candidate: Candidate, flights: Sequence[FlightRecording]) -> Unexplained:
    """Return what flights show beyond a candidate, by maximum likelihood of its predictor's innovations."""
    bare = replace(candidate.model, unexplained=None)
    usual, found = (np.log(astuple(unexplained(model))) for model in (bare, candidate.model))

    def cost(logarithms: Array) -> float:
        model = replace(bare, unexplained=Unexplained(*np.exp(logarithms).tolist()))
        motions = (horizontal(replace(candidate, model=model), flight) for flight in flights)
        prior = float(np.sum(((logarithms - usual) / _SPREAD) ** 2))
        return sum(each.improbability() for each in motions) + 0.5 * prior

    bounds = [(one - _FARTHEST * _SPREAD, one + _FARTHEST * _SPREAD) for one in usual]
    solved = minimize(cost, found, method="L-BFGS-B", bounds=bounds, options={"eps": 1e-4, "ftol": 1e-7})
    return Unexplained(*np.exp(solved.x).tolist())
