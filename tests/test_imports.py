"""Promises of the layout as a whole; `pyproject.toml` has the allowed directions of imports."""

from graphlib import CycleError, TopologicalSorter
from itertools import pairwise

import grimp


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
