"""Backward Euler's own discrete laws: exact for the scheme, whatever the time step."""

from __future__ import annotations

from functools import cache, partial

import numpy as np

import reference_sim as sim
from benchmarks.meshes import in_space, jittered_patch, right_grid
from benchmarks.scene import Scene
from benchmarks.validation.case import known_answer
from benchmarks.validation.equilibrium import (
    COTTON,
    border,
    farthest,
    flat_cloth,
    minimum,
    motion,
    sheet_terms,
)
from reference_sim import energies

DT = 1.0 / 30.0
SPACING = 0.015  # [m] of the sheet that takes one step

FALL = Scene(name="free_fall", description="a thrown sheet")
HANGING = Scene(name="hanging_sheet", description="held at two corners")


@known_answer(unit="m", expected=0.0, tolerance=1e-12, reason="round-off over a fall of 11 m")
def free_fall() -> float:
    """Return the largest distance to backward Euler's own fall, x_0 + n dt v_0 + g dt^2 n (n+1)/2."""
    from benchmarks.scenes import sheets

    scene = sheets.build_free_fall(FALL, sheet_cells=14, sheet_frames=45)
    assert scene.exact is not None
    x = motion(
        scene.cloth, scene.energies, dt=scene.dt, frames=scene.frames, velocity=scene.start_velocity
    )
    return farthest(x, scene.exact)


@known_answer(
    unit="m",
    expected=0.0,
    tolerance=1e-9,
    reason="round-off of the times at which the pins are asked for",
)
def moving_pins_in_substeps() -> float:
    """Return the distance of a sheet pulled by its pins, four steps a frame, to that of a quarter of dt."""
    from benchmarks.scenes import sheets

    scene, steps, frames = sheets.build_hanging_sheet(HANGING, sheet_cells=6, sheet_frames=10), 4, 10
    places = scene.start[scene.cloth.pins]
    pulled = np.array([0.01, 0.02, 0.0]) * np.square(np.arange(frames))[:, None, None] / frames

    def between(step: int) -> np.ndarray:
        frame, part = divmod(step, steps)
        before, after = pulled[frame], pulled[min(frame + 1, frames - 1)]
        return places + before + part / steps * (after - before)

    run = partial(motion, scene.cloth, scene.energies, start=scene.start)
    coarse = run(dt=scene.dt, frames=frames, substeps=steps, pin_positions=lambda n: places + pulled[n])
    fine = run(dt=scene.dt / steps, frames=steps * (frames - 1) + 1, pin_positions=between)
    return farthest(coarse, fine[::steps])


@known_answer(expected=0.0, tolerance=1e-8, reason="the mode's own nonlinearity, (pi amplitude)^2")
def stretched_membrane_vibration() -> float:
    """Return the largest error of a stretched membrane's lowest mode over 30 steps, over its first amplitude.

    The square of 1 m is held at its border. With stretch s, spacing h and lumped masses
    S = (lam + mu)(s^2 - 1), omega^2 = (S/rho_a) (4/h^2) 2 sin^2(pi h/2), and the discrete motion of the
    mode is z_{n+1} = (2 z_n - z_{n-1}) / (1 + omega^2 dt^2).
    """
    amplitude, frames, cells, s = 1e-5, 31, 8, 1.2
    points, faces = right_grid(cells, cells, 1.0, 1.0)
    cloth = flat_cloth(points, faces, held=border(points))
    mode = np.sin(np.pi * points[:, 0]) * np.sin(np.pi * points[:, 1])
    start = s * in_space(points)
    start[:, 2] = amplitude * mode
    S = (COTTON.lame_lambda + COTTON.lame_mu) * (s**2 - 1)
    omega2 = float(S / COTTON.areal_density * 4 * cells**2 * 2 * np.sin(np.pi / (2 * cells)) ** 2)
    x = motion(cloth, [energies.StretchStVK(cloth)], dt=DT, frames=frames, start=start, tolerance=1e-12)
    z = [amplitude, amplitude]  # the frame before the start: no velocity
    for _ in range(frames - 1):
        z.append((2 * z[-1] - z[-2]) / (1 + omega2 * DT**2))
    measured = x[:, :, 2] @ mode / (mode @ mode)
    return float(np.abs(measured - z[1:]).max() / amplitude)


