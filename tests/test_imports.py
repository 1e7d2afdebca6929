"""Promises of the layout as a whole; `pyproject.toml` has the allowed directions of imports."""

from graphlib import CycleError, TopologicalSorter
from itertools import pairwise

import grimp
import pytest

from imported_lines import PARTS, imported


def first_cycle(imports: dict[str, set[str]]) -> list[str]:
    """Modules of a cycle, each of which imports the next one; empty if there is none."""
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        return list(reversed(error.args[1]))
    return []


def test_no_modules_import_each_other_in_a_circle() -> None:
    graph = grimp.build_graph("rcopterx", "rcopterx_studies", cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    assert len(imports) > 200
    assert first_cycle(imports) == []


def test_cycle_is_reported_in_the_direction_of_the_imports() -> None:
    assert first_cycle({"a": {"b"}, "b": {"c"}, "c": set()}) == []
    cycle = first_cycle({"a": {"b"}, "b": {"c"}, "c": {"d"}, "d": {"b"}})
    assert cycle[0] == cycle[-1]
    assert set(pairwise(cycle)) == {("b", "c"), ("c", "d"), ("d", "b")}


@pytest.fixture(scope="module")
def imported_by() -> dict[str, set[str]]:
    """Our modules that each process of a flight on hardware imports."""
    return {part: {name.removeprefix("rcopterx.") for name in imported(part)} for part in PARTS}


@pytest.mark.parametrize("part", PARTS)
def test_no_process_imports_the_simulator_on_hardware(imported_by: dict[str, set[str]], part: str) -> None:
    assert not {name for name in imported_by[part] if name.startswith("simulator")}


def test_an_agent_imports_no_codec_of_a_radio(imported_by: dict[str, set[str]]) -> None:
    loaded = imported_by["agent"]
    assert "radios.protocol" not in loaded, "every codec imports it"
    assert not {name for name in loaded if name.startswith("transmitter_gateway")}


def test_a_transmitter_gateway_imports_only_codecs_that_its_radios_use_and_no_system_identification(
    imported_by: dict[str, set[str]],
) -> None:
    loaded = imported_by["transmitters"]
    assert "radios.multi" in loaded
    assert not loaded & {"radios.dsmp", "radios.dsm2_serial", "radios.ppm", "radios.mavlink"}
    assert not {name for name in loaded if name.startswith(("control", "agents", "formation"))}
