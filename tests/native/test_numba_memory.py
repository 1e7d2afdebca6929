"""What numba leaves out is there when a kernel needs it, and only then."""

import subprocess
import sys

import pytest

LOADED = "print(sum(name.startswith('scipy.linalg') for name in sys.modules))"


def scipy_modules(program: str) -> int:
    """Modules of scipy's linear algebra that a program has loaded at its end."""
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\n{program}\n{LOADED}"], capture_output=True, text=True, check=True
    )
    return int(done.stdout.splitlines()[-1])


@pytest.mark.parametrize("role", ["agent", "simulator", "transmitters", "tracker", "router"])
def test_no_process_of_a_fleet_loads_a_second_blas(role: str) -> None:
    assert scipy_modules(f"import rcopterx.deploy.roles.{role}, rcopterx.deploy.preloading") == 0


def test_kernels_of_plug_ins_multiply_matrices() -> None:
    program = """
import numpy, numba
import rcopterx.native.compiled

@numba.njit("float64[:, ::1](float64[:, ::1])")
def square(matrix):
    return matrix @ matrix + numpy.cov(matrix)

matrix = numpy.array([[1.0, 2.0], [3.0, 4.0]])
assert numpy.allclose(square(matrix), matrix @ matrix + numpy.cov(matrix))
"""
    assert scipy_modules(program) > 0


def test_who_has_loaded_it_already_keeps_it() -> None:
    assert scipy_modules("import scipy.linalg.cython_blas\nimport rcopterx.native.compiled") > 0


def test_kernels_of_plug_ins_call_ours_that_were_loaded() -> None:
    program = """
import numba, numpy
from rcopterx.native.noise import observe_noise

library, = (made.library for made in observe_noise.overloads.values())
assert library._shared_module is None, "parsed although nobody asked"

@numba.njit("void(float64[::1], float64[::1], float64)")
def observe_twice(memory, values, period_s):
    observe_noise(memory, values, period_s)
    observe_noise(memory, values, period_s)

expected, memory = numpy.zeros(18), numpy.zeros(18)
values = numpy.array([1.0, 2.0, 3.0])
observe_noise(expected, values, 0.02)
observe_noise(expected, values, 0.02)
observe_twice(memory, values, 0.02)
assert memory.tolist() == expected.tolist() and memory.any()
assert library._shared_module is not None
"""
    scipy_modules(program)
