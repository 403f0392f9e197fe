"""Recipe: every choice of a training run in one frozen place, each deviation from the paper by name.

Recipes are named: `default` is what trains well on a CPU in minutes, `paper` is the paper's text but for its
contact (below), the ablations are the default with one thing changed. None holds a balancing weight between
the energies: there is none (`pca_dynamics` of `dynamic` weighs what a simulation teaches). Imports nothing
heavy, so that a command can list recipes without loading torch.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from snug.recipe_deviations import with_and_without

TERMS = ("strain", "bending", "gravity", "inertia", "collision")


class RecipeError(ValueError):
    """A recipe that cannot be trained: the message names the option, its value and what it may be."""


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """Options of the network and of its training. Lengths in metres, energies in joules.

    name: shown in tables.
    pose_input: `six` (two columns of each joint's rotation matrix, the root by its up direction alone, so
        that the direction a person walks in does not matter) or `axis_angle` (the 72 numbers of the pose).
    velocity_frame: axes of the root velocity, `root` or `world`.
    smoothing: sweeps of neighbour averaging over the borrowed skinning weights, at 1000 vertices (see
        DressedBody.weights).
    zero_last_layer: start at the skinned template instead of at centimetres of noise.
    output_scale: factor on the predicted offsets.
    learning_rate: of Adam. schedule: what becomes of it, `cosine` (half a cosine, down to a hundredth of it
        at the last step), `epochs` (a tenth after `drop_after_epochs` epochs) or `constant`.
    weight_decay: share, times the rate, taken off each weight in a step (AdamW, Loshchilov and Hutter 2019).
    h0_sigma: standard deviation of the initial hidden state in training (0 at run time always).
    remembered: that noise is added to the state which the network last had after the frame before (see
        snug.hidden_state_cache), instead of to nothing. Not for what learns simulated vertices, nor where
        `shape_range` gives a sub-sequence another body each time; of little use where `window_stride` is no
        divisor of `window`, for then few frames before a window ever end one.
    window, batch: frames of a sub-sequence, sub-sequences of a step.
    window_stride: frames between the starts of two sub-sequences (equal to `window`: none overlap).
    even: parts of an epoch that each pass over all motions, each taking one sub-sequence of so many: by
        chance alone (1) a hard pose may come so late that the network, by then settled, meets it with joules.
    shape_range: each sub-sequence gets shape numbers from U(-r, r).
    contact_samples: `all` (vertices, edge midpoints, centroids) or `vertices`.
    contact_stiffness, contact_margin: of ContactPenalty; None takes the simulator's defaults.
    contact_refresh: frames searched for contact after a step, as a share of the batch's frames, at most one
        of each window; in between anchors walk with the cloth.
    mixed: frames of mixed motions (snug.motion_augmentation) for each frame of a training motion, up to
        20,000; not for what learns simulated vertices. mixed_turn [rad], mixed_lift: see there.
    terms: energies in the loss, TERMS or any other energy of the simulator by its name, see
        snug.trainable_energies. Leaving one out is an ablation, and it is then never evaluated.
    material: `stvk`, `springs` (mass-spring edges in place of the StVK membrane, all else the same) or `pbns`
        (edges, hinges, uniform mass and squared contact of PBNS, see snug.baselines.springs; it has its own
        stiffness and margin of contact).
    detached: previous frames are given to inertia, not moved by it: without it a network makes its past agree
        with a still present instead of learning to move.
    pca_dynamics, pca_components, pretraining: weight, number of components and updates, see
        snug.pca_dynamics; of no account where no simulation teaches.
    spike: a window above this many joules a frame is named and counted, and its step's gradient clipped; what
        else is done about such batches: see snug.divergence_guard.
    gradient_limit: norm to which the gradient of such a step is clipped; 0.3 is usual at 1000 vertices.
    """

    name: str = "default"
    pose_input: str = "six"
    velocity_frame: str = "root"
    smoothing: int = 20
    zero_last_layer: bool = True
    output_scale: float = 0.1
    learning_rate: float = 2e-3
    weight_decay: float = 0.1
    schedule: str = "cosine"
    drop_after_epochs: int = 10
    h0_sigma: float = 0.05
    remembered: bool = True
    window: int = 3
    batch: int = 16
    window_stride: int = 1
    even: int = 20
    shape_range: float = 0.0
    contact_samples: str = "all"
    contact_stiffness: float | None = None
    contact_margin: float | None = None
    contact_refresh: float = 0.01
    mixed: float = 12.0
    mixed_turn: float = 0.1
    mixed_lift: float = 1.0
    terms: tuple[str, ...] = TERMS
    material: str = "stvk"
    detached: bool = False
    pca_dynamics: float = 0.0
    pca_components: int = 16
    pretraining: int = 300
    spike: float = 2.0
    gradient_limit: float = 1.0

    def __post_init__(self) -> None:
        for option, allowed in (
            ("pose_input", ("six", "axis_angle")),
            ("velocity_frame", ("root", "world")),
            ("schedule", ("cosine", "epochs", "constant")),
            ("contact_samples", ("all", "vertices")),
            ("material", ("stvk", "springs", "pbns")),
        ):
            if getattr(self, option) not in allowed:
                raise RecipeError(f"recipe option {option}={getattr(self, option)!r}: use one of {allowed}")
        self._demand_known(term for term in self.terms if term not in TERMS)
        if min(self.window, self.batch, self.window_stride, self.even) < 1:
            raise RecipeError("recipe options window, batch, window_stride and even must be at least 1")
        if "inertia" in self.terms and self.window < 3:
            raise RecipeError(
                "recipe option window: inertia needs two frames before the one it judges, so >= 3"
            )
        if self.pca_components < 1:
            raise RecipeError(f"recipe option pca_components={self.pca_components}: use at least 1")
        sizes = ("smoothing", "h0_sigma", "shape_range", "contact_refresh", "pca_dynamics", "pretraining")
        for option in ("weight_decay", "mixed", "mixed_turn", "mixed_lift", *sizes):
            if getattr(self, option) < 0:
                raise RecipeError(f"recipe option {option}={getattr(self, option)}: must not be negative")
        if self.mixed_lift > 1.0:
            raise RecipeError(f"recipe option mixed_lift={self.mixed_lift}: a share, so at most 1")
        for option in ("learning_rate", "output_scale", "gradient_limit", "spike"):
            if not getattr(self, option) > 0:
                raise RecipeError(f"recipe option {option}={getattr(self, option)}: must be above zero")

    @staticmethod
    def _demand_known(terms: Iterable[str]) -> None:
        """Raises RecipeError for what is no energy of the simulator that can be trained on."""
        for term in terms:
            from snug.trainable_energies import find_energy

            try:
                find_energy(term)
            except ValueError as error:
                here = ", ".join(TERMS)
                raise RecipeError(f"recipe option terms: {error}; the recipes here have {here}") from error

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for a model file or run.json."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Recipe:
        """The inverse of `as_dict`. Raises RecipeError for an option that this version does not know."""
        known = {field.name for field in fields(cls)}
        unknown = sorted(set(values) - known)
        if unknown:
            raise RecipeError(f"unknown recipe option {unknown[0]!r}")
        return cls(**{**values, "terms": tuple(values.get("terms", TERMS))})


DEFAULT = Recipe()
# Three things are not the text's: d(x) is taken to cached points of the skin, which walk with the cloth
# and of which `contact_refresh` searches a few anew in a step (the text computes it anew; searching all 48
# frames would take several times as long as the rest of a step); only to skin that the rule of regions
# allows; and the garment that the offsets are added to follows the shape of the body.
PAPER = Recipe(
    name="paper",
    pose_input="axis_angle",
    velocity_frame="world",
    smoothing=0,
    zero_last_layer=False,
    output_scale=1.0,
    learning_rate=1e-3,
    weight_decay=0.0,
    schedule="epochs",
    h0_sigma=0.1,
    remembered=False,
    window_stride=3,
    even=1,
    shape_range=3.0,
    contact_samples="vertices",
    contact_stiffness=250.0,
    contact_margin=0.002,
    mixed=0.0,
    spike=1e6,
)
# Vertices of a simulation depend on more than two frames before: longer windows follow them better (7 mm
# instead of 13 on the training motions at 500 vertices), and there is no energy that a window could cheat.
# Rate and decay are the default's: 40.3 mm off the simulation on three held-out motions, 40.9 without decay,
# and then 41.8 at half of the rate.
SUPERVISED = replace(
    DEFAULT,
    name="supervised",
    window=16,
    batch=6,
    h0_sigma=0.1,
    remembered=False,
    mixed=0.0,
)
# A constant shape needs no recurrence of its own: the fit is a mean drape, see santesteban2019.
SANTESTEBAN2019 = replace(SUPERVISED, name="santesteban2019", learning_rate=1e-3)
# One frame knows nothing of its past, so windows of one; Adam, rate and batch as its authors train it.
TAILORNET = replace(
    SUPERVISED,
    name="tailornet",
    window=1,
    batch=32,
    learning_rate=1e-4,
    weight_decay=0.0,
    schedule="constant",
    output_scale=1.0,
    terms=(),
)
PBNS_SPRINGS = replace(DEFAULT, name="pbns-springs", material="pbns", contact_samples="vertices")

# Mixed motions cost it dynamics. The energy of the components begins at joules, which are no divergence.
DYNAMIC = replace(
    DEFAULT,
    name="dynamic",
    learning_rate=1e-3,
    weight_decay=0.0,
    h0_sigma=0.3,
    remembered=False,
    mixed=0.0,
    detached=True,
    pca_dynamics=0.3,
    spike=20.0,
)


def _without(term: str) -> Recipe:
    return replace(DEFAULT, name=f"no-{term}", terms=tuple(name for name in TERMS if name != term))


# Longer windows get smaller batches, so that a step sees 48 frames in each.
ABLATIONS = (
    *(_without(term) for term in ("bending", "strain", "gravity", "inertia")),
    replace(DEFAULT, name="no-noise", h0_sigma=0.0, remembered=False),
    replace(DEFAULT, name="noise-alone", h0_sigma=0.1, remembered=False),  # as the paper has it
    replace(DEFAULT, name="window6", window=6, batch=8),
    replace(DEFAULT, name="window12", window=12, batch=4),
    replace(DEFAULT, name="springs", material="springs"),
)
RECIPES = {recipe.name: recipe for recipe in (DEFAULT, PAPER, PBNS_SPRINGS, *ABLATIONS)}


@dataclass(frozen=True)
class Training:
    """How a named model comes to be. kind: one of snug.trained_model.KINDS. simulated: needs trajectories."""

    kind: str
    recipe: Recipe
    simulated: bool = False


TRAININGS = {
    "snug": Training("snug", DEFAULT),
    "pbns": Training("pbns", DEFAULT),
    "pbns-springs": Training("pbns", PBNS_SPRINGS),
    "supervised": Training("supervised", SUPERVISED, simulated=True),
    "santesteban2019": Training("santesteban2019", SANTESTEBAN2019, simulated=True),
    "tailornet": Training("tailornet", TAILORNET, simulated=True),
    "snug-dynamic": Training("dynamic", DYNAMIC, simulated=True),
    **{
        f"snug-{recipe.name}": Training("snug", recipe)
        for recipe in (PAPER, *ABLATIONS, *with_and_without(DEFAULT, PAPER))
    },
}


def learns_from_simulation(model: str) -> bool:
    """Whether the model of that name needs simulated motions to be trained."""
    return model in TRAININGS and TRAININGS[model].simulated


def find_recipe(name: str) -> Recipe:
    """The recipe of that name. Raises RecipeError naming the known ones."""
    if name not in RECIPES:
        raise RecipeError(f"unknown recipe {name!r}: use one of {', '.join(RECIPES)}")
    return RECIPES[name]
