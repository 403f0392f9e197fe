"""Physics loss: the energies that the simulator minimises, summed without weights (paper, eq. 5 to 7).

For a sub-sequence of frames 1..T with vertices x_1..x_T the loss is

    sum_t [strain(x_t) + bending(x_t) + gravity(x_t) + collision(x_t)] / T
        + sum_{t >= 3} inertia(x_t) / (T - 2)

in joules a frame: the mean of each term over the frames that have it. A frame has inertia where two
frames before it are in the window; its gradient reaches all three. So the terms of a frame weigh as in
equation 5, however long the window is. The recipe names two other forms of inertia (Recipe.inertia_form).

Each energy is one torch expression in `reference_sim.energies`, the definition, which torch compiles on a
GPU. On a CPU closed-form kernels ("training_batch" of a term, or its gradient) give the same numbers.
The contact planes alone differ: training keeps an anchor for each sample, with the skin's normal, where
the simulator searches the closest point anew in every step.

The material of PBNS itself (Bertiche et al. 2021), springs, hinges, uniform mass, squared contact::

    edges    15 (l - l0)^2                  [J]  reference_sim's StretchSpring, exactly
    bending  5e-5 |n0 - n1|^2               [J]  reference_sim's BendHinge, 5e-5 theta^2, the nearest
    gravity  m g y, m = 0.3 kg/m^2 A / V    [J]  the same mass for every vertex
    contact  25 max(4 mm - n.(x - c), 0)^2  [J]  on vertices, with the contact planes of all our training

`|n0 - n1|^2 = 4 sin^2(theta/2) = theta^2 - theta^4/12 + ...`: the hinge has 3 % more at 0.6 rad, and goes
on growing where a folded edge no longer resists. Constants as in the authors' own training.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
import torch
from torch import Tensor

from reference_sim.cloth import Cloth
from reference_sim.energies import (
    BendHinge,
    ContactPenalty,
    Energy,
    Gravity,
    Inertia,
    StretchSpring,
    StretchStVK,
)
from reference_sim.energies.inertia import batch_of_windows
from reference_sim.kernels.fast_kernels import (
    LANES,
    BatchKernel,
    fast_kernel,
    has_kernel,
    warn_slow_path,
)
from reference_sim.material import GRAVITY
from snug.kernels.skinning import from_lanes, to_lanes
from snug.recipe import TERMS, Recipe, find_energy
from snug.training.device import CPU, compile_for

BENDING = 5e-5  # [J]
AREAL_DENSITY = 0.3  # [kg/m^2]
CONTACT_STIFFNESS = 25.0  # [J/m^2] on each vertex
MARGIN = 4e-3  # [m]


def spring_terms(cloth: Cloth) -> tuple[Energy, Energy, Energy]:
    """Return membrane, bending and gravity of PBNS for the rest state of `cloth`, whatever its material."""
    hinges, gravity = BendHinge(cloth, scaling="none"), Gravity(cloth)
    hinges.stiffness = np.full(len(hinges.stencils), 2 * BENDING)
    uniform = AREAL_DENSITY * cloth.areas.sum() / cloth.vertex_count
    gravity.weights = np.full(cloth.vertex_count, uniform * GRAVITY)
    return StretchSpring(cloth), hinges, gravity


class SquaredContact(ContactPenalty):
    """Contact energy k max(eps - d, 0)^2 [J] of each vertex, with the planes and samples of ContactPenalty.

    For training alone: its derivatives are those of automatic differentiation.
    """

    power = 2
    value_and_gradient, add_hessian = Energy.value_and_gradient, Energy.add_hessian
    scalar_stiffness = Energy.scalar_stiffness

    def __init__(self, cloth: Cloth) -> None:
        super().__init__(cloth, samples="vertices", margin=MARGIN, per_sample_stiffness=CONTACT_STIFFNESS)


STATIC = ("strain", "bending", "gravity")
Planes = tuple[Tensor, Tensor] | BatchKernel
EnergyType = TypeVar("EnergyType", bound=Energy)

MEMBRANES = {"stvk": StretchStVK, "springs": StretchSpring}


def static_terms(cloth: Cloth, recipe: Recipe) -> dict[str, Energy]:
    """Return the recipe's terms of single frames without contact, by name.

    Those of its material come first, then any other energy of the simulator that it names.
    """
    if recipe.material == "pbns":
        energies: Sequence[Energy] = spring_terms(cloth)
    else:
        membrane = MEMBRANES[recipe.material](cloth)
        energies = membrane, BendHinge(cloth, scaling=recipe.bending), Gravity(cloth)
    terms = {name: energy for name, energy in zip(STATIC, energies) if name in recipe.terms}
    return terms | {name: find_energy(name)(cloth) for name in recipe.terms if name not in TERMS}


def make_contact(cloth: Cloth, recipe: Recipe) -> ContactPenalty:
    """Return the recipe's contact term; options it leaves open are the simulator's defaults.

    For `nearest_vertices` the stiffness is the same on each vertex, in the mean that of the recipe; whoever
    evaluates the term gives it its planes.
    """
    if recipe.material == "pbns":
        return SquaredContact(cloth)
    values = {"margin": recipe.contact_margin, "stiffness": recipe.contact_stiffness}
    options: dict[str, Any] = {name: value for name, value in values.items() if value is not None}
    if recipe.contact_samples != "nearest_vertices":
        return ContactPenalty(cloth, samples=recipe.contact_samples, **options)
    contact = ContactPenalty(cloth, samples="vertices", **options)
    contact.stiffness[:] = contact.stiffness.mean()
    return contact


class ClosedForms(torch.autograd.Function):
    """Energies of each configuration of a batch by kernels in lanes, which all add to one gradient.

    `apply(x, *kernels)`: x (N, T, V, 3) float32 -> as many (N, T) [J] as kernels. Differentiable once, by
    x alone, and only in their plain sum times a number: raises ValueError for energies that are weighed
    against each other.
    """

    @staticmethod
    def forward(ctx: Any, x: Tensor, *kernels: BatchKernel) -> tuple[Tensor, ...]:
        """Evaluate all kernels."""
        lanes = to_lanes(x)
        gradient = np.zeros_like(lanes)
        values = tuple(from_lanes(kernel(lanes, gradient), *x.shape[:2]) for kernel in kernels)
        ctx.gradient = from_lanes(gradient, *x.shape[:2])
        return values

    @staticmethod
    def backward(ctx: Any, *above: Tensor) -> tuple[Tensor | None, ...]:
        """Return the gradient of the sum, times its factor."""
        factors = torch.stack(above)
        if (factors != factors.flatten()[0]).any():
            raise ValueError(
                "kernels give the gradient of the sum of all energies of a batch: weigh none"
            )
        return ctx.gradient * factors.flatten()[0], *([None] * len(above))


class ClosedForm(torch.autograd.Function):
    """An energy of a batch by its closed form, one configuration after the other.

    apply(x (..., V, 3), energy) -> (...) [J]. Differentiable once, by x alone.
    """

    @staticmethod
    def forward(ctx: Any, x: Tensor, energy: Energy) -> Tensor:
        """Evaluate value and gradient of each configuration."""
        flat = x.detach().reshape(-1, *x.shape[-2:]).numpy()
        values, gradients = np.empty(len(flat), flat.dtype), np.empty_like(flat)
        for n in range(len(flat)):
            values[n], gradients[n] = energy.value_and_gradient(flat[n])
        ctx.gradients = torch.from_numpy(gradients).reshape(x.shape)
        return torch.from_numpy(values).reshape(x.shape[:-2])

    @staticmethod
    def backward(ctx: Any, *above: Tensor) -> tuple[Tensor | None, ...]:
        """Return the gradients, times their factors."""
        return above[0][..., None, None] * ctx.gradients, None


def has_closed_form(energy: Energy) -> bool:
    """Return whether its gradient is known in closed form; others are differentiated automatically."""
    closed_form = type(energy).value_and_gradient is not Energy.value_and_gradient
    return has_kernel(energy, "training_batch") or closed_form


def on_device(energy: EnergyType, device: torch.device) -> EnergyType:
    """Return the energy with its arrays as tensors on a device, so that its definition copies nothing."""
    twin = copy.copy(energy)
    for name, value in vars(energy).items():
        if isinstance(value, np.ndarray):
            tensor = torch.as_tensor(value, device=device)
            setattr(twin, name, tensor.float() if tensor.is_floating_point() else tensor)
    return twin


class PhysicsLoss:
    """Energies of sub-sequences of frames `dt` [s] apart, by term of the recipe.

    kernels: on a CPU, use closed forms where there are any, else the definitions.
    """

    def __init__(
        self, cloth: Cloth, recipe: Recipe, *, dt: float, device: torch.device = CPU, kernels: bool = True
    ) -> None:
        self.terms, self.kernels, self.inertia_form = recipe.terms, kernels, recipe.inertia_form
        self.contact = make_contact(cloth, recipe)
        self.inertia = Inertia(cloth, dt)
        self._contact = self.contact
        if not kernels:
            self.inertia, self._contact = on_device(self.inertia, device), on_device(self.contact, device)
        self.static = {
            name: term if kernels and has_closed_form(term) else on_device(term, device)
            for name, term in static_terms(cloth, recipe).items()
        }
        self._definitions = compile_for(self._evaluate, device)
        self._batches: dict[str, BatchKernel] = {}
        if kernels:
            batches = {name: fast_kernel(term, "training_batch") for name, term in self.static.items()}
            self._batches = {name: kernel for name, kernel in batches.items() if kernel is not None}
            if slow := [term for name, term in self.static.items() if name not in self._batches]:
                instead = (
                    "frames are evaluated one after the other, or by torch (docs/extend.md, An energy)"
                )
                warn_slow_path("training", "batch kernel", slow, instead)

    def __call__(
        self, x: Tensor, lead: Tensor, planes: Planes | None, *, lag: Tensor | None = None
    ) -> dict[str, Tensor]:
        """Return the energy of each window and frame, term -> (N, T) [J], whose mean over frames is the loss.

        Where only some frames of a window have inertia, theirs is scaled up by the share of these frames.

        Args:
            x: (N, T, V, 3) [m], each frame relative to its own pelvis p.
            lead: 2 p_{t-1} - p_{t-2} - p_t, (N, T, 3) [m].
            planes: points and normals (N, T, S, 3) of the contact samples, or a kernel in lanes that
                knows its planes; None leaves contact out.
            lag: p_{t-1} - p_t, (N, T, 3) [m]; only the recipe's inertia_form `two_transitions` needs
                it.
        """
        if not (self.kernels and x.dtype == torch.float32):
            return self._definitions(x, lead, planes, lag, {})
        kernels = self._kernels(x, lead, planes)
        closed = dict(zip(kernels, ClosedForms.apply(x, *kernels.values()) if kernels else ()))
        return self._evaluate(x, lead, planes, lag, closed)

    def _evaluate(
        self,
        x: Tensor,
        lead: Tensor,
        planes: Planes | None,
        lag: Tensor | None,
        closed: dict[str, Tensor],
    ) -> dict[str, Tensor]:
        """Return the energies of `__call__`: those of `closed`, and the others by their definitions."""
        terms = {}
        for name, energy in self.static.items():
            if name in closed:
                terms[name] = closed[name]
            elif self.kernels and has_closed_form(energy):
                terms[name] = ClosedForm.apply(x, energy)
            else:
                terms[name] = energy.energy(x).sum(-1)
        if "inertia" in self.terms and x.shape[1] >= 3:
            terms["inertia"] = closed["inertia"] if "inertia" in closed else self._inertia(x, lead, lag)
        if "collision" in self.terms and planes is not None:
            terms["collision"] = (
                self._contact.energy(x, *planes).sum(-1)
                if isinstance(planes, tuple)
                else closed["collision"]
            )
        return terms

    def _kernels(self, x: Tensor, lead: Tensor, planes: Planes | None) -> dict[str, BatchKernel]:
        """Return the kernels in lanes of the terms that have one, by name of the term."""
        kernels = dict(self._batches)
        in_lanes = self.inertia_form == "equation_5" and len(x) % LANES == 0
        if "inertia" in self.terms and x.shape[1] >= 3 and in_lanes:
            weight = x.shape[1] / (x.shape[1] - 2)
            kernels["inertia"] = batch_of_windows(self.inertia, to_lanes(lead), len(x), weight)
        if "collision" in self.terms and callable(planes):
            kernels["collision"] = planes
        return kernels

    def _inertia(self, x: Tensor, lead: Tensor, lag: Tensor | None) -> Tensor:
        """Return the recipe's form of inertia (N, T) [J], scaled as `__call__` has it."""
        x_hat = 2 * x[:, 1:-1] - x[:, :-2] + lead[:, 2:, None]
        if self.inertia_form == "two_transitions":
            assert lag is not None
            x_hat = torch.cat([x[:, :1] + lag[:, 1:2, None], x_hat], 1)  # no velocity before the first
        elif self.inertia_form == "detached_past":
            x_hat = x_hat.detach()
        frames, count = x.shape[1], x_hat.shape[1]
        inertia = self.inertia.energy(x[:, -count:], x_hat).sum(-1) * (frames / count)
        return torch.nn.functional.pad(inertia, (frames - count, 0))
