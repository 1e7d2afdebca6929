"""Has numba keep in memory what flying needs, and bring in the rest when a kernel is compiled that needs it.

Every process of a fleet pays for what numba keeps. These are its internals: should a later version do it in
another way, less is saved, and the tests of this module tell.
"""

import importlib
import sys
from collections.abc import Callable
from typing import Any, Final

from llvmlite.binding import parse_bitcode
from numba.core.codegen import JITCodeLibrary
from numba.core.registry import cpu_target

BLAS: Final = "scipy.linalg.cython_blas"
"""What numba calls for products of matrices, and imports again when one is compiled."""
ASKING: Final = "numba.np.arraymath"
"""Module of numba that imports it only to see whether it is there."""


class UnparsedLibrary(JITCodeLibrary):
    """Machine code from the cache, whose source for LLVM is kept as bytes until another kernel calls it.

    numba parses it at once, for callers that are in the cache themselves: 25 MB for ours.
    """

    _bitcode: bytes | None = None

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> Any:
        unserialize: Callable[..., Any] = super()._unserialize
        library = unserialize(codegen, state)
        _, kind, data = state
        if kind == "object":
            library._shared_module, library._bitcode = None, data[1]
        return library

    def _get_module_for_linking(self) -> Any:
        if self._bitcode is not None:
            self._shared_module, self._bitcode = parse_bitcode(self._bitcode), None
        module: Callable[[], Any] = super()._get_module_for_linking
        return module()


def keep_modules_unparsed() -> None:
    """Let what is loaded from now on be an `UnparsedLibrary`."""
    cpu_target.target_context.codegen()._library_class = UnparsedLibrary


def leave_blas_until_needed() -> None:
    """Have numba believe that there is a BLAS, without importing it to see.

    It would bring scipy's linear algebra into each process, 0.2 s and 23 MB in a fleet of three, and our
    matrices are too small for it.
    """
    if BLAS in sys.modules or ASKING in sys.modules:
        return
    # None: importing it is an error, which numba takes for scipy not being installed.
    modules: dict[str, Any] = sys.modules
    modules[BLAS] = None
    try:
        module: Any = importlib.import_module(ASKING)
    finally:
        del modules[BLAS]
    module._HAVE_BLAS = True
