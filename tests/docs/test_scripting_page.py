"""Promises of the pages: their examples in Python run, the list of calls is that of the classes."""

import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.scripted import fleet_file_text, scripted

from rcopterx.bus.session import BusAddress, Session
from rcopterx.flights.csv_export import export_csv
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.vehicle import Vehicle
from scripting_page import PAGE, reference, with_reference

PAGES = (PAGE.parents[1] / "README.md", *sorted(PAGE.parent.glob("*.md")))
EXAMPLES = [
    pytest.param(example, id=f"{page.name}-{number}")
    for page in PAGES
    for number, example in enumerate(
        re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    )
]


@pytest.fixture
def trio(
    bus_address: BusAddress, join: Callable[..., Session], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    """A scripted fleet that answers to the name `trio`, whether it is joined or launched."""
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    path = tmp_path / "trio.toml"
    path.write_text(fleet_file_text(bus_address, ("h1", "h2", "h3")))
    monkeypatch.setattr("rcopterx.ground_station.scripting.fleet.fleet_path", lambda name: path)
    monkeypatch.setattr("rcopterx.launched", Fleet.connect)
    with scripted(join(), "h1", "h2", "h3"):
        yield


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Directory in which a flight was exported to `tables`."""
    directory = tmp_path_factory.mktemp("exported")
    export_csv([PAGE.parents[1] / "tests" / "fixtures" / "reference_flight.mcap"], directory / "tables")
    return directory


@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_runs(example: str, trio: None, exported: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(exported)
    exec(compile(example, "docs", "exec"), {})


def test_the_list_of_calls_is_that_of_the_classes() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert text == with_reference(text), "run: python docs/generators/scripting_page.py"


@pytest.mark.parametrize("kind", [Fleet, Vehicle])
def test_every_public_call_is_listed(kind: type) -> None:
    listed = reference()
    for name, _ in inspect.getmembers(kind, inspect.isroutine):
        if not name.startswith("_") and name not in ("statuses", "frame_period_s", "moving_state_of"):
            assert f"| `{name}(" in listed


def test_types_of_arguments_have_their_names() -> None:
    assert "| `use_model(parameters: Parameters)` |" in reference()
    assert "Meta(" not in reference()
