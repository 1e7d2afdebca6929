"""The decorator of kernels: compiled to machine code when their module is imported, and never later.

A kernel states the types of its arguments. Others are an error instead of a compilation, so that nothing is
compiled while vehicles fly. Arithmetic is that of the standard (no `fastmath`), in the order in which it is
written: a replay on the same machine is the same bit for bit. With `NUMBA_DISABLE_JIT=1` kernels are plain
Python, for debuggers.
"""

import sys
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any, Final, ParamSpec, TypeVar

import numba
import numpy as np
from numba.core import event
from numpy.typing import NDArray

from rcopterx.compiling.cache import directory, only_one

Array = NDArray[np.float64]
P = ParamSpec("P")
R = TypeVar("R")

# Typed loosely: what numba declares differs from version to version.
_njit: Any = numba.njit
_config: Any = numba.config
_OPTIONS: Final = {"error_model": "numpy", "no_cfunc_wrapper": True}


def read(dimensions: int, number: str = "float64") -> str:
    """Type of an array that a kernel only reads, whatever its layout is."""
    return f"Array({number}, {dimensions}, 'A', readonly=True)"


VECTOR: Final = "float64[::1]"
MATRIX: Final = "float64[:, ::1]"
BLOCKS: Final = "float64[:, :, ::1]"
"""Types of arrays in one piece, which loops pass through fastest."""
ANY_VECTOR: Final = read(1)
ANY_MATRIX: Final = read(2)
ANY_BLOCKS: Final = read(3)
NUMBER: Final = "float64"
COUNT: Final = "int64"
FLAG: Final = "boolean"
ESTIMATE: Final = 7 * (ANY_VECTOR,)
"""Motion, actuators, disturbance; core, servo, wind and trim of the tilt model, empty without one."""
TARGET: Final = MATRIX, VECTOR, MATRIX, MATRIX
"""Reference, last state, and lower and upper bounds of a problem of the cascade."""


def together(*types: str) -> str:
    """Type of a tuple with entries of these types, for arguments that kernels pass on as they are."""
    return f"Tuple(({', '.join(types)},))"


class Announcer(event.Listener):
    """Tells people once why the first start takes long."""

    told = False

    def on_start(self, event: Any) -> None:  # noqa: ARG002 - the signature is numba's
        """Something is compiled."""
        if not Announcer.told:
            Announcer.told = True
            print("rcopterx compiles its kernels for this computer, once ...", file=sys.stderr, flush=True)

    def on_end(self, event: Any) -> None:
        """It has been compiled."""


def compiled(*arguments: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Make a function a kernel.

    Parameters
    ----------
    arguments
        Numba types of its arguments, one each, or several separated by commas.
    """

    def compile_now(function: Callable[P, R]) -> Callable[P, R]:
        path = directory()
        with ExitStack() as stack:
            if path is not None:
                stack.enter_context(only_one(path, function.__module__))
                # For kernels only: what users of numba compile themselves is kept where they want it.
                stack.callback(setattr, _config, "CACHE_DIR", _config.CACHE_DIR)
                _config.CACHE_DIR = str(path)
            stack.enter_context(event.install_listener("numba:compile", Announcer()))
            kernel: Callable[P, R] = _njit(f"({', '.join(arguments)},)", cache=path is not None, **_OPTIONS)(
                function
            )
        return kernel

    return compile_now


def part(function: Callable[P, R]) -> Callable[P, R]:
    """Make a function callable by kernels, of whose machine code it becomes a part."""
    made: Callable[P, R] = _njit(**_OPTIONS)(function)
    return made