@known_answer(expected=0.0, tolerance=2e-6, reason="the residual gradient that the solver may leave")
def momentum_balance() -> float:
    """Return the largest |P' - P - dt weight| of a crumpled sheet thrown freely, over dt times weight.

    Strain and bending are internal: their forces sum to zero.
    """
    x, cloth = _thrown_sheet()
    velocities = np.diff(x, axis=0) / DT
    momentum = np.einsum("v,tvi->ti", cloth.masses, velocities)
    weight = energies.Gravity(cloth).weights.sum()
    errors = np.diff(momentum, axis=0) - [0.0, -DT * weight, 0.0]
    return float(np.abs(errors).max() / (DT * weight))


@known_answer(expected=0.0, tolerance=2e-6, reason="the residual gradient that the solver may leave")
def angular_momentum_balance() -> float:
    """Return the largest error of L' = L - dt sum m v x v' + dt tau(x'), over the largest |L|.

    Backward Euler loses angular momentum by the second term; strain and bending have no torque.
    """
    x, cloth = _thrown_sheet()
    m = cloth.masses
    v = np.diff(x, axis=0) / DT
    L = np.einsum("v,tvi->ti", m, np.cross(x[1:], v))
    momentum_loss = np.einsum("v,tvi->ti", m, np.cross(v[:-1], v[1:]))
    torque = np.cross(x[2:], [0.0, -1.0, 0.0]) * energies.Gravity(cloth).weights[:, None]
    errors = np.diff(L, axis=0) + DT * momentum_loss - DT * torque.sum(axis=1)
    return float(np.abs(errors).max() / np.abs(L).max())


@cache
def _thrown_sheet() -> tuple[np.ndarray, sim.Cloth]:
    cloth = flat_cloth(*jittered_patch(6), size=0.3)
    random = np.random.default_rng(2)
    start = cloth.rest_positions + random.normal(0, 0.004, cloth.rest_positions.shape)
    velocity = random.normal(0, 0.5, start.shape)
    return motion(cloth, sheet_terms(cloth), dt=DT, frames=12, start=start, velocity=velocity), cloth


@known_answer(unit="m", expected=0.0, tolerance=1e-12, reason="one minimiser; Newton ends at round-off")
def unique_step() -> float:
    """Return the largest distance of the ends of one step, thrown into disorder, from two far guesses.

    The membrane's Hessian is never below -(lambda + mu) times the cotangent Laplacian, so a step shorter
    than h (rho_a / (8 (lambda + mu)))^0.5 on right triangles of spacing h has one minimiser and no other.
    """
    bound = SPACING * np.sqrt(COTTON.areal_density / 8 / (COTTON.lame_lambda + COTTON.lame_mu))
    cells = 12
    size = SPACING * cells
    cloth = flat_cloth(*right_grid(cells, cells, size, size))
    inertia, rest = energies.Inertia(cloth, 0.9 * bound), cloth.rest_positions
    random = np.random.default_rng(5)
    inertia.x_hat = rest + random.normal(0, 0.3 * SPACING, rest.shape)
    starts = (random.uniform(-size, size, rest.shape) for _ in range(2))
    return farthest(
        *(minimum([energies.StretchStVK(cloth), inertia], x, tolerance=1e-12) for x in starts)
    )


@known_answer(expected=0.0, tolerance=1e-9, reason="backward Euler only ever loses energy; round-off")
def energy_inequality() -> float:
    """Return the largest excess of Phi' + |v' - v|_M^2/2 over Phi + |v|_M^2/2, over the kinetic energy.

    Both sides are the step's objective, at its end and at the previous positions: a step that ends above
    the place it came from is wrong. Measured on the hanging sheet.
    """
    from benchmarks.scenes import sheets

    scene = sheets.build_hanging_sheet(HANGING, sheet_cells=6, sheet_frames=10)
    x = motion(scene.cloth, scene.energies, dt=scene.dt, frames=20, start=scene.start)
    masses = scene.cloth.masses
    potential = sim.Potential(scene.energies)
    phi = np.array([potential.value(frame) for frame in x])
    v = np.concatenate([np.zeros_like(x[:1]), np.diff(x, axis=0) / scene.dt])
    kinetic = 0.5 * np.einsum("v,tvi,tvi->t", masses, v, v)
    change = np.diff(v, axis=0)
    energy_loss = 0.5 * np.einsum("v,tvi,tvi->t", masses, change, change)
    rise = phi[1:] + energy_loss - phi[:-1] - kinetic[:-1]
    return float(np.maximum(rise, 0.0).max() / kinetic.max())
