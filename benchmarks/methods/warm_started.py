"""Solvers that begin each step at the frame of a network or of skinning, then take a few iterations.

The state is carried: x_hat comes from the method's own two previous frames, so that inertia acts. The time
of the network or of skinning is that of run(); posed body, features and joint transforms are ready before.

A network's error changes slowly. So the first guess may be the network's frame and a share of what the
solver added to the last one, turned as skinning turns the vertex.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor

from benchmarks.method import posed_body
from benchmarks.methods.simulation import Simulation
from benchmarks.results.run_folder import model_path
from benchmarks.scene import BuiltScene
from reference_sim.kernels.kernel_cache import njit
from reference_sim.minimise.compiled_lbfgs import CompiledLBFGS
from snug.networks.dressed_body import DressedBody
from snug.networks.roll_out import prepare_frame_inputs, prepare_frames
from snug.networks.trained_model import TrainedModel
from snug.recipe import DEFAULT


class ResidualTransport:
    """Vectors at the vertices of a garment, turned from one frame of a motion to the next.

    Args:
        weights: (V, J) of skinning.
        transforms: (T, J, 3, 4) of the joints, as for `snug.body.skinning.skin`.
    """

    def __init__(self, weights: Tensor, transforms: Tensor) -> None:
        self._weights = weights.numpy()
        self._transforms = transforms.numpy()
        self._last: tuple[int, np.ndarray] = (-1, np.zeros((0, 9)))  # a frame, its blended transforms

    def _blend(self, frame: int) -> np.ndarray:  # linear parts (V, 9)
        linear = self._transforms[frame, :, :, :3].reshape(len(self._transforms[frame]), 9)
        return self._weights @ linear

    def carry(self, residual: np.ndarray, frame: int) -> np.ndarray:
        """Return vectors (V, 3) of frame - 1 as they are in `frame`."""
        before = self._last[1] if self._last[0] == frame - 1 else self._blend(frame - 1)
        after = self._blend(frame)
        self._last = frame, after
        turned = np.empty_like(residual)
        _turn(residual, before, after, turned)
        return turned


@njit(cache=True)
def _turn(vectors: np.ndarray, before: np.ndarray, after: np.ndarray, out: np.ndarray) -> None:
    """Write after before^T v: blends are close to rotations, and their transpose never amplifies."""
    for v in range(len(vectors)):
        for i in range(3):
            out[v, i] = 0.0
        for j in range(3):
            local = 0.0
            for i in range(3):
                local += before[v, 3 * i + j] * vectors[v, i]
            for i in range(3):
                out[v, i] += after[v, 3 * i + j] * local


SKINNING = "skinning"
SHARE = 0.6  # of the last residual


def make_guess(
    start: Callable[[], Iterator[np.ndarray]], carrier: ResidualTransport | None = None
) -> Callable[[int, np.ndarray], np.ndarray]:
    """Return the function of step and x (V, 3) [m] that gives the first guess (V, 3) [m] of a step from x.

    Steps are asked for in turn, from 1, where `start` begins the frames anew. With `carrier`, SHARE of what
    the solver added to the frame before, carried by the skin, is added to each.
    """
    frames: Iterator[np.ndarray]
    frame = np.zeros((0, 3))

    def guess(step: int, x: np.ndarray) -> np.ndarray:
        nonlocal frames, frame
        if step == 1:
            frames = start()
            frame = next(frames)  # frame 0 itself is the scene's start, as for every solver
        before, frame = frame, next(frames)
        return frame if carrier is None else frame + SHARE * carrier.carry(x - before, step)

    return guess


@dataclass(kw_only=True)
class WarmStarted(Simulation):
    """Simulation whose steps start at frames of a network or of skinning and are cut short.

    guess: name of the network, whose file is `path`, or SKINNING. solver: options of the minimiser that
    goes on from there. residual: whether the last frame's residual is carried.
    """

    guess: str
    path: Path
    solver: dict[str, Any]
    residual: bool = False
    of_guess: Callable[[int], object] = field(init=False)

    def prepare(self, scene: BuiltScene) -> None:
        """Prepare frames and solver. Raises ValueError for several steps a frame."""
        if scene.substeps > 1:
            raise ValueError(f"scene {scene.name} has {scene.substeps} steps a frame, starts are of one")
        guess = make_guess(self._frames(scene), self._carry(scene) if self.residual else None)
        self.options = {"guess": guess, **self.solver}
        super().prepare(scene)

    def inputs(self, scene: BuiltScene) -> Callable[[int], object]:
        """Return a function of the frame: inputs of the network or of skinning, and the posed body."""
        assert scene.dressed is not None
        body = posed_body(scene.dressed)
        return lambda frame: (self.of_guess(frame), body(frame))

    def _frames(self, scene: BuiltScene) -> Callable[[], Iterator[np.ndarray]]:
        """Return a function that yields world positions (V, 3) [m], frame after frame, at each call."""
        assert scene.dressed is not None
        motion, betas, before = scene.dressed.motion, scene.dressed.betas, scene.dressed.before
        dressed = DressedBody(scene.dressed.body, scene.dressed.garment)
        model = None if self.guess == SKINNING else TrainedModel.load(self.path)
        self.of_guess = prepare_frame_inputs(model, dressed, motion, betas, earlier=before)
        return prepare_frames(model, dressed, motion, betas, earlier=before)

    def _carry(self, scene: BuiltScene) -> ResidualTransport:
        assert scene.dressed is not None
        dressed = DressedBody(scene.dressed.body, scene.dressed.garment)
        transforms = dressed.transforms(scene.dressed.motion.poses, scene.dressed.betas)
        return ResidualTransport(dressed.weights(DEFAULT.smoothing), transforms)


def make_warm_started(
    *, models: Path, seed: int, guess: str, solver: str, iterations: int
) -> WarmStarted:
    """Make `iterations` of "newton", "lbfgs" or "fast-lbfgs" from the network `guess`, or from "skinning".

    With "fast-lbfgs" the last residual is carried.
    """
    fast = solver == "fast-lbfgs"
    of_solver: dict[str, Any] = {
        "method": CompiledLBFGS if fast else solver,
        "max_iterations": iterations,
    }
    if not fast:
        of_solver |= {"finish": False} if solver == "lbfgs" else {"start_projected": True}
    path = model_path(models, guess, seed)
    return WarmStarted(guess=guess, path=path, solver=of_solver, residual=fast)
