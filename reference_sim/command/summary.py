"""Summary of a simulation in a few lines, for the reader of a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reference_sim.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from reference_sim.obstacle import Obstacle


def summarise(trajectory: Trajectory, obstacle: Obstacle | None, *, frames: int) -> str:
    """Return lines on convergence, energies [J] and depth [mm] at the last frame, and time.

    Args:
        trajectory: of `simulate`.
        obstacle: the body that it met, if any.
        frames: number of frames that was asked for.
    """
    fields = trajectory.frame_fields
    lines = [f"frames     {trajectory.frames} of {frames}"]
    if trajectory.frames > 1:
        converged, worst = int(fields["converged"][1:].sum()), np.nanmax(fields["gradient_norm"])
        lines[0] += f"; {converged} of {frames - 1} steps converged, worst relative residual {worst:.1e}"
    if (relaxed := int(fields["relaxed"].sum())) and trajectory.status == "converged":
        lines.append(
            f"round-off  {relaxed} frames within tolerance up to round-off alone, first {trajectory.reason}"
        )
    if trajectory.status != "converged":
        lines.append(f"worst      {trajectory.status}: {trajectory.reason}")
    if trajectory.frames > 1:
        energies = [f"{name[7:]} {fields[name][-1]:.3g}" for name in fields if name.startswith("energy/")]
        lines.append(f"energies   {', '.join(energies)} J at the last frame")
    if obstacle is not None:
        distance = obstacle.signed_distance(trajectory.positions[-1], trajectory.frames - 1)
        share, depth = (distance < 0).mean(), 1e3 * max(-float(distance.min()), 0.0)
        lines.append(f"obstacle   {share:.2%} of vertices inside, deepest {depth:.1f} mm, at the last frame")
    if trajectory.frames > 1:
        seconds = trajectory.frame_seconds[1:]
        lines.append(f"time       {seconds.sum():.1f} s, {1e3 * np.median(seconds):.0f} ms a frame (median)")
    return "\n".join(lines)
