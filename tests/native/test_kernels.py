"""Promises of all kernels: nothing is compiled once they have been imported."""

import importlib
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from rcopterx.compiling.cache import MODULES
from rcopterx.compiling.compiled import ANY_MATRIX, VECTOR, compiled

ROOT = Path(__file__).parents[2]
NO_KERNELS = {"__init__", "__main__", "cache", "compiled", "filtering"}


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
    modules = {path.stem for path in (ROOT / "native").glob("*.py")} - NO_KERNELS
    assert set(MODULES) == {f"native.{name}" for name in modules}


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
    for path in (path for folder in (ROOT / "rcopterx").iterdir() for path in folder.resolve().rglob("*.py")):
        source = path.read_text(encoding="utf-8")
        if "rcopterx.native." in source and path.parent.name != "native":
            imported = {
                name.strip(" (),")
                for block in source.split("from rcopterx.native.")[1:]
                for name in block.split("import", 1)[1].split("from ")[0].split()
            }
            assert not imported & parts, path


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
