"""Methods that need a body: trained networks, collision post-processing, skinning.

Collision post-processing pushes vertices below or within 2 mm of the skin out to 2 mm,

    x' = x + max(2 mm - n.(x - c), 0) n      c: closest body point that x may touch, n: the skin's normal

The released SNUG models and Santesteban 2019 end with such a step. Here it is a method of its own, and is
timed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from benchmarks.method import Method, posed_body
from benchmarks.results.run_folder import model_path
from benchmarks.scene import BuiltScene
from reference_sim.geometry.surface import vertex_normals
from reference_sim.trajectory import Trajectory
from snug.networks.dressed_body import DressedBody
from snug.networks.roll_out import prepare_batch, prepare_frame_inputs, prepare_roll_out, roll_out
from snug.networks.trained_model import TrainedModel
from snug.training.contact_cache import Patch

MARGIN = 2e-3  # [m]
WARM_UP = 3  # frames cleaned and thrown away, so that the kernels are compiled


class CollisionPostProcessing:
    """Push-out of a garment from a body that moves in a known way.

    Args:
        dressed: garment and body at rest, which say what may touch what.
        body_positions: (T, B, 3) [m] of each frame; any origin shared with the garment.

    Raises:
        ValueError: garment and body are nowhere near each other.
    """

    def __init__(self, dressed: DressedBody, body_positions: np.ndarray) -> None:
        garment, body = dressed.garment, dressed.body
        self.patch = Patch(garment.rest_positions, body.rest_vertices(), body.faces)
        self.body = body_positions[:, self.patch.body_vertices].astype(np.float32)
        self._faces: np.ndarray | None = None  # found last, where the next search begins

    def __call__(self, x: np.ndarray, frame: int) -> np.ndarray:
        """Return vertices (V, 3) [m] of a frame, pushed out where need be; `x` is left as it is."""
        patch, skin = self.patch, self.body[frame]
        patch.tree.refit(skin)
        # Exact at any depth, unlike the anchors of training: what lies deep must find the near way out.
        nearest = patch.tree.nearest(x, hints=self._faces, samples=patch.samples)
        self._faces = nearest.faces
        corners = vertex_normals(skin, patch.faces)[patch.faces[nearest.faces]]
        normals = np.einsum("va,vai->vi", nearest.barycentric, corners)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-30
        lack = MARGIN - np.einsum("vi,vi->v", normals, x - nearest.points)
        return x + np.maximum(lack, 0.0)[:, None] * normals


@dataclass
class Network(Method):
    """Network read from its file; without one skinning, smoothed as by the default recipe.

    Features and joint transforms are made and the network is warmed up before run(). cleanup: whether
    each frame is post-processed; the body is then posed before run() too.
    """

    path: Path | str | None = None  # or its name in the package
    cleanup: bool = False
    clean: CollisionPostProcessing | None = field(default=None, init=False)

    def prepare(self, scene: BuiltScene) -> None:
        """Read the model, make the features and warm up. Not timed."""
        assert scene.dressed is not None
        self.model = TrainedModel.load(self.path) if self.path else None
        self.motion, self.betas = scene.dressed.motion, scene.dressed.betas
        self.dressed = DressedBody(scene.dressed.body, scene.dressed.garment)
        if self.cleanup:
            assert scene.obstacle is not None
            positions = np.asarray(scene.obstacle.positions)
            self.clean = CollisionPostProcessing(self.dressed, positions)
            for frame in range(min(WARM_UP, len(positions))):
                self.clean(np.asarray(scene.cloth.rest_positions), frame)
        self.frames = prepare_roll_out(
            self.model, self.dressed, self.motion, self.betas, kept=scene.kept,
            earlier=scene.dressed.before, postprocess=self.clean,
        )  # fmt: skip

    def run(self) -> Trajectory:
        """Roll out all frames."""
        rolled = self.frames()
        if not (self.clean and self.model):
            return rolled
        facts = {"method": f"{self.model.kind}+cleanup", "clean_up_margin_m": MARGIN}
        return replace(rolled, provenance=rolled.provenance | facts)

    def inputs(self, scene: BuiltScene) -> Callable[[int], object]:
        """Return a function of the frame: features, joint transforms, and the body to clean by."""
        assert scene.dressed is not None
        features = prepare_frame_inputs(
            self.model, self.dressed, self.motion, self.betas, earlier=scene.dressed.before
        )
        if not self.clean:
            return features
        body = posed_body(scene.dressed)
        return lambda frame: (features(frame), body(frame))

    def batch(self, copies: int) -> Callable[[], np.ndarray]:
        """Return a function that computes `copies` bodies in this motion at once, (T, copies, V, 3) [m]."""
        assert self.model is not None
        return prepare_batch(self.model, self.dressed, self.motion, copies=copies)

    def quasi_static(self) -> Trajectory:
        """Return the quasi-static solutions: each pose kept until nothing moves. Never on the clock.

        Skinning has no dynamics: they are its roll-out.
        """
        if self.model is None:
            return self.run()
        solution = roll_out(self.model, self.dressed, self.motion, self.betas, quasi_static=True)
        if not self.clean:
            return solution
        cleaned = [self.clean(x, frame) for frame, x in enumerate(solution.positions)]
        return replace(solution, positions=np.stack(cleaned))


def make_network(
    *, models: Path, seed: int, kind: str, cleanup: bool = False, packaged: str = ""
) -> Network:
    """Make the network of that name and seed, or the one of that name in the package."""
    return Network(packaged or model_path(models, kind, seed), cleanup)


def make_skinning(*, models: Path, seed: int) -> Network:
    """Make skinning alone, without seed and model: what it lacks is what a network adds."""
    return Network()
