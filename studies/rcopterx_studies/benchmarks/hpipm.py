"""HPIPM of acados in the place of our solver, by the C interface of the wheel `comma-deps-acados`."""

from ctypes import CDLL, RTLD_GLOBAL, byref, c_char, c_double, c_int, c_size_t, c_void_p
from ctypes import Array as CArray
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rcopterx.control.solver.active_set import rolled_out
from rcopterx.control.solver.problem import OptimalControlProblem, Trajectories
from rcopterx.vehicles.state import Array
from rcopterx_studies.benchmarks.peers import PeerSolver

MOST_ITERATIONS: Final = 100
BALANCED: Final = 2  # HPIPM's mode BALANCE


class Hpipm(PeerSolver):
    """The solver; every row is soft with its weight s."""

    package = "acados"

    def __init__(self) -> None:
        super().__init__()
        directory = Path(self._module.LIB_DIR)
        CDLL(str(directory / "libblasfeo.so"), mode=RTLD_GLOBAL)
        self._library = CDLL(str(directory / "libhpipm.so"))
        self._workspace: _Workspace | None = None

    def reset(self) -> None:
        """Start the next solve cold."""
        self._workspace = None

    def _solved(self, p: OptimalControlProblem) -> tuple[Trajectories, int, bool]:
        if self._workspace is None or not self._workspace.fits(p):
            self._workspace = _Workspace(self._library, p, self._tolerance)
        u, iterations, optimal = self._workspace.solve(p)
        return rolled_out(p, u), iterations, optimal


class _Workspace:
    """HPIPM's objects for problems of one shape with the same bounded rows."""

    def __init__(self, library: CDLL, p: OptimalControlProblem, tolerance: float) -> None:
        self._library, self._bounded = library, p.s > 0.0
        N, nx, nu = p.B.shape
        rows = p.W.shape[1]
        self._memory: list[CArray[c_char]] = []
        self._dim = self._made("dim", N)
        for stage in range(N + 1):
            last = stage == N
            sizes = {"nx": nx, "nu": 0 if last else nu, "nbx": 0 if stage else nx}
            sizes |= {"ng": 0 if last else rows, "nsg": 0 if last else rows}
            for field, size in sizes.items():
                library.d_ocp_qp_dim_set(field.encode(), stage, size, self._dim)
        self._qp, self._sol = self._made("", self._dim), self._made("sol", self._dim)
        self._arg = self._made("ipm_arg", self._dim)
        library.d_ocp_qp_ipm_arg_set_default(BALANCED, self._arg)
        for name in ("stat", "eq", "ineq", "comp"):
            library.d_ocp_qp_ipm_arg_set(f"tol_{name}".encode(), byref(c_double(tolerance)), self._arg)
        library.d_ocp_qp_ipm_arg_set(b"iter_max", byref(c_int(MOST_ITERATIONS)), self._arg)
        self._ws = self._made("ipm_ws", self._dim, self._arg)
        mask, self._inputs = self._bounded.astype(float), np.empty((N, nu))
        for stage in range(N):
            for side in ("lg_mask", "ug_mask"):
                library.d_ocp_qp_set(side.encode(), stage, mask[stage].ctypes, self._qp)

    def _made(self, kind: str, *arguments: Any) -> CArray[c_char]:
        """An object of HPIPM, in memory that this workspace keeps."""
        prefix = "_".join(("d_ocp_qp", kind)).rstrip("_")
        for name in ("strsize", "memsize"):
            getattr(self._library, f"{prefix}_{name}").restype = c_size_t
        made: CArray[c_char] = (c_char * getattr(self._library, f"{prefix}_strsize")())()
        memory = (c_char * getattr(self._library, f"{prefix}_memsize")(*arguments))()
        self._memory += [made, memory]
        getattr(self._library, f"{prefix}_create")(*arguments, made, memory)
        return made

    def fits(self, p: OptimalControlProblem) -> bool:
        """Whether a problem has the same shape and the same bounded rows."""
        return self._bounded.shape == p.s.shape and bool(((p.s > 0.0) == self._bounded).all())

    def solve(self, p: OptimalControlProblem) -> tuple[Array, int, bool]:
        """Return inputs, iterations, and whether the tolerance is met."""
        N, nx, _ = p.B.shape
        rows = p.W.shape[1]
        Q = np.concatenate((np.einsum("kri,kr,krj->kij", p.C, p.W, p.C), p.P[None]))
        S, R = (np.einsum("kri,kr,krj->kij", p.D, p.W, right) for right in (p.C, p.D))
        q = np.concatenate((-np.einsum("kri,kr->ki", p.C, p.W * p.r), -(p.P @ p.x_end)[None]))
        r = -np.einsum("kri,kr->ki", p.D, p.W * p.r)
        low, high = (np.where(self._bounded, bound, 0.0) for bound in (p.low, p.high))
        weight, none = np.where(self._bounded, p.s, 1.0), np.zeros((N, rows))
        first, states = p.x_0[None], np.arange(nx, dtype=np.int32)[None]
        soft = np.tile(np.arange(rows, dtype=np.int32), (N, 1))
        soft[0] += nx  # after the bounds that fix the first state
        arrays = (
            *(p.A, p.B, p.c, Q, S, R, q, r, states, first, first, None, None, None),
            *(p.C, p.D, low, high, weight, weight, none, none, soft, none, none),
        )
        self._library.d_ocp_qp_set_all_rowmaj(*(_pointers(array, N + 1) for array in arrays), self._qp)
        self._library.d_ocp_qp_ipm_solve(self._qp, self._sol, self._arg, self._ws)
        iterations, status = c_int(), c_int()
        self._library.d_ocp_qp_ipm_get(b"iter", self._ws, byref(iterations))
        self._library.d_ocp_qp_ipm_get(b"status", self._ws, byref(status))
        for stage in range(N):
            self._library.d_ocp_qp_sol_get_u(stage, self._sol, self._inputs[stage].ctypes)
        return self._inputs.copy(), iterations.value, status.value == 0


def _pointers(array: NDArray[Any] | None, stages: int) -> CArray[c_void_p]:
    """Addresses of an array's entries for every stage; null where there are none."""
    addresses = (c_void_p * stages)()
    if array is not None:
        begin, stride = array.ctypes.data, array.strides[0]
        for stage in range(len(array)):
            addresses[stage] = begin + stage * stride
    return addresses
