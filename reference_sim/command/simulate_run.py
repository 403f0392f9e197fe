"""One run of `python -m reference_sim.simulate`: read, simulate, write, and say how it went."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from reference_sim.command.simulate_inputs import BadInput, print_note, read_cloth, read_obstacle
from reference_sim.command.simulate_options import DEFAULT_DT, DEFAULT_FRAMES
from reference_sim.command.simulate_terms import check_terms, make_terms
from reference_sim.command.summary import summarise
from reference_sim.files.mesh_files import mesh_paths
from reference_sim.time_loop import simulate
from reference_sim.trajectory.point_cache import write_point_cache
from reference_sim.trajectory.trajectory import TRAJECTORY_SUFFIXES

if TYPE_CHECKING:
    from argparse import Namespace

DONE, NOT_CONVERGED = 0, 1  # exit status
LARGEST_STRETCH = 0.1  # by its own weight, beyond which a unit is probably wrong


def simulate_files(options: Namespace) -> int:
    """Read, simulate and write as the flags say; return the exit status.

    Raises:
        ValueError: bad input, before anything is written; the message names file, element and remedy.
        OSError: a file cannot be read or written.
    """
    _check_paths(options)
    if options.uv_scale and options.rest != "uv":
        raise BadInput(f"--uv-scale {options.uv_scale:g} is for a rest shape from UV: add --rest uv")
    check_terms(options)
    cloth = read_cloth(options)
    obstacle, obstacle_dt = read_obstacle(cloth, options)
    frames = options.frames
    if frames is None:
        frames = obstacle.frames if obstacle is not None and obstacle.frames > 1 else DEFAULT_FRAMES
    dt = options.dt or obstacle_dt or DEFAULT_DT
    if obstacle_dt and abs(dt - obstacle_dt) > 1e-6 * obstacle_dt:
        print_note(f"{options.obstacle} has {obstacle_dt:.4g} s between frames, and --dt is {dt:.4g}")
    length = float(np.ptp(cloth.rest_positions, axis=0).max())
    stretch = cloth.material.self_weight_stretch(length)
    if stretch > LARGEST_STRETCH:
        print_note(
            f"a strip of {length:g} m stretches by about {100 * stretch:.0f} % under its own weight: "
            "check the units of young_modulus [Pa], thickness [m] and density [kg/m^3]"
        )
    if options.resume and not options.output.exists():
        print_note(f"{options.output} does not exist yet: starting at the beginning")
    given = {"method": options.method, "max_iterations": options.max_iterations}
    chosen = {name: value for name, value in given.items() if value is not None}
    trajectory = simulate(
        cloth,
        make_terms(cloth, options),
        dt=dt,
        frames=frames,
        obstacle=obstacle,
        substeps=options.substeps,
        path=options.output,
        resume=options.resume,
        progress=None if options.quiet else options.output.name,
        tolerance=options.tolerance,
        **chosen,
    )
    written = [options.output]
    if options.pc2:
        written += write_point_cache(options.pc2, trajectory)
    if not options.quiet:
        print(summarise(trajectory, obstacle, frames=frames))
        print(
            f"stretch    {stretch:.2%} predicted at the top of {length:.3g} m of this cloth under its weight"
        )
        print(f"wrote      {', '.join(map(str, written))}", flush=True)
    whole = trajectory.frames == frames and trajectory.status == "converged"
    return DONE if whole else NOT_CONVERGED


def _check_paths(options: Namespace) -> None:
    """Refuse what could not be written, or would destroy an input, before any work."""
    if options.output.suffix.lower() not in TRAJECTORY_SUFFIXES:
        raise BadInput(f"{options.output}: the trajectory ends in .vtkhdf")
    if options.output.exists() and not (options.resume or options.overwrite):
        raise BadInput(f"{options.output} exists: add --resume to go on with it, --overwrite to replace it")
    outputs = [options.output]
    if options.pc2:
        if options.pc2.suffix.lower() != ".pc2":
            raise BadInput(f"{options.pc2}: a point cache ends in .pc2")
        outputs += [options.pc2, options.pc2.with_suffix(".obj")]
    inputs = [Path(p).resolve() for p in (options.garment, options.obstacle_rest) if p]
    if options.obstacle:
        inputs += [path.resolve() for path in mesh_paths(options.obstacle)]
    for path in outputs:
        if not path.parent.is_dir():
            raise BadInput(f"{path.parent}: no such folder to write {path.name} in")
        if path.resolve() in inputs:
            raise BadInput(f"{path} would replace an input: choose another name")
        if path != options.output and path.exists() and not (options.resume or options.overwrite):
            raise BadInput(f"{path} exists: add --overwrite to replace it")
