"""Controllers by name, and the errors of wrong settings."""

import subprocess
import sys
import tomllib
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from support.vehicle_types import COAXIAL_LAG

from rcopterx.control import plugins
from rcopterx.control.plugins import CONTROLLERS, ESTIMATORS, OF_STUDIES, SCHEMES, Registry, SettingsError

ROOT = Path(__file__).parents[3]


def test_built_in_controllers_need_no_installed_metadata(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugins, "entry_points", lambda group: [])
    assert CONTROLLERS.available() == ["cascade", "pid"]
    for name in ("cascade", "pid"):
        controller = CONTROLLERS.build(name, COAXIAL_LAG, 0.02, {"horizon": 12})
        assert (controller.horizon, controller.period_s) == (12, 0.02)


def test_an_installed_package_adds_a_controller(monkeypatch: pytest.MonkeyPatch) -> None:
    added = EntryPoint(
        "mine", "rcopterx.control.controllers.feedback:PidController", CONTROLLERS.entry_point_group
    )
    monkeypatch.setattr(plugins, "entry_points", lambda group: [added])
    assert "mine" in CONTROLLERS.available()
    assert CONTROLLERS.build("mine", COAXIAL_LAG, 0.02, {"horizon": 5}).horizon == 5


def test_a_package_that_cannot_be_imported_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    broken = EntryPoint("broken", "no_such_package:Thing", CONTROLLERS.entry_point_group)
    monkeypatch.setattr(plugins, "entry_points", lambda group: [broken])
    with pytest.raises(SettingsError, match=r"'broken' \(no_such_package:Thing\) cannot be imported"):
        CONTROLLERS.load("broken")


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        (
            "class Mine: limit = larg",
            "cannot be imported: NameError: name 'larg' .* \\(mine_plug_in.py, line 1\\)",
        ),
        ("class Mine\n    pass", "cannot be imported: SyntaxError: .*\\(mine_plug_in.py, line 1\\)$"),
        ("limits = {}['roll']", "cannot be imported: KeyError: 'roll' \\(mine_plug_in.py, line 1\\)"),
        (
            "class Yours: pass",
            "cannot be imported: AttributeError: module 'mine_plug_in' has no attribute 'Mine'$",
        ),
        ("class Mine: pass", "has no attribute Settings"),
    ],
)
def test_a_plug_in_with_a_mistake_is_named_with_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, source: str, reason: str
) -> None:
    (tmp_path / "mine_plug_in.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "mine_plug_in", raising=False)
    mine = EntryPoint("mine", "mine_plug_in:Mine", CONTROLLERS.entry_point_group)
    monkeypatch.setattr(plugins, "entry_points", lambda group: [mine])
    with pytest.raises(SettingsError, match=rf"controller 'mine' \(mine_plug_in:Mine\) {reason}"):
        CONTROLLERS.build("mine", COAXIAL_LAG, 0.02, {})


def test_an_unknown_controller_is_told_what_is_allowed() -> None:
    with pytest.raises(SettingsError, match=r"no controller is called 'mpc'; allowed are .*paper"):
        CONTROLLERS.build("mpc", COAXIAL_LAG, 0.02, {})


@pytest.mark.parametrize("registry", [CONTROLLERS, ESTIMATORS, SCHEMES], ids=lambda registry: registry.kind)
def test_what_studies_add_is_named_with_its_package(
    registry: Registry[object], monkeypatch: pytest.MonkeyPatch
) -> None:
    project = tomllib.loads((ROOT / "studies" / "pyproject.toml").read_text("utf-8"))["project"]
    added = project["entry-points"][registry.entry_point_group]
    assert set(added) <= set(OF_STUDIES)
    monkeypatch.setattr(plugins, "entry_points", lambda group: [])
    for name in added:
        with pytest.raises(
            SettingsError, match=f"'{name}': part of rcopterx-studies: pip install rcopterx-studies"
        ):
            registry.load(name)


def test_importing_the_registry_imports_no_controller() -> None:
    code = (
        "import sys, rcopterx.control.plugins as r; r.CONTROLLERS.available();"
        "assert not {'osqp', 'rcopterx.control.controllers.feedback'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=300)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"horizon": 1}, r">= 2 - at `\$.horizon`"),
        ({"horizon": 201}, r"<= 200 - at `\$.horizon`"),
        ({"horizon": 10.5}, r"Expected `int`.*horizon"),
        ({"horizn": 20}, r"unknown setting 'horizn'; allowed are .*; did you mean 'horizon'\\?"),
        ({"input_weights": [1, 1, 0, 1]}, r"> 0.0 - at `\$.input_weights\[2\]`"),
        ({"input_weights": [1, 1, 1]}, r"length 4, got 3 - at `\$.input_weights`"),
        ({"input_weights": [1, float("inf"), 1, 1]}, r"input_weights: every number must be finite"),
        (
            {"state_min": [2.0, -1, 0, -1, -1, -1, -1]},
            r"state_min of x must be below state_max, got 2 and 1.2",
        ),
        ({"input_max": [2.0, 1, 1, 0.4]}, r"of pitch: \[-1, 2\] leaves the vehicle's range \[-1, 1\]"),
        ({"input_max": [1, 1, 0.5, 0.4]}, r"of thrust: \[0, 0.5\] must contain 0.545"),
        ({"time_limit_s": 0}, r"> 0.0 - at `\$.time_limit_s`"),
    ],
)
def test_a_wrong_setting_is_named_with_what_is_allowed(settings: dict[str, object], message: str) -> None:
    with pytest.raises(SettingsError, match=message) as refused:
        CONTROLLERS.build("paper", COAXIAL_LAG, 0.02, settings)
    assert "controller 'paper'" in str(refused.value)


def test_a_period_outside_the_range_is_refused() -> None:
    with pytest.raises(SettingsError, match="period_s must be from"):
        CONTROLLERS.build("paper", COAXIAL_LAG, 0.0, {})
