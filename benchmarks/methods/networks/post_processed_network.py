"""Network followed by collision post-processing to 2 mm, as the released models run; both are timed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.method import posed_body
from benchmarks.methods.networks.collision_post_processing import MARGIN, CollisionPostProcessing
from benchmarks.methods.networks.network import Network
from benchmarks.results.run_folder import model_path
from benchmarks.scene import BuiltScene
from reference_sim.trajectory import Trajectory

WARM_UP = 3  # frames cleaned and thrown away, so that the kernels are compiled


class PostProcessedNetwork(Network):
    """Network read from its file, and the body that its garment is pushed out of, posed before run()."""

    def prepare(self, scene: BuiltScene) -> None:
        """Pose the body, compile the post-processing and prepare the network. Not timed."""
        assert scene.dressed is not None and scene.obstacle is not None
        body, garment = scene.dressed.body, scene.dressed.garment
        positions = np.asarray(scene.obstacle.positions)
        self.then = clean = CollisionPostProcessing(
            garment.rest_positions, body.shaped(), body.faces, positions
        )
        for frame in range(min(WARM_UP, len(positions))):
            clean(np.asarray(scene.cloth.rest_positions), frame)
        super().prepare(scene)

    def run(self) -> Trajectory:
        """Roll out, each frame post-processed."""
        cleaned = super().run()
        facts = {"method": f"{self.model.kind}+cleanup", "clean_up_margin_m": MARGIN}
        return replace(cleaned, provenance=cleaned.provenance | facts)

    def inputs(self, scene: BuiltScene) -> Callable[[int], object]:
        """Return a function of the frame that makes features, joint transforms and the posed body."""
        assert scene.dressed is not None
        features, body = super().inputs(scene), posed_body(scene.dressed)
        return lambda frame: (features(frame), body(frame))

    def quasi_static(self) -> Trajectory:
        """Return the network's quasi-static solutions, post-processed as well. Never on the clock."""
        assert self.then is not None
        still = super().quasi_static()
        cleaned = [self.then(x, frame) for frame, x in enumerate(still.positions)]
        return replace(still, positions=np.stack(cleaned))


def make(*, models: Path, seed: int, kind: str) -> PostProcessedNetwork:
    """Make the network of that name and seed with post-processing."""
    return PostProcessedNetwork(model_path(models, kind, seed))
