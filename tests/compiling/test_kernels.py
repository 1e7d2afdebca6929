"""Promises of all kernels: nothing is compiled once they have been imported."""

import importlib
import re
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from rcopterx.compiling.cache import MODULES
from rcopterx.compiling.compiled import ANY_MATRIX, ANY_VECTOR, VECTOR, compiled, record

ROOT = Path(__file__).parents[2]


@compiled(VECTOR, ANY_MATRIX)
def weighted(weights: np.ndarray, matrix: np.ndarray) -> float:
    total = 0.0
    for row in range(len(weights)):
        for column in range(matrix.shape[1]):
            total += weights[row] * matrix[row, column]
    return total


def kernel_modules() -> list[ModuleType]:
    return [importlib.import_module(f"rcopterx.{name}") for name in MODULES]


def test_all_modules_of_kernels_are_named() -> None:
    named = {ROOT / f"{module.replace('.', '/')}.py" for module in MODULES}
    folders = [folder.resolve() for folder in (ROOT / "rcopterx").iterdir() if folder.is_dir()]
    sources = [path for folder in folders for path in folder.rglob("*.py") if path.name != "compiled.py"]
    assert {path for path in sources if "\n@compiled(" in path.read_text(encoding="utf-8")} == named


def test_no_kernel_can_be_compiled_again() -> None:
    kernels = [
        value
        for module in kernel_modules()
        for value in vars(module).values()
        if isinstance(value, Dispatcher)
    ]
    kernels = [kernel for kernel in kernels if not kernel._can_compile]
    assert kernels
    assert all(len(kernel.signatures) == 1 for kernel in kernels)


def test_functions_that_could_be_compiled_in_flight_are_called_by_kernels_only() -> None:
    parts = {
        name
        for module in kernel_modules()
        for name, value in vars(module).items()
        if isinstance(value, Dispatcher) and value._can_compile
    }
    assert parts
    kernels = {ROOT / f"{module.replace('.', '/')}.py" for module in MODULES}
    for path in (path for folder in (ROOT / "rcopterx").iterdir() for path in folder.resolve().rglob("*.py")):
        if path not in kernels:
            names = {word for line in imports_of(path) for word in re.findall(r"\w+", line)}
            assert not names & parts, path


def imports_of(path: Path) -> list[str]:
    """Names that a source imports from modules with kernels."""
    source = path.read_text(encoding="utf-8")
    modules = "|".join(re.escape(f"rcopterx.{module}") for module in MODULES)
    return re.findall(rf"from (?:{modules}) import (\([^)]*\)|.*)", source)


def test_other_types_are_an_error_and_not_compiled() -> None:
    assert weighted(np.ones(2), np.ones((2, 3))) == 6.0
    with pytest.raises(TypeError):
        weighted(np.ones(2, dtype=np.float32), np.ones((2, 3)))
    with pytest.raises(TypeError):
        weighted(np.ones((2, 2)), np.ones((2, 3)))


def test_arrays_from_outside_may_have_any_layout() -> None:
    matrix = np.arange(12.0).reshape(3, 4)
    matrix.flags.writeable = False
    assert weighted(np.ones(4), matrix.T) == weighted(np.ones(3), matrix) == matrix.sum()
    assert weighted(np.ones(2), matrix[::2, 1:3]) == matrix[::2, 1:3].sum()


class Pair(NamedTuple):
    first: np.ndarray
    second: np.ndarray


@compiled(record(Pair, ANY_VECTOR, ANY_VECTOR))
def sum_of(pair: Pair) -> float:
    return float(pair.first.sum() + pair.second.sum())


@compiled(VECTOR)
def sum_of_twice(vector: np.ndarray) -> float:
    return sum_of(Pair(vector, vector[1:]))


def test_arrays_in_records_may_have_any_layout() -> None:
    constant = np.ones(4)
    constant.flags.writeable = False
    assert sum_of(Pair(np.ones(4), constant)) == 8.0
    assert sum_of(Pair(np.ones(4)[::2], constant)) == 6.0
    assert sum_of_twice(np.ones(3)) == 5.0


def test_records_with_other_numbers_or_of_another_kind_are_an_error() -> None:
    with pytest.raises(TypeError):
        sum_of(Pair(np.ones(4), np.ones(4, dtype=np.float32)))
    with pytest.raises(TypeError):
        sum_of((np.ones(4), np.ones(4)))
