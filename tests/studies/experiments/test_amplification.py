"""Promises of gains along formations: errors grow with plans alone, not with the default share of them."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from support.vehicle_types import COAXIAL

from rcopterx.control.controllers.cascade.controller import CascadeController, CascadeSettings
from rcopterx.vehicles.model import IDENTIFIED, Model
from rcopterx.vehicles.tilt import TiltModel
from rcopterx_studies.experiments.amplification import LinearVehicle, amplifications, linear_vehicle

NAMES = tuple(f"h{number}" for number in range(1, 9))
CHAIN = {"h1": {}} | {name: {leader: 1.0} for leader, name in pairwise(NAMES)}


def linear(model: Model) -> LinearVehicle:
    return linear_vehicle(
        model, CascadeController(model, 0.02, CascadeSettings(horizon=20, integrators=False))
    )


@pytest.fixture(scope="module")
def alike() -> LinearVehicle:
    return linear(COAXIAL)


@pytest.fixture(scope="module")
def others() -> list[LinearVehicle]:
    """Identified helicopters with fast and slow tilt."""
    tilt = COAXIAL.tilt
    assert isinstance(tilt, TiltModel)
    return [
        linear(
            replace(
                COAXIAL,
                tilt=replace(tilt, frequency_rad_s=frequency, damping_ratio=0.3),
                uncertainty=IDENTIFIED,
            )
        )
        for frequency in (10.0, 17.0)
    ]


def chain_of(vehicles: list[LinearVehicle], share: float) -> list[float]:
    line = {name: vehicles[number % len(vehicles)] for number, name in enumerate(NAMES)}
    found = amplifications(line, CHAIN, dict.fromkeys(NAMES, share))
    assert found["h1"] == pytest.approx(1.0)
    return [found[name] for name in NAMES]


def test_a_vehicle_alone_is_stable(alike: LinearVehicle) -> None:
    assert np.abs(np.linalg.eigvals(alike.transition)).max() < 1.0


def test_the_default_share_fades_and_plans_alone_grow(alike: LinearVehicle) -> None:
    assert 0.25 * alike.passed_on < 1.0 < alike.passed_on
    assert max(chain_of([alike], 0.25)) < 1.05
    grown = chain_of([alike], 1.0)
    assert grown[1] < 1.05
    assert grown[-1] > 1.5


def test_errors_of_different_vehicles_grow_with_plans_alone_and_not_by_default(
    others: list[LinearVehicle],
) -> None:
    assert chain_of(others, 0.0) == pytest.approx([1.0] * len(NAMES))
    assert max(chain_of(others, 0.25)) < 1.1
    grown = chain_of(others, 1.0)
    assert grown[-1] > grown[5] > grown[2] > 1.0


def test_of_two_leaders_each_counts_by_its_weight(alike: LinearVehicle) -> None:
    near = {"h1": {}, "h2": {"h1": 1.0}, "h3": {"h1": 1.0}}
    mixed = near | {"h3": {"h1": 0.5, "h2": 0.5}}
    found = [
        amplifications(dict.fromkeys(near, alike), tree, dict.fromkeys(near, 1.0)) for tree in (near, mixed)
    ]
    assert found[0]["h3"] == pytest.approx(found[0]["h2"])
    assert found[1]["h3"] - 1.0 != pytest.approx(found[0]["h3"] - 1.0, rel=0.01)
