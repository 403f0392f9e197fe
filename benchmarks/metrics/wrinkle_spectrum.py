"""Metrics wrinkles/*: how much of the mean curvature lies in which band of wavelengths.

Eigenvectors of the cotangent Laplacian of the rest shape are its waves,

    K phi_k = lambda_k M phi_k,      wavelength 2 pi / sqrt(lambda_k)                         [m]

with K the stiffness of linear elements and M their areas, a third of each triangle at its corners (Vallet and
Lévy 2008, "Spectral geometry processing with manifold harmonics"). The signed mean curvature H of a frame
(curvature.py, along the vertex normal) has the coefficients c_k = sum_i M_i H_i phi_k(i), and the amplitude
of a band is

    a = sqrt( sum over the band of c_k^2 / sum_i M_i )                                        [1/m]

the root mean square of what the band contributes to H: squares of all bands add up to the mean square of H.
A wave of height h and wavelength w has a = h (2 pi / w)^2 / (2 sqrt 2). H means nothing at a boundary, so
only triangles between interior vertices take part. The shortest band is what the longer ones leave of H: its
waves need no eigenvectors.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from benchmarks.metric import Measurements, Metric
from benchmarks.metrics.curvature import BLOCK_FRAMES, boundary_mask, laplacian_and_areas

if TYPE_CHECKING:
    from benchmarks.metric import RollOut, SceneRollOuts
    from reference_sim.cloth import Cloth

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

LIMITS = (np.inf, 0.4, 0.2, 0.1, 0.0)  # [m] wavelengths between the bands
BANDS = ("over_400", "200_to_400", "100_to_200", "under_100")
WORDS = tuple(band.replace("_", " ") + " mm" for band in BANDS)

WRINKLES_METRICS = (
    *(
        Metric(
            name=f"wrinkles/{band}", unit="1/m", title=f"Waves {interval}", table="wrinkles",
            definition="root mean square of the part of the signed mean curvature with wavelengths "
            f"{interval}, mean over frames",
        )
        for band, interval in zip(BANDS, WORDS)
    ),
    *(
        Metric(
            name=f"wrinkles/error_{band}", unit="1/m", title=f"Error {interval}", table="wrinkle_errors",
            lower_is_better=True,
            definition=f"|a - a_ref|, a that root mean square at the same frame, wavelengths {interval}, "
            "mean over frames; wherever the wrinkles sit",
        )
        for band, interval in zip(BANDS, WORDS)
    ),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return the amplitude of each band [1/m]; empty for a cloth without a triangle inside."""
    amplitudes = roll_out.kept(amplitudes_of)
    if amplitudes is None:
        return {}
    means = amplitudes[roll_out.judged].mean(axis=0)
    return {f"wrinkles/{band}": float(mean) for band, mean in zip(BANDS, means)}


def compare(roll_out: RollOut, reference: RollOut) -> dict[str, float]:
    """Return how far the amplitude of each band is from the reference's [1/m]."""
    ours, theirs = roll_out.kept(amplitudes_of), reference.kept(amplitudes_of)
    if ours is None or theirs is None:
        return {}
    frames = roll_out.judged_beside(reference.positions)
    errors = np.abs(ours[frames] - theirs[frames]).mean(axis=0)
    return {f"wrinkles/error_{band}": float(error) for band, error in zip(BANDS, errors)}


def amplitudes_of(roll_out: RollOut) -> Floats | None:
    """Return the amplitude of each band in each frame of a roll-out, (T,4) [1/m]; None without a basis."""
    waves = roll_out.group.kept(_waves_of)
    return None if waves is None else band_amplitudes(roll_out.positions, roll_out.scene.cloth.faces, waves)


def _waves_of(group: SceneRollOuts) -> Waves | None:
    return waves_of_rest_shape(group.scene.cloth)


@dataclass(frozen=True)
class Waves:
    """Waves of a rest shape that are longer than the shortest band, from long to short.

    Attributes:
        vertices: (N,) those that take part.
        areas: (N,) [m^2], the diagonal of M.
        vectors: (N,K) [1/m], of unit length by M.
        wavelengths: (K,) [m]; infinite for a constant.
    """

    vertices: Indices
    areas: Floats
    vectors: Floats
    wavelengths: Floats


