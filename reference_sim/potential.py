"""Sum of energies that solvers minimise, networks train on and methods are measured by."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from reference_sim.elimination import nested_dissection
from reference_sim.energies.energy import Energy, Step
from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.lanes import BlockPlaces

# A wider pattern keeps up to this many times the blocks that dynamic terms need at the moment.
SPARE_BLOCKS = 3


class HessianPattern:
    """Pattern of the sum of `energies` over the free vertices, built once per scene.

    Dynamic terms have no blocks in it at first: `widen` gives a wider pattern when they couple
    vertices that no other term couples.

    The matrix is stored as the lower triangle of vertex blocks (diagonal blocks whole), in CSC order, as
    a Cholesky factorisation reads it. Blocks are 3 x 3 for a Hessian, 1 x 1 for a scalar stiffness that
    the coordinates share.

    Attributes:
        free: (n,) indices of the free vertices, in the order of the matrix.
        indptr, indices: CSC structure of the (block n, block n) lower matrix.
        diagonal: places of the diagonal entries in the values.
    """

    def __init__(self, energies: Sequence[Energy], free: np.ndarray, *, block: int = 3) -> None:
        self.block = block
        self.energies = tuple(energies)
        self.free = np.flatnonzero(free)
        number = np.full(len(free), -1, dtype=np.int64)
        number[self.free] = np.arange(len(self.free))
        n = len(self.free)
        of_terms = [_block_keys(number[energy.stencils], n) for energy in energies]
        key = np.unique(np.concatenate([np.arange(n) * (n + 1), *map(np.unique, of_terms)]))
        key = key[key >= 0]  # -1 stands for a pinned vertex or the upper triangle
        self._number = number
        self.slots = [np.where(keys < 0, -1, np.searchsorted(key, keys)) for keys in of_terms]
        self._fixed = self
        self._lay_out(key)

    def _lay_out(self, key: np.ndarray) -> None:
        """Place the blocks of the sorted keys column * n + row one after the other."""
        self._key, block, n = key, self.block, len(self.free)
        column, row = np.divmod(key, n)
        start = np.searchsorted(column, np.arange(n + 1))
        height = np.diff(start)
        within = np.arange(len(key)) - start[column]
        self._base = block**2 * start[column] + block * within
        self._stride = block * height[column]
        self.indptr = np.concatenate([[0], np.cumsum(np.repeat(block * height, block))])
        self.indices = np.empty(block**2 * len(row), dtype=np.int64)
        _fill_rows(start, row, block, self.indices)
        off = row != column
        ones = np.ones(off.sum())
        lower = sp.csr_matrix((ones, (row[off], column[off])), shape=(n, n))
        self._adjacency = (lower + lower.T).tocsr()
        first = start[:-1]  # a diagonal block is the first of its column
        step = self._stride[first][:, None] + 1
        self.diagonal = (self._base[first][:, None] + np.arange(block) * step).ravel()

    def hessians(self, x: np.ndarray, convexity: float = 0.0) -> list[sp.csc_matrix]:
        """Return the Hessians (3V, 3V) of the dynamic terms at x (V, 3)."""
        return [energy.sparse_hessian(x, convexity) for energy in self.energies if energy.dynamic]

    def widen(self, changing: Sequence[sp.csc_matrix]) -> HessianPattern:
        """Return this pattern, or a wider one if the matrices couple vertices that have no block here.

        A wider pattern keeps the blocks it had, so that pairs which come and go do not cost an analysis
        each time, until more than SPARE_BLOCKS times the needed ones are kept.
        """
        if not changing:
            return self
        blocks = np.unique(np.concatenate([self._keys_of(matrix)[0] for matrix in changing]))
        blocks = np.setdiff1d(blocks, self._fixed._key, assume_unique=True)
        if not len(np.setdiff1d(blocks, self._key, assume_unique=True)):
            return self
        spare = np.setdiff1d(self._key, self._fixed._key, assume_unique=True)
        if len(spare) < SPARE_BLOCKS * len(blocks):
            blocks = np.union1d(spare, blocks)
        wider = copy.copy(self._fixed)
        for cached in ("order", "constant"):
            wider.__dict__.pop(cached, None)
        key = np.union1d(self._fixed._key, blocks)
        moved = np.append(np.searchsorted(key, self._fixed._key), -1)  # slot -1, not stored, stays -1
        wider.slots = [moved[slots] for slots in self._fixed.slots]
        wider._lay_out(key)
        return wider

    def _keys_of(self, hessian: sp.csc_matrix) -> tuple[np.ndarray, np.ndarray]:
        """Return keys (m,) of the stored blocks of a (3V, 3V) matrix, sorted, and their values (m, 3, 3)."""
        blocks = hessian.tobsr(blocksize=(3, 3))
        row = self._number[np.repeat(np.arange(len(blocks.indptr) - 1), np.diff(blocks.indptr))]
        column = self._number[blocks.indices]
        stored = np.flatnonzero((row >= column) & (column >= 0))
        key = (column * len(self.free) + row)[stored]
        order = np.argsort(key)
        return key[order], blocks.data[stored[order]]

    @cached_property
    def order(self) -> np.ndarray:
        """(block n,) fill-reducing order of rows and columns."""
        vertices = nested_dissection(self._adjacency)
        return (self.block * vertices[:, None] + np.arange(self.block)).ravel()

    def assemble(
        self, x: np.ndarray, changing: Sequence[sp.csc_matrix] = (), *, convexity: float = 0.0
    ) -> np.ndarray:
        """Return the values (nnz,) [N/m] of the lower matrix: Hessian, or scalar stiffness for block 1.

        changing: Hessians of the dynamic terms at x (V, 3), which this pattern must cover. convexity: see
        Energy.active_hessian_blocks.
        """
        values = self.constant.copy()
        for energy, slots in zip(self.energies, self.slots):
            if not (energy.dynamic or self.block in energy.constant):
                self._add_term(energy, slots, x, convexity, values)
        for matrix in changing:
            self._add(matrix, values)
        return values

    @cached_property
    def constant(self) -> np.ndarray:
        """(nnz,) values of the terms that give the same everywhere."""
        values, anywhere = np.zeros(len(self.indices)), np.zeros((len(self._number), 3))
        for energy, slots in zip(self.energies, self.slots):
            if self.block in energy.constant:
                self._add_term(energy, slots, anywhere, 0.0, values)
        return values

    def _add_term(
        self, energy: Energy, slots: np.ndarray, x: np.ndarray, convexity: float, values: np.ndarray
    ) -> None:
        places = BlockPlaces(slots, self._base, self._stride, self.block)
        if self.block == 3:
            energy.add_hessian(x, convexity, places, values)
        else:
            places.add(*energy.scalar_stiffness(x), values)

    def _add(self, hessian: sp.csc_matrix, values: np.ndarray) -> None:
        key, blocks = self._keys_of(hessian)
        slot = np.searchsorted(self._key, key)
        i, j = np.meshgrid(np.arange(3), np.arange(3), indexing="ij")
        values[self._base[slot][:, None, None] + j * self._stride[slot][:, None, None] + i] += blocks

    def symmetrise(self, values: np.ndarray) -> sp.csc_matrix:
        """Return the whole symmetric (3n, 3n) matrix."""
        lower = sp.tril(sp.csc_matrix((values, self.indices, self.indptr)), format="csc")
        return sp.csc_matrix(lower + sp.tril(lower, -1).T)


def _block_keys(stencils: np.ndarray, n: int) -> np.ndarray:
    """Return (N, k * k) keys column * n + row of each block of each element, -1 where it is not stored."""
    row, column = stencils[:, :, None], stencils[:, None, :]
    key = column * n + row
    key = np.where((row < 0) | (column < 0) | (row < column), -1, key)
    return key.reshape(len(stencils), stencils.shape[1] ** 2)


@njit(cache=True)
def _fill_rows(start, row, block, indices):
    at = 0
    for column in range(start.shape[0] - 1):
        for _ in range(block):
            for p in range(start[column], start[column + 1]):
                for r in range(block):
                    indices[at] = block * row[p] + r
                    at += 1


class Potential:
    """Sum of energies of one cloth: value, gradient and sparse Hessian on a fixed pattern.

    Raises ValueError for no energies, energies of different cloths, or two of the same name.

    Example: the weight of a triangle pulls its corners down.

        >>> import numpy as np
        >>> from reference_sim import Cloth, Potential
        >>> from reference_sim.energies import Gravity, StretchStVK
        >>> x = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]])
        >>> cloth = Cloth(x, np.array([[0, 2, 1]]))
        >>> potential = Potential([StretchStVK(cloth), Gravity(cloth)])
        >>> list(potential.terms(x))
        ['strain', 'gravity']
        >>> potential.gradient(x)[:, 1].round(6).tolist()  # m g / 3 [N]
        [0.003274, 0.003274, 0.003274]
        >>> potential.hessian(x).shape
        (9, 9)
    """

    def __init__(self, energies: Sequence[Energy]) -> None:
        if not energies:
            raise ValueError("a Potential needs at least one energy")
        self.energies = tuple(energies)
        self.cloth = self.energies[0].cloth
        for energy in self.energies:
            if energy.cloth is not self.cloth:
                first = self.energies[0].name
                raise ValueError(
                    f"energies {first!r} and {energy.name!r} are of different cloths: use one"
                )
        names = [energy.name for energy in self.energies]
        for name in names:
            if names.count(name) > 1:  # one would hide the other in tables and files
                raise ValueError(f"two energies are named {name!r}: give each a name of its own")
        self._patterns: dict[tuple[bytes, int], HessianPattern] = {}

    @property
    def time_step(self) -> float | None:
        """Time step dt [s] of the inertia among the terms; None for a static potential."""
        steps = (energy.parameters()["dt_s"] for energy in self.energies if energy.name == "inertia")
        return next(steps, None)

    def prepare(self, step: Step) -> None:
        """Freeze in every term what it needs for one step."""
        for energy in self.energies:
            energy.prepare(step)

    def terms(self, x: np.ndarray) -> dict[str, float]:
        """Return the energy of each term [J] at x (V, 3) [m], by name."""
        x = self.energies[0].check_positions(x)
        return {energy.name: energy.value_and_gradient(x)[0] for energy in self.energies}

    def value(self, x: np.ndarray) -> float:
        """Return the sum [J] at x (V, 3) [m]."""
        return self.value_and_gradient(x)[0]

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Return dPhi/dx (V, 3) [N] at x (V, 3) [m]."""
        return self.value_and_gradient(x)[1]

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return both at once [J], [N]: they share most of their work."""
        x = self.energies[0].check_positions(x)
        total, gradient = 0.0, np.zeros_like(x)
        for energy in self.energies:
            value, part = energy.value_and_gradient(x)
            total += value
            gradient += part
        return total, gradient

    def largest_step(self, x: np.ndarray, direction: np.ndarray) -> float:
        """Return the largest share of `direction` (V, 3) [m] that every term allows from x (V, 3)."""
        return min(energy.largest_step(x, direction) for energy in self.energies)

    def ccd_fraction(self, x: np.ndarray, goal: np.ndarray) -> float:
        """Return the share of the way from x to goal (V, 3) that all terms find free; see `Energy`."""
        return min(energy.ccd_fraction(x, goal) for energy in self.energies)

    def search_again(self) -> None:
        """Let every term forget what it has found near; see `Energy`."""
        for energy in self.energies:
            energy.search_again()

    def predict_stress(self, x: np.ndarray, step: np.ndarray) -> None:
        """Let every term's Hessian use what `step` from x (V, 3) predicts of its stresses; see `Energy`."""
        for energy in self.energies:
            energy.predict_stress(x, step)

    def forget(self) -> None:
        """Go back to the true second derivatives, without predicted stresses."""
        for energy in self.energies:
            energy.forget()

    def infeasibility(self, x: np.ndarray) -> str:
        """Return why x (V, 3) is impossible for the first term that finds something; "" if none does."""
        return next(filter(None, (energy.infeasibility(x) for energy in self.energies)), "")

    def hessian(self, x: np.ndarray) -> sp.csc_matrix:
        """Return second derivatives (3V, 3V) [N/m] at x (V, 3) [m], coordinates of a vertex side by side."""
        x = self.energies[0].check_positions(x)
        pattern = self.pattern(np.ones(self.cloth.vertex_count, dtype=bool))
        changing = pattern.hessians(x)
        pattern = pattern.widen(changing)
        return pattern.symmetrise(pattern.assemble(x, changing))

    def pattern(self, free: np.ndarray, *, block: int = 3) -> HessianPattern:
        """Return the pattern over the free vertices (V,): of the Hessian, or (block=1) scalar stiffness."""
        key = (np.packbits(free).tobytes(), block)
        if key not in self._patterns:
            undefined = Energy.scalar_stiffness
            terms = [e for e in self.energies if block == 3 or type(e).scalar_stiffness is not undefined]
            self._patterns[key] = HessianPattern(terms, free, block=block)
        return self._patterns[key]
