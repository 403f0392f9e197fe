"""Own energies of a method: those that its network was trained on, and the simulation that minimises them.

Each network is measured by the energies of its own loss too, against the simulation that has exactly
these: the recipe's material, hinges, contact constants and terms. A network of single
frames, or one trained without inertia, has no dynamics in its loss: its minimum is the quasi-static
solution of each frame. Contact planes are the scene's whatever the recipe takes: at nearest vertices they
jump as cloth slides, and no simulation converges on them.
"""

from __future__ import annotations

from dataclasses import replace

from benchmarks.declarations import load
from benchmarks.method import MethodEntry, Training
from benchmarks.methods.declared_networks import TRAININGS
from snug.kinds import KINDS
from snug.recipe import DEFAULT, Recipe

OPTIONS = ("material", "bending", "terms", "contact_samples", "contact_stiffness", "contact_margin")
MODULE = "benchmarks.methods.reference_variants:make_own_reference"
NEEDED = {"strain", "collision"}  # without these cloth shrinks or falls for ever: there is no minimum
TRAINED = ("network", "ablation", "baseline")  # roles; a solver that starts at a network has the scene's


def without_inertia(recipe: Recipe) -> Recipe:
    """Return the recipe's energies of single frames."""
    return replace(recipe, terms=tuple(term for term in recipe.terms if term != "inertia"))


STATIC = without_inertia(DEFAULT)


def energies_of(training: Training) -> Recipe | None:
    """Return the energies a network is trained on, as a recipe that is the default in all else.

    None where these have no minimum, and for a network that learns simulated vertices: energies beside
    these do not make the minimum of its loss, which is zero distance on its training motions and unknown on
    others.
    """
    recipe, kind = training.recipe, KINDS[training.kind]
    if not (kind.physics and set(recipe.terms) >= NEEDED):
        return None
    energies = replace(DEFAULT, **{option: getattr(recipe, option) for option in OPTIONS})
    return without_inertia(energies) if kind.static else energies


def find_energies(entry: MethodEntry) -> Recipe | None:
    """Return the energies of a method's training, see `energies_of`; without one DEFAULT, the scene's.

    >>> from benchmarks.methods import find_method
    >>> find_energies(find_method("snug-paper")).contact_margin, find_energies(find_method("supervised"))
    (0.002, None)
    """
    if entry.declared_in:
        load(entry.declared_in)  # an energy of its own is then known by name
    if is_own_reference(entry):
        return replace(DEFAULT, **entry.options)
    training = entry.training or TRAININGS.get(entry.trained or "")
    return energies_of(training) if training and entry.role in TRAINED else DEFAULT


def is_own_reference(entry: MethodEntry) -> bool:
    """Return whether a method is the simulation of the energies of some network."""
    return entry.module == MODULE


def find_own_reference(entry: MethodEntry) -> MethodEntry | None:
    """Return the simulation of a method's own energies; None where these are the scene's, or have no minimum.

    Nor is there one of the scene's energies without inertia: the quasi-static solution of the scene is
    that.
    """
    energies = find_energies(entry)
    if energies in (None, DEFAULT, STATIC) or is_own_reference(entry):
        return None
    names = [training.recipe.name for training in TRAININGS.values() if energies_of(training) == energies]
    name = names[0] if names else f"of-{entry.trained}"
    static = "inertia" not in energies.terms
    return MethodEntry(
        name=f"simulation-{name}" + "-at-rest" * static,
        label=f"Simulation, {name.replace('-', ' ').replace('pbns', 'PBNS')}" + ", at rest" * static,
        description=f"{'quasi-static solutions' if static else 'the reference'} with the energies of {name}",
        module=MODULE,
        declared_in="" if names else entry.declared_in,
        options={option: getattr(energies, option) for option in OPTIONS},
        needs_body=True,
        timed=False,
        role="ablation",
        base="simulation",
    )


OWN_REFERENCES = tuple(
    {entry.name: entry for name in TRAININGS if (entry := find_own_reference(MethodEntry(
        name=name, description="", trained=name, role="network")))}.values()
)  # fmt: skip
