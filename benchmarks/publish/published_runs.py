"""The runs that the documents take their numbers from, each with its question and its command."""

from __future__ import annotations

from dataclasses import dataclass, field

RECORDED = (
    "01_01_a,01_01_b,01_01_c,01_01_d,01_01_e,01_01_f,01_01_g,02_07_a,02_07_b,02_07_c,02_07_d,02_07_e,02_07_f,"
    "05_03,06_14,06_15,07_02"
)
MADE = "push_recovery,dance_turn,cartwheel_lean,climbing_steps,sit_and_stand"
ALL_TESTS = f"--test-motions {RECORDED},{MADE}"
REFERENCES = "simulation,simulation-perturbed-1e-4,simulation-refrozen,simulation-1e-8,skinning"
THREE = "--seeds 0,1,2"
OTHERS = (  # learned, of other forms
    "handles-20,handles-40,handles-80,handles-80-dynamic,ncs,ncs-static,nearest-poses,pose-regression"
)


@dataclass(frozen=True)
class PublishedRun:
    """A run that is published.

    Attributes:
        question: that its numbers answer.
        parts: name -> options of `benchmarks.run`; several parts are merged into one folder. They are apart
            where a part has other scenes or times. Later parts begin with what the first has trained.
        pictures: figures that the documents show, by their names in the folder `figures` of the report.
        films: file -> options of `reports.film`, of films that the documents show.
    """

    question: str
    parts: dict[str, str]
    pictures: tuple[str, ...] = ()
    films: dict[str, str] = field(default_factory=dict)

    @property
    def shown(self) -> tuple[str, ...]:
        """Return the files of pictures and films, which lie in the folder `figures`."""
        return (*(f"{name}.png" for name in self.pictures), *self.films)


def _validation(methods: str) -> dict[str, str]:
    """Return the one part of a run on the validation motions."""
    return {"": f"--suite garments --split validation {THREE} --methods '{REFERENCES},{methods}'"}


RUNS = {
    "quick": PublishedRun(
        "all methods on 22 test motions; error against run time on two clips",
        {
            "garments": f"--suite garments {THREE} {ALL_TESTS} --scenes 'tshirt/*' --methods {REFERENCES},"
            "snug,pbns,supervised,fast-lbfgs-10,snug-no-collision,snug+cleanup,"
            f"supervised+cleanup,{OTHERS}",
            "speed": f"--suite speed {THREE} {ALL_TESTS} "
            "--scenes tshirt/push_recovery@clip,tshirt/01_01_a@clip --methods 'simulation,simulation-1e-[28],"
            "simulation-dt/*,simulation-perturbed-*,simulation-refrozen,skinning,snug,supervised,pbns,"
            "fast-lbfgs-*,lbfgs-*,newton-[1248],vbd-20,xpbd-40,gradient-descent-10,skinning+lbfgs-4,"
            f"snug+fast-lbfgs-*,snug+lbfgs-2,snug+newton-2,{OTHERS}'",
        },
        ("energy_series_tshirt-01_01_a", "error_against_time"),
        {
            "push_recovery.gif": "--scene tshirt/push_recovery --methods simulation,snug,pbns,skinning "
            "--width 200"
        },
    ),
    "paper_text": PublishedRun(
        "the recipe of the paper's text and PBNS by it, 136,000 steps at 4378 vertices, on 22 test motions",
        {
            "": f"--preset paper --suite garments {THREE} {ALL_TESTS} --scenes 'tshirt/*' --methods "
            f"{REFERENCES},snug-paper,pbns-paper,supervised"
        },
        ("frames_tshirt-01_01_a", "training"),
    ),
    "paper_supervised": PublishedRun(
        "the supervised network at the same 4378 vertices, trained on simulations of the same frames",
        {
            "": f"--preset paper --suite garments {THREE} {ALL_TESTS} --scenes 'tshirt/*' --methods "
            "simulation,simulation-perturbed-1e-4,skinning,supervised"
        },
    ),
    "fabric": PublishedRun(
        "textile tests of six fabrics by the reference and by every solver stopped early",
        {"": "--suite fabric"},
        ("textile_errors",),
    ),
    "engines": PublishedRun(
        "laws of mechanics and distance from their own limit, of cloth of other engines",
        {"": "--suite engines"},
    ),
    "ablations": PublishedRun(
        "each energy left out of the loss, windows, first states, forms of inertia, springs; Santesteban "
        "2019 and TailorNet; vertices optimised directly",
        _validation("simulation-springs,simulation-pbns-springs,direct-optimisation,snug,snug+cleanup,"
                    "snug-springs,snug-no-*,snug-noise-alone,snug-window6,snug-window12,"
                    "snug-detached-past,snug-two-transitions,pbns,pbns-springs,santesteban2019,tailornet"),
        ("frames_tshirt-sudden_stop",),
    ),
    "handles": PublishedRun(
        "networks of few handles and their floors; Neural Cloth Simulation; learners without training",
        {
            "": f"--suite garments {THREE} --scenes 'tshirt/*' --methods {REFERENCES},snug,snug-floor,pbns,"
            f"handles-20-floor,handles-40-floor,handles-80-floor,{OTHERS}"
        },
    ),
    "self_contact": PublishedRun(
        "the same networks beside a reference whose cloth does not cross itself; one seed",
        {
            "": f"--suite garments --self-contact --trained --scenes 'tshirt/*' --methods {REFERENCES},snug,"
            "pbns,supervised,fast-lbfgs-10"
        },
    ),
    "shapes": PublishedRun(
        "SNUG and PBNS trained on the mean body, and SNUG trained on bodies of many shapes, on 12 others",
        {"": f"--suite shapes {THREE} --methods {REFERENCES},snug,snug-shapes,pbns,fast-lbfgs-10"},
    ),
    "garments": PublishedRun(
        "SNUG and PBNS in three other garments, on eight validation motions; one seed",
        {
            "": "--suite garments --split validation --scenes 'tank_top/*,long_sleeves/*,trousers/*' "
            f"--methods {REFERENCES},snug,pbns"
        },
    ),
    "dynamics": PublishedRun(
        "a network that learns its dynamics from simulations, on eight validation motions; one seed",
        {
            "": f"--suite garments --split validation --scenes 'tshirt/*' --methods {REFERENCES},snug,"
            "snug-dynamic,snug-dynamic+fast-lbfgs-1,snug-dynamic+fast-lbfgs-2,fast-lbfgs-10"
        },
    ),
    "equal_data": PublishedRun(
        "SNUG and the supervised network with the same frames and as many steps, on eight validation motions",
        _validation("snug-data-3,supervised-data-3"),
        ("training",),
    ),
}  # fmt: skip
