"""Training of pose_network.py by the energies of the simulator: any torch module, no simulated data."""

import numpy as np
import torch
from pose_network import network

from reference_sim import Obstacle, Potential
from reference_sim.energies import BendHinge, ContactPenalty, Gravity, Step, StretchStVK
from snug import Body, DressedBody, Motion, find_template, make_motion, skin

FRAMES = 8  # of an update


class MeanEnergy(torch.autograd.Function):
    """Mean energy [J] of garments x (N, V, 3) [m] in frames of a motion, with the simulator's gradient."""

    @staticmethod
    def forward(ctx, x, potential: Potential, obstacle: Obstacle, frames: np.ndarray) -> torch.Tensor:
        """Evaluate energy and gradient of each garment, on contact planes searched where it is."""
        values, gradients = [], []
        for vertices, frame in zip(x.detach().double().numpy(), frames):
            still = np.zeros_like(vertices)
            potential.prepare(Step(vertices, still, vertices, 1 / 30, obstacle, frame))
            value, gradient = potential.value_and_gradient(vertices)
            values.append(value)
            gradients.append(gradient / len(frames))
        ctx.gradient = torch.from_numpy(np.stack(gradients)).to(x)
        return x.new_tensor(np.mean(values))

    @staticmethod
    def backward(ctx, above: torch.Tensor):
        """Return the gradient by x; nothing else has one."""
        return above * ctx.gradient, None, None, None


def train(
    dressed: DressedBody, motion: Motion, *, steps: int, seed: int
) -> tuple[torch.nn.Module, list[float]]:
    """Return the trained network and the mean energy [J] of each update."""
    torch.manual_seed(seed)
    random = np.random.default_rng(seed)
    cloth = dressed.garment.cloth()
    potential = Potential([StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), ContactPenalty(cloth)])
    body = dressed.body.vertices(motion.poses, motion.translations)
    obstacle = Obstacle(body, dressed.body.faces, rest_positions=dressed.body.template)
    poses = torch.from_numpy(motion.poses.reshape(-1, 72)).float()
    transforms, pelvis = (
        dressed.transforms(motion.poses),
        torch.from_numpy(dressed.pelvis(motion)).float(),
    )
    module = network(dressed.vertices)
    torch.nn.init.zeros_(module[2].weight)
    torch.nn.init.zeros_(module[2].bias)  # begins as skinning alone
    optimiser, energies = torch.optim.Adam(module.parameters(), lr=1e-3), []
    for _ in range(steps):
        frames = random.choice(motion.frames, FRAMES, replace=False)
        unposed = dressed.rest() + module(poses[frames]).reshape(FRAMES, -1, 3)
        x = skin(unposed, dressed.weights(0), transforms[frames]) + pelvis[frames, None]
        energy = MeanEnergy.apply(x, potential, obstacle, frames)
        optimiser.zero_grad()
        energy.backward()
        optimiser.step()
        energies.append(energy.item())
    return module, energies


if __name__ == "__main__":
    body = Body.load()
    shirt = find_template("tshirt").tailor(body, vertices=350)  # as preset smoke has it
    dressed = DressedBody(body, shirt)
    trained, energies = train(dressed, make_motion("05_01"), steps=60, seed=0)
    print(
        f"mean energy of an update: {energies[0]:.3f} J at first, {np.mean(energies[-10:]):.3f} J at last"
    )
    torch.save(trained.state_dict(), "pose_network-0.pt")
