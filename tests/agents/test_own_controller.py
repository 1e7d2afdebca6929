"""The worked example of an own controller: found by its entry point, it flies like the others."""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from support.hovering import HoveringFlight
from support.vehicle_types import COAXIAL_LAG

from rcopterx.control.plugins import CONTROLLERS, SettingsError

EXAMPLE = Path(__file__).parents[2] / "examples" / "own_controller"


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The example as `pip install` would leave it: its module and its entry point on the path."""
    metadata = tmp_path / "my_controller-0.1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: my-controller\nVersion: 0.1.0\n")
    (metadata / "entry_points.txt").write_text(
        "[rcopterx.controllers]\nbackstepping = my_controller:Backstepping\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.syspath_prepend(str(EXAMPLE))
    yield
    sys.modules.pop("my_controller", None)


def test_the_entry_point_is_that_of_the_package_description() -> None:
    text = (EXAMPLE / "pyproject.toml").read_text(encoding="utf-8")
    group = '[project.entry-points."rcopterx.controllers"]'
    assert f'{group}\nbackstepping = "my_controller:Backstepping"' in text


def test_own_controller_is_found_by_name_and_flies(installed: None) -> None:
    assert "backstepping" in CONTROLLERS.available()
    flight = HoveringFlight("cascade")
    flight.fly(100)
    outcome = flight.change(controller="backstepping")
    assert isinstance(outcome, str)
    flight.fly(200)
    assert flight.error_m() < 0.15
    assert not flight.pilot.fallbacks
    last = flight.flown[-1]
    assert len(last.plan.samples) == 20
    assert np.isfinite(last.plan.samples).all()


def test_its_settings_are_checked_like_those_of_the_others(installed: None) -> None:
    with pytest.raises(SettingsError, match="stiffness"):
        CONTROLLERS.build("backstepping", COAXIAL_LAG, 0.02, {"stiffness": -1.0})
