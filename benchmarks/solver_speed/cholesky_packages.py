"""Sparse Cholesky packages behind the three calls of reference_sim.linear_solver, for comparison alone.

Each adapter takes the lower pattern of our Hessian, keeps whatever symbolic work its package lets one keep,
and answers False where a matrix is not positive definite. A package that is not installed raises ImportError
from its constructor.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import scipy.sparse as sp

from reference_sim.linear_solver import CholmodSolver, LinearSolver, SuperLUSolver, nested_dissection

Build = Callable[[np.ndarray, np.ndarray], LinearSolver]  # (indptr, indices) -> analysed solver


class Layout:
    """Our stored lower triangle as another sorted CSC matrix: part "lower", "upper" or "both"."""

    def __init__(self, indptr: np.ndarray, indices: np.ndarray, part: str) -> None:
        size = len(indptr) - 1
        place = np.arange(1.0, len(indices) + 1)  # carried through the shuffle as values; 0 would be dropped
        lower = sp.tril(sp.csc_matrix((place, indices, indptr), shape=(size, size)), format="csc")
        halves = {"lower": lower, "upper": lower.T, "both": lower + sp.tril(lower, -1).T}
        matrix = sp.csc_matrix(halves[part])
        matrix.sort_indices()
        self.indptr, self.indices = matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32)
        self._take = matrix.data.astype(np.int64) - 1
        self.shape = (size, size)

    def values(self, data: np.ndarray) -> np.ndarray:
        """Our values (nnz,) in this order."""
        return data[self._take]

    def matrix(self, data: np.ndarray) -> sp.csc_matrix:
        """Our values (nnz,) as a scipy matrix that shares this pattern."""
        return sp.csc_matrix((self.values(data), self.indices, self.indptr), shape=self.shape)


@cache
def _pardiso() -> Any:
    """Finding MKL takes pypardiso longer than an analysis, and needs doing once."""
    from pypardiso import PyPardisoSolver

    return PyPardisoSolver(mtype=2)


class PardisoSolver:
    """MKL's PARDISO through pypardiso in its positive definite mode (mtype 2)."""

    def __init__(self, indptr: np.ndarray, indices: np.ndarray) -> None:
        self._solver = copy.copy(_pardiso())
        self._solver.pt = np.zeros_like(self._solver.pt)
        self._layout = Layout(indptr, indices, "lower")
        self._A = self._upper_rows(np.ones(len(indices)))
        self._phase(11, np.zeros(len(indptr) - 1))

    def _upper_rows(self, data: np.ndarray) -> sp.csr_matrix:
        """PARDISO reads the rows of the upper triangle: the columns of the lower one."""
        layout = self._layout
        return sp.csr_matrix((layout.values(data), layout.indices, layout.indptr), shape=layout.shape)

    def _phase(self, phase: int, b: np.ndarray) -> np.ndarray:
        self._solver.set_phase(phase)
        return np.asarray(self._solver._call_pardiso(self._A, b))

    def factorise(self, data: np.ndarray) -> bool:
        from pypardiso.pardiso_wrapper import PyPardisoError

        self._A = self._upper_rows(data)
        try:
            self._phase(22, np.zeros(self._A.shape[0]))
        except PyPardisoError:
            return False
        return True

    def solve(self, b: np.ndarray) -> np.ndarray:
        return self._phase(33, b)

    def __del__(self) -> None:
        if hasattr(self, "_A"):
            self._phase(-1, np.zeros(self._A.shape[0]))  # MKL's own memory


class PolysolveSolver:
    """A direct solver of polyfem-polysolve by name, and the half of the matrix that it reads."""

    def __init__(self, indptr: np.ndarray, indices: np.ndarray, name: str, half: str) -> None:
        import polysolve

        self._layout = Layout(indptr, indices, half)
        self._solver = polysolve.LinearSolver({"solver": name}, polysolve.LogLevel.off)
        self._solver.analyze_pattern(self._layout.matrix(np.ones(len(indices))))

    def factorise(self, data: np.ndarray) -> bool:
        try:
            self._solver.factorize(self._layout.matrix(data))
        except RuntimeError:
            return False
        return True

    def solve(self, b: np.ndarray) -> np.ndarray:
        return np.asarray(self._solver.solve(b))


