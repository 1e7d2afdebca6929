"""Promises of the mutation scores: the files they change exist, and mutmut changes the same ones."""

import tomllib
from itertools import chain

from mutation_score import GROUPS, ROOT


def test_mutmut_changes_the_files_that_are_scored() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mutmut"]
    scored = sorted(chain.from_iterable(GROUPS.values()))
    assert sorted(settings["only_mutate"]) == scored
    assert all((ROOT / path).is_file() for path in scored)