def waves_of_rest_shape(cloth: Cloth) -> Waves | None:
    """Return the waves of a cloth at rest; None where no triangle lies between interior vertices."""
    interior = ~boundary_mask(cloth.faces, cloth.vertex_count)
    inner = interior[cloth.faces].all(axis=1)
    if not inner.any():
        return None
    vertices, places = np.unique(cloth.faces[inner], return_inverse=True)
    corners, count = places.reshape(-1, 3), len(vertices)
    thirds = np.repeat(cloth.areas[inner] / 3, 3)
    areas = np.asarray(np.bincount(corners.ravel(), thirds, count), dtype=np.float64)
    values, vectors = _longest(_stiffness(cloth, inner, corners, count), areas)
    lengths = 2.0 * np.pi / np.sqrt(np.maximum(values, 1e-300))
    return Waves(vertices, areas, vectors, np.where(values < 1e-9 * values[-1], np.inf, lengths))


def _stiffness(cloth: Cloth, inner: NDArray[np.bool_], corners: Indices, count: int):
    """Return K, sparse (N,N) [1]: sum over triangles of area grad phi_i . grad phi_j."""
    from scipy.sparse import coo_array

    last = cloth.Dm_inverse[inner]  # its rows are the gradients of the second and third corner
    gradients = np.concatenate([-last.sum(axis=1, keepdims=True), last], axis=1)  # (F,3,2) [1/m]
    blocks = cloth.areas[inner, None, None] * gradients @ gradients.transpose(0, 2, 1)
    rows, columns = np.repeat(corners, 3, axis=1).ravel(), np.tile(corners, 3).ravel()
    return coo_array((blocks.ravel(), (rows, columns)), shape=(count, count)).tocsc()


def _longest(stiffness, areas: Floats) -> tuple[Floats, Floats]:
    """Return eigenvalues [1/m^2] and eigenvectors of all waves longer than the shortest band."""
    from scipy.linalg import eigh
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import eigsh

    root, limit = np.sqrt(areas), (2.0 * np.pi / LIMITS[-2]) ** 2
    scaled = (diags_array(1.0 / root) @ stiffness @ diags_array(1.0 / root)).tocsc()
    # Weyl's law: so many waves of a surface are longer than a wavelength, and a few more by its boundary.
    count = int(1.2 * np.pi * areas.sum() / LIMITS[-2] ** 2) + 20
    while count < len(areas) // 2:
        start = np.random.default_rng(0).normal(size=len(areas))  # the same in every run
        values, vectors = eigsh(scaled, k=count, sigma=-1.0, which="LM", v0=start)
        if values.max() > limit:
            break
        count *= 2
    else:
        values, vectors = eigh(scaled.toarray(), subset_by_value=(-np.inf, limit))
    order = np.argsort(values)
    order = order[values[order] <= limit]
    return values[order], vectors[:, order] / root[:, None]


def band_amplitudes(positions: Floats, faces: Indices, waves: Waves) -> Floats:
    """Return the amplitude of each band of LIMITS in each frame of positions (T,V,3) [m], (T,4) [1/m]."""
    curvature = np.concatenate([
        signed_curvature(positions[first : first + BLOCK_FRAMES], faces)[:, waves.vertices]
        for first in range(0, len(positions), BLOCK_FRAMES)
    ])  # fmt: skip
    coefficients = (curvature * waves.areas) @ waves.vectors
    bands = [
        (coefficients**2)[:, (waves.wavelengths <= high) & (waves.wavelengths > low)].sum(axis=1)
        for high, low in list(pairwise(LIMITS))[:-1]
    ]
    shorter = (curvature - coefficients @ waves.vectors.T) ** 2 @ waves.areas
    return np.sqrt(np.stack([*bands, shorter], axis=1) / waves.areas.sum())


def signed_curvature(positions: Floats, faces: Indices) -> Floats:
    """Return the mean curvature of each vertex along its normal, (T,V) [1/m]: positive where convex.

    positions: (T,V,3) [m], with outward winding. At a boundary the number means nothing.

    >>> from benchmarks.meshes import icosphere
    >>> x, faces = icosphere(2, 0.5)
    >>> round(float(signed_curvature(x[None], faces).mean()), 2)
    2.0
    """
    from reference_sim.geometry.surface import vertex_normals  # loads numba

    laplacian, area = laplacian_and_areas(positions, faces)
    normals = np.stack([vertex_normals(x, faces) for x in positions])
    along = (laplacian * normals).sum(axis=-1)
    return np.divide(along, 4.0 * area, out=np.zeros(area.shape), where=area > np.finfo(float).tiny)


WRINKLES = Measurements("wrinkles", WRINKLES_METRICS, measure=measure, compare=compare)