class QdldlSolver:
    """QDLDL: an LDL^T that goes through for indefinite matrices, so the signs of D have to be asked for."""

    def __init__(self, indptr: np.ndarray, indices: np.ndarray) -> None:
        from qdldl import Solver

        self._layout = Layout(indptr, indices, "upper")
        size = self._layout.shape[0]
        # The constructor factorises at once: a dominant diagonal always goes through.
        columns = np.repeat(np.arange(size), np.diff(indptr))
        self._solver = Solver(self._layout.matrix(np.where(indices == columns, 1e3, 1.0)), upper=True)

    def factorise(self, data: np.ndarray) -> bool:
        try:
            self._solver.update(self._layout.matrix(data), upper=True)
        except RuntimeError:  # a zero pivot
            return False
        return bool((self._solver.factors()[1] > 0).all())

    def solve(self, b: np.ndarray) -> np.ndarray:
        return np.asarray(self._solver.solve(b))


class CholespySolver:
    """cholespy (CHOLMOD, simplicial): its constructor orders, analyses and factorises, every time anew."""

    def __init__(self, indptr: np.ndarray, indices: np.ndarray) -> None:
        import cholespy

        self._package = cholespy
        self._layout = Layout(indptr, indices, "both")

    def factorise(self, data: np.ndarray) -> bool:
        layout = self._layout
        try:
            self._solver = self._package.CholeskySolverD(
                layout.shape[0],
                layout.indptr,
                layout.indices,
                layout.values(data),
                self._package.MatrixType.CSC,
            )
        except ValueError:
            return False
        return True

    def solve(self, b: np.ndarray) -> np.ndarray:
        x = np.zeros_like(b)
        self._solver.solve(b, x)
        return x


def metis(indptr: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Nested dissection of the vertex graph: the 3 x 3 blocks stay together, as in HessianPattern.order."""
    columns = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr)) // 3
    rows = indices // 3
    off = rows != columns
    n = (len(indptr) - 1) // 3
    graph = sp.csr_matrix((np.ones(off.sum()), (rows[off], columns[off])), shape=(n, n))
    vertices = nested_dissection(sp.csr_matrix(graph + graph.T))
    return (3 * vertices[:, None] + np.arange(3)).ravel()


def amd(indptr: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Approximate minimum degree of the scalar matrix, by cvxopt."""
    from cvxopt import amd as package
    from cvxopt import matrix, spmatrix

    size = len(indptr) - 1
    columns = np.repeat(np.arange(size), np.diff(indptr))
    A = spmatrix(1.0, matrix(indices), matrix(columns), (size, size))
    return np.array(package.order(A, uplo="L")).ravel()


# Name -> (what to install, constructor). The first two are what reference_sim uses.
PACKAGES: dict[str, tuple[str, Build]] = {
    "CHOLMOD, METIS": ("cvxopt pymetis", lambda p, i: CholmodSolver(p, i, metis(p, i))),
    "SuperLU, METIS": ("scipy", lambda p, i: SuperLUSolver(p, i, metis(p, i))),
    "CHOLMOD, AMD": ("cvxopt", lambda p, i: CholmodSolver(p, i, amd(p, i))),
    "pypardiso": ("pypardiso", PardisoSolver),
    "polysolve PardisoLLT": (
        "polyfem-polysolve",
        lambda p, i: PolysolveSolver(p, i, "Eigen::PardisoLLT", "upper"),
    ),
    "polysolve CHOLMOD": (
        "polyfem-polysolve",
        lambda p, i: PolysolveSolver(p, i, "Eigen::CholmodSupernodalLLT", "lower"),
    ),
    "qdldl": ("qdldl", QdldlSolver),
    "cholespy": ("cholespy", CholespySolver),
}
