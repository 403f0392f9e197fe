"""The visible tuple of suites: which scenes meet which methods, and what is only in a full run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from benchmarks.methods.catalogue.ablations import RECIPE_DEVIATIONS
from benchmarks.methods.catalogue.all_methods import FURTHER_METHODS, METHODS
from benchmarks.methods.catalogue.equal_data import EQUAL_DATA
from benchmarks.methods.catalogue.networks import HANDLES
from benchmarks.plan.plan import Motions
from benchmarks.presets import Preset
from benchmarks.results.ensemble import MEMBERS
from benchmarks.scene import Scene
from benchmarks.scenes import GARMENT_SCENES
from benchmarks.scenes.textile_tests import TEXTILE_TESTS
from benchmarks.scenes.variations import DRAPES, OUT_OF_DISTRIBUTION, meshes_and_steps, shapes, there_and_back
from benchmarks.scenes.variations import FEW as FEW_OUT_OF_DISTRIBUTION
from benchmarks.scenes.variations import FEWEST as FEWEST_OUT_OF_DISTRIBUTION


@dataclass(frozen=True)
class Extent:
    """Extent to which a suite is asked for.

    full: more than its quick subset. further: all of the suite, and scenes that double the work.
    fabric_scenes: textile tests of a user's fabrics.
    """

    preset: Preset
    motions: Motions
    full: bool = False
    further: bool = False
    fabric_scenes: tuple[Scene, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Suite:
    """A question put to many cells, or to cases of benchmarks.validation.

    scenes, methods: names of those that meet. more_methods: those that take part only where methods are
    named, or at a preset that holds all; named_methods: those that have to be named. default: whether it
    takes part where no suite is named.
    """

    name: str
    description: str
    scenes: Callable[[Extent], list[str]] = lambda extent: []
    methods: Callable[[Extent], list[str]] = lambda extent: []
    more_methods: tuple[str, ...] = ()
    named_methods: tuple[str, ...] = ()
    default: bool = True


# --- garments ----------------------------------------------------------------------------------------------


def _whole_motions(extent: Extent) -> list[str]:
    """Return scenes of the first garment in each motion of the split, and of garments that swing at paper."""
    first, *others = extent.motions.worn
    names = [first.scene(name).name for name in extent.motions.measured]
    names += [there_and_back(name, first.garment).name for name in extent.motions.measured[:1]]
    if extent.further:
        names += [o.scene(name).name for o in others if o.dynamic for name in extent.motions.dynamic_measured]
    return names


# --- speed -------------------------------------------------------------------------------------------------

SMALL = ("hanging_sheet", "sheet_on_sphere", "flag", "twisted_strip")
EXACT = ("free_fall",)  # every method has no error there but round-off: only for whoever names it

# The reference from coarse to fine in tolerance and in time; and its ensemble, whose spread is the
# uncertainty of whatever is compared with it.
ENSEMBLE = tuple(MEMBERS)
PERTURBED = tuple(entry.name for entry in METHODS if entry.reporting.family == "simulation-perturbed")
FEW_REFERENCES = ("simulation", "simulation-1e-2", "simulation-dt/8", *ENSEMBLE)
REFERENCES = (*FEW_REFERENCES, "simulation-dt/2", "simulation-dt/4", *PERTURBED)
# Iterations per unit of a preset's budgets. The quick subset lacks the largest, and has one of the slower.
FAMILIES = (("fast-lbfgs", 5), ("snug+fast-lbfgs", 1))
SLOWER_FAMILIES = (("newton", 1), ("lbfgs", 5))
FEW_SOLVERS = ("vbd-20", "xpbd-40")
SOLVERS = (*FEW_SOLVERS, "gradient-descent-10", "skinning+lbfgs-4", "snug+lbfgs-2", "snug+newton-2")
EXTERNAL = ("newton-vbd", "newton-xpbd")  # skipped where the package is not installed
FAST = ("skinning", "snug", "supervised", "pbns")
OTHER_SPRINGS = ("simulation-springs", "simulation-pbns-springs")
CHEAP = ("snug+fast-lbfgs-1", "fast-lbfgs-10")  # solvers of some milliseconds, where others are not asked


def _clips(extent: Extent) -> list[str]:
    """Return small scenes and clips of dressed bodies; the quick subset is one of each.

    Dressed bodies are clips, the liveliest part of a motion: here every solver goes through every frame. They
    are the first two motions of the split, and the first for garments that swing, also with a skirt.
    """
    motions, swinging = extent.motions, extent.motions.dynamic_measured[:1]
    first = motions.first_garment
    if not extent.full:
        return [SMALL[0], *(f"{first}/{name}@clip" for name in motions.measured[:1])]
    shirts = [f"{first}/{name}@clip" for name in dict.fromkeys((*motions.measured[:2], *swinging))]
    skirts = [f"skirt/{name}@clip" for name in swinging]
    return [*SMALL, *(EXACT if extent.further else ()), *shirts, *skirts]


def _solvers(extent: Extent) -> list[str]:
    """Return the reference, truncated solvers and networks; the quick subset has fewer slow ones."""
    full, budgets = extent.full, extent.preset.iteration_budgets
    many, few = (budgets, budgets) if full else (budgets[:3], budgets[-2:-1])
    levels = {family: [scale * budget for budget in many] for family, scale in FAMILIES}
    levels |= {family: [scale * budget for budget in few] for family, scale in SLOWER_FAMILIES}
    truncated = [
        entry.name for entry in METHODS if entry.reporting.level in levels.get(entry.reporting.family, ())
    ]
    references, others = (REFERENCES, SOLVERS) if full else (FEW_REFERENCES, FEW_SOLVERS)
    return [*dict.fromkeys(references), *truncated, *others, *EXTERNAL, *FAST]


# --- validation --------------------------------------------------------------------------------------------


def _dependence(extent: Extent) -> list[str]:
    """Return meshes and steps of the preset, of the T-shirt alone, not in the quick subset of preset quick.

    Drapes of up to 16,000 vertices are among them where scenes are named, or at paper.
    """
    tailored = extent.motions.first_garment == GARMENT_SCENES[0].garment
    wanted = extent.full or extent.preset.smallest
    meshes = meshes_and_steps(extent.preset.dependence) if tailored and wanted else []
    return [scene.name for scene in (*meshes, *(DRAPES if extent.further else ()))]


# --- out of distribution ------------------------------------------------------------------------------------


def _out_of_distribution(extent: Extent) -> list[str]:
    """Return all of these scenes; the quick subset is some of them, fewer at the smallest preset."""
    if extent.preset.smallest and not extent.further:
        return list(FEWEST_OUT_OF_DISTRIBUTION)
    if extent.full:
        return [scene.name for scene in OUT_OF_DISTRIBUTION]
    return list(FEW_OUT_OF_DISTRIBUTION)


# --- body shapes --------------------------------------------------------------------------------------------

SHAPED = "snug-shapes"


def _shapes(extent: Extent) -> list[str]:
    """Return one motion on other bodies: where the suite or scenes are named, or at paper."""
    motions = extent.motions.measured[:1] if extent.full else ()
    return [scene.name for motion in motions for scene in shapes(motion, extent.motions.first_garment)]


# --- fabric -------------------------------------------------------------------------------------------------

UNCERTAINTY = tuple(name for name in ENSEMBLE if name != "simulation-refrozen")  # there is no obstacle
STOPPED_EARLY = tuple(entry.name for entry in METHODS if entry.role in ("solver", "external"))

SUITES = (
    Suite(
        name="garments",
        description="all methods on unseen motions: energies, curvature, cost",
        scenes=_whole_motions,
        methods=lambda extent: [
            "simulation", *ENSEMBLE, "skinning", "untrained", "snug", "supervised", "pbns", *CHEAP,
        ],
        more_methods=(
            *(entry.name for entry in FURTHER_METHODS), *PERTURBED, "simulation-printed-bending",
            "lbfgs-5", "lbfgs-10", "snug+fast-lbfgs-2", "snug+fast-lbfgs-4",
        ),
        named_methods=(
            *OTHER_SPRINGS, "simulation-self-contact",
            *(entry.name for entry in (*RECIPE_DEVIATIONS, *EQUAL_DATA)),
        ),
    ),
    Suite(
        name="speed",
        description="error against run time: solvers stopped early versus networks",
        scenes=_clips,
        methods=_solvers,
        # Learned ones, and solvers that start from `snug-dynamic`, as in suite garments.
        more_methods=(
            "pbns-springs", "santesteban2019", "tailornet", "ncs", *(entry.name for entry in HANDLES),
            "nearest-poses", "pose-regression", "simulation-1e-4",
            *(entry.name for entry in METHODS if entry.role in ("solver", "warm-started")
              and entry.reporting.base != "snug-dynamic"),
        ),
    ),
    Suite(
        name="validation",
        description="physics with an exact answer: measured, expected, tolerance; other meshes and steps",
        scenes=_dependence,
        methods=lambda extent: ["simulation", "skinning", "newton-1"],
        more_methods=("simulation-printed-bending",),
        named_methods=OTHER_SPRINGS,
    ),
    Suite(
        name="extremes",
        description="stiff, huge and degenerate input; methods on a walk made hard: converged, or a "
        "reported failure",
        scenes=_out_of_distribution,
        methods=lambda extent: ["simulation", *FAST, *CHEAP],
        more_methods=tuple(entry.name for entry in FURTHER_METHODS if entry.batched),
    ),
    Suite(
        name="shapes",
        description="a motion on body shapes that no network was trained on: energies against the shape; "
        "only where it is named, or at preset paper",
        scenes=_shapes,
        methods=lambda extent: ["simulation", *ENSEMBLE, "skinning", "snug", SHAPED, "pbns", *CHEAP],
        more_methods=(
            *(entry.name for entry in FURTHER_METHODS if entry.batched and entry.name != SHAPED), *PERTURBED,
        ),
    ),
    Suite(
        name="fabric",
        description="textile tests: bending length and drape by the reference and by every solver stopped "
        "early; only where it is named",
        scenes=lambda extent: [scene.name for scene in (*TEXTILE_TESTS, *extent.fabric_scenes)],
        methods=lambda extent: ["simulation", *UNCERTAINTY, *STOPPED_EARLY],
        default=False,
    ),
    Suite(
        name="engines",
        description="cloth of other engines: laws of mechanics, distance from their own limit, time; only "
        "where it is named",
        default=False,
    ),
)  # fmt: skip

SUITE_NAMES = tuple(suite.name for suite in SUITES)
