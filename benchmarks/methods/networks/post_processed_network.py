"""A network followed by the 2 mm collision clean-up, as the released models run; both are on the clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.method import posed_body
from benchmarks.methods.networks.network import Network
from benchmarks.results.run_folder import model_path
from benchmarks.scene import BuiltScene
from reference_sim import Trajectory

WARM_UP = 3  # frames cleaned and thrown away, so that the kernels are compiled


class PostProcessedNetwork(Network):
    """A model read from its file, and the body that its garment is pushed out of, posed before run()."""

    def prepare(self, scene: BuiltScene) -> None:
        from benchmarks.methods.networks.collision_post_processing import CollisionPostProcessing

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
        from benchmarks.methods.networks.collision_post_processing import MARGIN

        cleaned = super().run()
        said = {"method": f"{self.model.kind}+cleanup", "clean_up_margin_m": MARGIN}
        return replace(cleaned, provenance=cleaned.provenance | said)

    def inputs(self, scene: BuiltScene) -> Callable[[int], object]:
        """Features, joint transforms and the posed body."""
        assert scene.dressed is not None
        own, body = super().inputs(scene), posed_body(scene.dressed)
        return lambda frame: (own(frame), body(frame))

    def quasi_static(self) -> Trajectory:
        """What the network holds to be static, cleaned up as well. Never on the clock."""
        assert self.then is not None
        still = super().quasi_static()
        cleaned = [self.then(x, frame) for frame, x in enumerate(still.positions)]
        return replace(still, positions=np.stack(cleaned))


def make(*, models: Path, seed: int, kind: str) -> PostProcessedNetwork:
    """The network of that name and seed, cleaned up after."""
    return PostProcessedNetwork(model_path(models, kind, seed))
