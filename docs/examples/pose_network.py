"""Two layers from the pose to offsets of the unposed garment, then skinning."""

from pathlib import Path

import numpy as np
import torch

from benchmarks import BuiltScene, Method, MethodEntry
from reference_sim import Trajectory

METHODS = (
    MethodEntry(
        name="pose-network",
        description="offsets from the pose, skinned",
        role="network",
        seeded=True,
        needs_body=True,
        gives_first_frame=True,
        dtype="float32",
        files=("pose_network-0.pt",),
    ),
)


def network(vertices: int) -> torch.nn.Module:
    """Return the network: a pose of 24 axis-angle rotations to offsets of all vertices."""
    layers = torch.nn.Linear(72, 32), torch.nn.ReLU(), torch.nn.Linear(32, 3 * vertices)
    return torch.nn.Sequential(*layers)


class PoseNetwork(Method):
    """Garment whose unposed shape follows from the pose."""

    def __init__(self, seed: int) -> None:
        self.weights = Path(__file__).with_name(f"pose_network-{seed}.pt")

    def prepare(self, scene: BuiltScene) -> None:
        """Load the weights for a dressed body."""
        from snug import DressedBody

        self.worn, self.faces = scene.dressed, scene.cloth.faces
        self.dressed = DressedBody(self.worn.body, self.worn.garment)
        self.network = network(scene.cloth.vertex_count)
        self.network.load_state_dict(torch.load(self.weights))

    @torch.inference_mode()
    def run(self) -> Trajectory:
        """Compute each frame from its pose alone."""
        motion = self.worn.motion
        poses = torch.from_numpy(motion.poses.reshape(-1, 72)).float()
        offsets = torch.stack([self.network(pose) for pose in poses]).reshape(len(poses), -1, 3)
        positions = self.dressed.skin(motion, self.worn.betas, offsets=offsets)
        return Trajectory(positions, self.faces, np.arange(len(positions)) / motion.fps)


def make(*, models: object, seed: int) -> PoseNetwork:
    """Return a fresh method of that seed."""
    return PoseNetwork(seed)
