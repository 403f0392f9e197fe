"""A network followed by the 2 mm collision clean-up, as the released models run; both are on the clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from reference_sim import Trajectory

from ..method import Method, posed_body
from ..results import model_path
from ..scene import BuiltScene

WARM_UP = 3  # frames cleaned and thrown away, so that the kernels are compiled


@dataclass
class CleanedNetwork(Method):
    """A model read from its file, and the body that its garment is pushed out of, posed before run()."""

    path: Path

    def prepare(self, scene: BuiltScene) -> None:
        from snug.clean_up import CleanUp
        from snug.dressed_body import DressedBody
        from snug.rollout import predictions
        from snug.trained_model import TrainedModel

        assert scene.dressed is not None and scene.obstacle is not None
        self.model = TrainedModel.load(self.path)
        self.motion, self.betas = scene.dressed.motion, scene.dressed.betas
        body, garment = scene.dressed.body, scene.dressed.garment
        self.dressed = DressedBody(body, garment)
        before = scene.dressed.before
        self.frames = predictions(self.model, self.dressed, self.motion, self.betas, before=before)
        positions = np.asarray(scene.obstacle.positions)
        self.clean = CleanUp(garment.rest_positions, body.shaped(), body.faces, positions)
        for frame in range(min(WARM_UP, self.motion.frames)):
            self.clean(np.asarray(scene.cloth.rest_positions), frame)

    def run(self) -> Trajectory:
        from snug.clean_up import MARGIN
        from snug.rollout import collected

        cleaned = (self.clean(x, frame) for frame, x in enumerate(self.frames()))
        positions, seconds = collected(cleaned, np.arange(self.motion.frames))
        finite = bool(np.isfinite(positions).all())
        return Trajectory(
            positions=positions,
            faces=np.asarray(self.dressed.garment.faces),
            times=np.arange(len(positions)) / self.motion.fps,
            frame_seconds=seconds,
            status="ok" if finite else "diverged",
            reason="" if finite else "the network gave a position that is not finite",
            provenance={"method": f"{self.model.kind}+cleanup", "clean_up_margin_m": MARGIN},
            frame_fields={},
        )

    def inputs(self, scene: BuiltScene) -> Callable[[int], object]:
        """Features, joint transforms and the posed body."""
        from snug.rollout import frame_inputs

        assert scene.dressed is not None
        own = frame_inputs(self.model, self.dressed, self.motion, self.betas, before=scene.dressed.before)
        body = posed_body(scene.dressed)
        return lambda frame: (own(frame), body(frame))

    def quasi_static(self) -> Trajectory:
        """What the network holds to be static, cleaned up as well. Never on the clock."""
        from snug.rollout import roll_out

        still = roll_out(self.model, self.dressed, self.motion, self.betas, quasi_static=True)
        cleaned = [self.clean(x, frame) for frame, x in enumerate(still.positions)]
        return replace(still, positions=np.stack(cleaned))


def make(*, models: Path, seed: int, kind: str) -> CleanedNetwork:
    """The network of that name and seed, cleaned up after."""
    return CleanedNetwork(model_path(models, kind, seed))
