"""The decorator of kernels: functions compiled to machine code when their module is imported.

A kernel states the types of its arguments. Calls with other types raise instead of compiling, so that nothing
is compiled while vehicles fly. Arithmetic follows IEEE 754 (no `fastmath`) in the order of the source: a
replay on the same machine is the same bit for bit. Set `NUMBA_DISABLE_JIT=1` to debug kernels as Python.
"""

import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final, ParamSpec, TypeVar

import numba
import numpy as np
from numba import extending, types
from numba.core import event
from numpy.typing import NDArray

from rcopterx.compiling.cache import directory, only_one

Array = NDArray[np.float64]
P = ParamSpec("P")
R = TypeVar("R")

# Any: the annotations of numba differ from version to version.
_numba: Any = numba
_extending: Any = extending
_PACKAGE: Final = Path(__file__).parents[1]
_OPTIONS: Final = {"error_model": "numpy", "no_cfunc_wrapper": True}


VECTOR: Final[Any] = types.float64[::1]
MATRIX: Final[Any] = types.float64[:, ::1]
BLOCKS: Final[Any] = types.float64[:, :, ::1]  # types of contiguous arrays, which loops pass through fastest
ANY_VECTOR: Final[Any] = types.Array(types.float64, 1, "A", readonly=True)
ANY_MATRIX: Final[Any] = types.Array(types.float64, 2, "A", readonly=True)
"""Types of arrays that a kernel only reads, in any memory layout."""
NUMBER: Final[Any] = types.float64
COUNT: Final[Any] = types.int64
FLAG: Final[Any] = types.boolean


def together(*fields: Any) -> Any:
    """Return the type of a tuple with entries of these types."""
    made: Any = types.Tuple
    return made(fields)


class Record(types.NamedTuple):
    """Type of a `NamedTuple` with fields that are converted like arguments: arrays may have any layout."""

    def can_convert_from(self, typing_context: Any, other: Any) -> Any:
        """Return whether a value of another type can be passed; numba calls this."""
        if getattr(other, "instance_class", None) is not self.instance_class:
            return None
        pairs = zip(other, self.types, strict=True)
        convertible = all(typing_context.can_convert(*pair) is not None for pair in pairs)
        return _numba.core.typeconv.Conversion.safe if convertible else None


def _convert_record(context: Any, builder: Any, given: Any, wanted: Any, value: Any) -> Any:
    """Emit code that converts a record field by field."""
    fields = zip(_numba.core.cgutils.unpack_tuple(builder, value), given, wanted, strict=True)
    return context.make_tuple(builder, wanted, [context.cast(builder, *field) for field in fields])


_extending.register_model(Record)(_extending.models.TupleModel)
_extending.lower_cast(types.BaseNamedTuple, Record)(_convert_record)


def record(kind: type, *fields: Any) -> Any:
    """Return the type of a `NamedTuple` whose fields have these types, in their order."""
    made: Any = Record
    return made(fields, kind)


class Announcer(event.Listener):
    """Explains once, on standard error, why the first start takes long."""

    announced = False
    not_kept = ""  # why machine code was not stored

    def on_start(self, event: Any) -> None:  # noqa: ARG002 - the signature is numba's
        """Announce that something is compiled."""
        if not Announcer.announced:
            Announcer.announced = True
            print("rcopterx compiles its kernels for this computer, once ...", file=sys.stderr, flush=True)

    def on_end(self, event: Any) -> None:
        """Do nothing: numba calls this after compiling."""


class KernelLocator(_numba.core.caching.UserProvidedCacheLocator):  # type: ignore[misc]
    """Finds machine code by the place of its source in this package, so that two clones share it."""

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        """Return the directory of a source file in the cache; numba calls this."""
        source = Path(py_file)
        if source.is_relative_to(_PACKAGE):
            return str(source.relative_to(_PACKAGE).parent)
        place: str = super().get_suitable_cache_subpath(py_file)
        return place


_LOCATOR: Final = f"{KernelLocator.__module__}.{KernelLocator.__qualname__}"


def compiled(*arguments: Any) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Compile a function for these types of its arguments, or load its machine code from the cache."""

    def compile_now(function: Callable[P, R]) -> Callable[P, R]:
        path = directory()
        try:
            return _kernel(function, arguments, path)
        except OSError as error:  # the place of the cache has become full, or was never one
            Announcer.not_kept = str(error)
            return _kernel(function, arguments, None)

    return compile_now


def _kernel(function: Callable[P, R], arguments: tuple[Any, ...], path: Path | None) -> Callable[P, R]:
    """Compile a function, or load its machine code from a place."""
    with ExitStack() as stack:
        if path is not None:
            stack.enter_context(only_one(path, function.__module__))
            # Restored afterwards: functions that users compile with numba keep their own cache.
            for option, value in (("CACHE_DIR", str(path)), ("CACHE_LOCATOR_CLASSES", _LOCATOR)):
                stack.callback(setattr, _numba.config, option, getattr(_numba.config, option))
                setattr(_numba.config, option, value)
        stack.enter_context(event.install_listener("numba:compile", Announcer()))
        kernel: Callable[P, R] = _numba.njit([arguments], cache=path is not None, **_OPTIONS)(function)
    return kernel


def part(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function into the kernels that call it."""
    made: Callable[P, R] = _numba.njit(**_OPTIONS)(function)
    return made
