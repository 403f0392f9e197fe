"""SNUG as the package has it, trained for the default T-shirt with seed 0."""

from __future__ import annotations

from benchmarks import BuiltScene, Method, MethodEntry
from reference_sim import Trajectory
from snug.networks.dressed_body import DressedBody
from snug.networks.roll_out import roll_out
from snug.networks.trained_model import TrainedModel

METHODS = (
    MethodEntry(
        name="packaged-snug",
        label="SNUG of the package",
        description="the network snug-tshirt of the package",
        role="external",
        needs_body=True,
        gives_first_frame=True,
        dtype="float32",
    ),
)


class PackagedSnug(Method):
    """Roll-out of the packaged network; garment and body are the scene's."""

    def prepare(self, scene: BuiltScene) -> None:
        """Load the network."""
        assert scene.dressed is not None
        self.worn = scene.dressed
        self.dressed = DressedBody(self.worn.body, self.worn.garment)
        self.model = TrainedModel.load("snug-tshirt")

    def run(self) -> Trajectory:
        """Dress every frame of the motion."""
        return roll_out(self.model, self.dressed, self.worn.motion, self.worn.betas)

    def quasi_static(self) -> Trajectory:
        """Hold every pose still: the network's static answer."""
        return roll_out(self.model, self.dressed, self.worn.motion, self.worn.betas, quasi_static=True)


def make(*, models: object, seed: int) -> PackagedSnug:
    """Make the method; it has one seed."""
    return PackagedSnug()
