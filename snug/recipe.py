"""Recipe: every choice of a training run. The named ones are in snug.named_recipes.

No recipe holds a balancing weight between the energies: there is none. `physics_weight` alone weighs
them, together, against a distance. `Recipe.terms` names any energy that `find_energy` knows. Imports
nothing heavy, so that a command can list recipes without loading torch.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields
from typing import Any

from reference_sim import energies
from reference_sim.energies import Energy

TERMS = ("strain", "bending", "gravity", "inertia", "collision")
INITIALISATIONS = ("torch", "keras")
INERTIA_FORMS = ("equation_5", "detached_past", "two_transitions")


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """Options of the network and of its training. Lengths in metres, energies in joules.

    Attributes:
        name: shown in tables.
        pose_input: `six` (two columns of each joint's rotation matrix, the root by its up direction
            alone, so that the direction a person walks in does not matter) or `axis_angle` (the 72
            numbers of the pose).
        velocity_frame: axes of the root velocity, `root` or `world`.
        smoothing: sweeps of neighbour averaging over the borrowed skinning weights, at 1000 vertices (see
            DressedBody.weights).
        initialisation: rules by which the random weights are drawn, `torch` or `keras`, see
            snug.networks.garment_network.
        zero_last_layer: start at the skinned template instead of at centimetres of noise.
        output_scale: factor on the predicted offsets.
        learning_rate: of Adam.
        adam_epsilon: added to the root of Adam's second moment; torch has 1e-8, Keras 1e-7.
        weight_decay: share, times the rate, taken off each weight in a step (AdamW, Loshchilov and Hutter
            2019).
        schedule: of the learning rate: `cosine` (half a cosine, down to a hundredth at the last step),
            or `epochs` (a tenth after ten epochs).
        h0_sigma: standard deviation of the initial hidden state in training (0 at run time always).
        remembered: add that noise to the state which the network last had after the frame before (see
            snug.training.training_set), instead of to zero. Not for networks that learn simulated
            vertices, nor where each window gets its own shape (`shape_of`).
        window: frames of a sub-sequence.
        batch: sub-sequences of a step; a network of single frames gets batch x window frames.
        window_stride: frames between the starts of two sub-sequences (equal to `window`: none overlap); a
            network of single frames learns from each frame whatever it is.
        even: passes n of an epoch: pass k takes the sub-sequences k, k + n, k + 2n, ... of all motions,
            so that no hard pose first appears after the network has settled. With 1 the order is random.
        shape_range: bodies get shape numbers from U(-r, r), where a network reads shape.
        shape_of: receivers of a shape: each `window` in each step anew, as the paper has it, or each
            augmented `clip` once, while original motions stay on the mean body.
        shape_share: share of these clips that leave the mean body.
        contact_samples: `all` (vertices, edge midpoints, centroids), `vertices`, or `nearest_vertices`
            (vertices, each by the tangent plane at the body vertex nearest to it, searched anew in every
            frame of every step, and as stiff on each vertex: the published code of SNUG's authors).
        contact_stiffness: of ContactPenalty, per area of cloth [J/m^5]; None takes the simulator's
            default.
        contact_margin: of ContactPenalty; None takes the simulator's default.
        mixed: frames of augmented motions (snug.training.augmentation) for each frame of a training motion,
            up to 20,000 or 2 GB of anchors; not for networks that learn simulated vertices, whose clips are
            simulated beforehand.
        turn: standard deviation of the slow turns added in them [rad]. Wide ones help a long training and
            cost a short one much (docs/notebook/training.md).
        terms: energies in the loss, TERMS or any other that `find_energy` knows.
        physics_weight: lambda [cm^2/J] of the loss of networks that learn simulated vertices: mean squared
            distance [cm^2] + lambda * the sum of `terms` [J]. With 0 the distance alone. Added later: 0
            is in no digest, and what a file without it means.
        inertia_form: `equation_5` (the inertia of each frame with two before it in its window, through
            which its gradient reaches all three), `detached_past` (the same without a gradient to the two
            frames before, as in Neural Cloth Simulation and GAPS) or `two_transitions` (the published
            code of SNUG's authors: the second frame has an inertia too, about a cloth that stood still
            before it).
        material: `stvk`, `springs` (mass-spring edges in place of the StVK membrane, all else the same)
            or `pbns` (edges, hinges, uniform mass and squared contact of PBNS, see
            snug.training.physics_loss, with its own stiffness and margin of contact).
        bending: scaling of the hinges, as BendHinge has it: `length_area`, or `none` as the paper prints
            them; without effect with material `pbns`.
        spike: a window above this many joules a frame is named and counted, and its step's gradient
            clipped; further measures: see snug.training.divergence_guard.
    """

    name: str = "default"
    pose_input: str = "six"
    velocity_frame: str = "root"
    smoothing: int = 20
    initialisation: str = "keras"
    zero_last_layer: bool = True
    output_scale: float = 0.1
    learning_rate: float = 1e-3
    adam_epsilon: float = 1e-7
    weight_decay: float = 0.1
    schedule: str = "cosine"
    h0_sigma: float = 0.05
    remembered: bool = True
    window: int = 3
    batch: int = 16
    window_stride: int = 1
    even: int = 20
    shape_range: float = 0.0
    shape_of: str = "window"
    shape_share: float = 1.0
    contact_samples: str = "all"
    contact_stiffness: float | None = None
    contact_margin: float | None = None
    mixed: float = 12.0
    turn: float = field(default=0.2, metadata={"added": True})
    terms: tuple[str, ...] = TERMS
    physics_weight: float = field(default=0.0, metadata={"added": True})
    inertia_form: str = "equation_5"
    material: str = "stvk"
    bending: str = "length_area"
    spike: float = 2.0

    def __post_init__(self) -> None:
        for option, choices in (
            ("pose_input", ("six", "axis_angle")),
            ("velocity_frame", ("root", "world")),
            ("initialisation", INITIALISATIONS),
            ("inertia_form", INERTIA_FORMS),
            ("schedule", ("cosine", "epochs")),
            ("contact_samples", ("all", "vertices", "nearest_vertices")),
            ("material", ("stvk", "springs", "pbns")),
            ("bending", ("length_area", "none")),
            ("shape_of", ("window", "clip")),
        ):
            if getattr(self, option) not in choices:
                raise ValueError(
                    f"recipe option {option}={getattr(self, option)!r}: use one of {choices}"
                )
        for term in (name for name in self.terms if name not in TERMS):
            try:
                find_energy(term)
            except ValueError as error:
                raise ValueError(
                    f"recipe option terms: {error}; the recipes here have {TERMS}"
                ) from error
        if min(self.window, self.batch, self.window_stride, self.even) < 1:
            raise ValueError("recipe options window, batch, window_stride and even must be at least 1")
        if "inertia" in self.terms and self.window < 3:
            raise ValueError("recipe option window: inertia needs two frames before its own, so >= 3")
        for option in (
            "smoothing", "weight_decay", "h0_sigma", "shape_range", "shape_share", "mixed", "turn",
            "physics_weight",
        ):  # fmt: skip
            if not 0 <= getattr(self, option) < math.inf:
                raise ValueError(f"recipe option {option}={getattr(self, option)}: must be at least 0")
        if self.shape_of == "clip" and self.shape_range and not self.mixed:
            raise ValueError("recipe option shape_of='clip': mixed clips get the shapes, so mixed > 0")
        if self.shape_share > 1.0:
            raise ValueError(f"recipe option shape_share={self.shape_share}: a share, so at most 1")
        for option in ("learning_rate", "adam_epsilon", "output_scale", "spike"):
            if not getattr(self, option) > 0:
                raise ValueError(f"recipe option {option}={getattr(self, option)}: must be above zero")

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Recipe:
        """Make a recipe from its fields. Raises ValueError for an unknown or missing one."""
        values = {f.name: f.default for f in fields(cls) if f.metadata.get("added")} | values
        if differing := sorted(values.keys() ^ {field.name for field in fields(cls)}):
            raise ValueError(f"recipe option {differing[0]!r} is unknown or missing")
        return cls(**{**values, "terms": tuple(values["terms"])})


DEFAULT = Recipe()


def find_energy(name: str) -> Callable[..., Energy]:
    """Return the function that makes the energy of that name from a Cloth, its options at their defaults.

    Raises:
        ValueError: an unknown name, one that two have, or an energy that cannot be trained: it is made of
            more than a cloth, must be prepared for each step of a simulation (Energy.prepare), or finds
            its stencils anew as vertices move (Energy.dynamic).

    >>> find_energy("gravity").__name__
    'Gravity'
    """
    for class_name in energies.__all__:
        getattr(energies, class_name)  # imported by it
    terms = [term for term in _subclasses(Energy) if hasattr(term, "name")]
    named = [term for term in terms if term.name == name]
    fit = {f"{term.__module__}.{term.__qualname__}": term for term in named if not _reason_against(term)}
    if len(fit) == 1:
        return next(iter(fit.values()))
    if fit:
        raise ValueError(f"energy {name!r} is both {' and '.join(fit)}: give yours a name of its own")
    if named:
        raise ValueError(f"energy {name!r} cannot be trained: {_reason_against(named[0])}")
    names = ", ".join(sorted({term.name for term in terms if not _reason_against(term)}))
    raise ValueError(f"unknown energy {name!r}: use one of {names}, or import the file of your own")


def _subclasses(base: type[Energy]) -> Iterator[type[Energy]]:
    for term in base.__subclasses__():
        yield term
        yield from _subclasses(term)


def _reason_against(term: type[Energy]) -> str:
    """Say why a term cannot be part of a loss; empty if it can."""
    parameters = inspect.signature(term).parameters.values()
    variadic = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    arguments = [p.name for p in parameters if p.default is p.empty and p.kind not in variadic]
    if arguments != ["cloth"]:
        return f"it is made of {', '.join(arguments)}, a garment has its cloth alone"
    if term.prepare is not Energy.prepare:
        return "it must be prepared for each step of a simulation"
    return "its stencils change as vertices move" if term.dynamic else ""
