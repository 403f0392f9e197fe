"""What a simulation came to, in a few lines for the reader of a terminal."""

from __future__ import annotations

import numpy as np

from .cloth import Cloth
from .obstacle import Obstacle
from .trajectory import Trajectory


def summary(trajectory: Trajectory, cloth: Cloth, obstacle: Obstacle | None, *, frames: int) -> str:
    """Convergence, energies [J] and depth [mm] at the last frame, predicted stretch, time.

    Args:
        trajectory: of `simulate`.
        frames: how many were asked for.
    """
    fields = trajectory.frame_fields
    converged = int(fields["converged"].sum())
    lines = [f"frames     {converged} of {frames} converged"]
    if trajectory.frames > 1:
        lines[0] += f"; worst gradient {np.nanmax(fields['gradient_norm']):.1e} mean vertex weights"
        energies = [
            f"{name.split('/')[1]} {values[-1]:.3g}"
            for name, values in fields.items()
            if name.startswith("energy/")
        ]
        lines.append(f"energies   {', '.join(energies)} J at the last frame")
    if trajectory.status != "converged":
        lines.append(f"first not  {trajectory.status}: {trajectory.reason}")
    height = float(np.ptp(cloth.rest_positions[:, 1])) or float(np.ptp(cloth.rest_positions, axis=0).max())
    stretch = cloth.material.self_weight_stretch(height)
    lines.append(
        f"stretch    {stretch:.2%} predicted at the top of {height:.3g} m of this cloth under its weight"
    )
    if obstacle is not None:
        distance = obstacle.signed_distance(trajectory.positions[-1], trajectory.frames - 1)
        deepest = 1e3 * max(-float(distance.min()), 0.0)
        lines.append(
            f"obstacle   {(distance < 0).mean():.2%} of vertices inside, deepest {deepest:.1f} mm, last frame"
        )
    if trajectory.frames > 1:
        seconds = trajectory.frame_seconds[1:]
        lines.append(f"time       {seconds.sum():.1f} s, {1e3 * np.median(seconds):.0f} ms a frame (median)")
    return "\n".join(lines)
