"""The visible tuple of extreme cases: what each does to an ordinary step. Listing them imports nothing."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Case:
    """One row. `function` of a module of benchmarks.checks makes it, from `options`.

    metric: "outcome" of one hard step, "refusal" of a bad input, or a point "map/<stiffness>/<dt>". `smoke`
    marks those that the smallest preset runs.
    """

    name: str
    description: str
    function: str
    options: dict[str, Any] = field(default_factory=dict)
    metric: str = "outcome"
    scene: str = ""  # the row's, where it is not the name
    smoke: bool = False

    @property
    def kind(self) -> str:
        return self.metric.partition("/")[0]


def _sheet(name: str, description: str, *, smoke: bool = False, **options: Any) -> Case:
    function = "hard_steps:sheet"
    return Case(name=name, description=description, function=function, options=options, smoke=smoke)


def _shirt(name: str, description: str, **options: Any) -> Case:
    return Case(name=name, description=description, function="hard_dressing:shirt", options=options)


def _bad(name: str, description: str, naming: str, *, smoke: bool = False) -> Case:
    return Case(
        name=f"refused/{name}",
        description=description,
        function=f"refusals:{name}",
        options={"naming": naming},
        metric="refusal",
        smoke=smoke,
    )


STIFFNESS = (1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6)
TIME_STEPS = (1e-4, 1e-3, 1e-2, 1 / 30, 0.1, 1.0)

ALL = "membrane+bending+area"

STEPS = (
    # Material
    _sheet("stiffness_x0.001", "Young's modulus 70 Pa: it can hardly carry itself", stiffness=1e-3),
    _sheet("stiffness_x0.01", "Young's modulus 700 Pa", stiffness=1e-2),
    _sheet("stiffness_x10", "Young's modulus 700 kPa", stiffness=1e1),
    _sheet("stiffness_x100", "Young's modulus 7 MPa", stiffness=1e2),
    _sheet("stiffness_x1000", "Young's modulus 70 MPa", stiffness=1e3, smoke=True),
    _sheet("stiffness_x10000", "Young's modulus 0.7 GPa", stiffness=1e4),
    _sheet("stiffness_x100000", "Young's modulus 7 GPa", stiffness=1e5),
    _sheet("stiffness_x1000000", "Young's modulus 70 GPa, that of glass", stiffness=1e6),
    _sheet("bending_ratio_1e-8", "hinge over membrane stiffness 1e-8: next to no bending", ratio=1e-8),
    _sheet("bending_ratio_1e-6", "hinge over membrane stiffness 1e-6", ratio=1e-6),
    _sheet("bending_ratio_1e-4", "hinge over membrane stiffness 1e-4", ratio=1e-4),
    _sheet("bending_ratio_1e-2", "hinge over membrane stiffness 1e-2", ratio=1e-2),
    _sheet("bending_ratio_1", "hinges as stiff as the membrane", ratio=1.0),
    _sheet("stiff_board", "everything a thousandfold stiff: a board", stiffness=1e3, bending=1e3),
    _sheet("bending_alone", "hinges and no membrane", terms="bending"),
    _sheet("membrane_alone", "no hinges: wrinkles cost nothing", terms="membrane"),
    _sheet("mass_x1e-6", "a millionth of the mass", mass=1e-6),
    _sheet("mass_x1e-3", "a thousandth of the mass", mass=1e-3),
    _sheet("mass_x1000", "a thousandfold mass", mass=1e3),
    # Time step
    _sheet("time_step_0.1ms", "dt = 1e-4 s", dt=1e-4),
    _sheet("time_step_1ms", "dt = 1e-3 s", dt=1e-3),
    _sheet("time_step_10ms", "dt = 1e-2 s", dt=1e-2),
    _sheet("time_step_100ms", "dt = 0.1 s", dt=0.1),
    _sheet("time_step_1s", "dt = 1 s: next to nothing is left of inertia", dt=1.0, smoke=True),
    _sheet("no_inertia", "statics: the sheet hangs from two corners", dt=None),
    _sheet("no_inertia_stiff", "statics, stiffness x1000", dt=None, stiffness=1e3),
    _sheet("time_step_0.1ms_stiff", "dt = 1e-4 s, stiffness x1e6", dt=1e-4, stiffness=1e6),
    # Speeds
    _sheet("speed_10", "random velocities of 10 m/s", speed=10.0),
    _sheet("speed_100", "random velocities of 100 m/s: 80 cells a step", speed=100.0),
    _sheet("thrown_100", "thrown at 100 m/s, held at two corners", speed="thrown at 100 m/s"),
    _sheet("thrown_free", "thrown at 100 m/s, held nowhere", speed="thrown at 100 m/s", pins="none"),
    _sheet("spinning", "2.7 turns in one step", speed="spinning at 500 rad/s", pins="none"),
    _sheet("torn_apart", "two halves apart at 200 m/s", speed="halves apart at 100 m/s", pins="none"),
    # Weight
    _sheet("gravity_x100", "a hundred times the weight", gravity=100.0),
    _sheet("gravity_x1000", "a thousand times the weight", gravity=1000.0),
    _sheet("gravity_x1000_static", "a thousand times the weight, without inertia", gravity=1e3, dt=None),
    _sheet("weightless", "no weight, no pins, no velocity", gravity=0.0, pins="none", speed=0.0),
    # Starts
    _sheet("flat_saddle", "exactly flat, no velocity, no weight, squeezed nowhere: at rest",
           start="flat", gravity=0.0, speed=0.0),
    _sheet("squeezed_50", "half its width, flat up to a micrometre (a saddle by symmetry)",
           start="squeezed to 50 %", speed=0.0),
    _sheet("squeezed_70", "30 % of its width, flat up to a micrometre (a saddle by symmetry)",
           start="squeezed to 30 %", speed=0.0, smoke=True),
    _sheet("squeezed_both", "30 % of its width and length", start="squeezed to 30 % both ways", speed=0.0),
    _sheet("shrunk", "a thousandth of its size", start="a thousandth", speed=0.0),
    _sheet("squeezed_stiff", "30 % of its width, stiffness x1000", start="squeezed to 30 %", stiffness=1e3),
    _sheet("stretched_2", "twice its width", start="stretched to 200 %"),
    _sheet("stretched_10", "ten times its size", start="stretched to 1000 %"),
    _sheet("mirrored", "every triangle inverted", start="mirrored"),
    _sheet("folded_180", "one half flat on the other", start="folded by 180", speed=0.0),
    _sheet("folded_past_180", "one half through the other", start="folded past 180", speed=0.0),
    _sheet("pleated", "eight folds of 178 degrees", start="pleated by 89"),
    _sheet("rolled_up", "rolled up in three turns through itself", start="rolled up"),
    _sheet("twisted", "twisted by two turns", start="twisted"),
    _sheet("random_start", "every vertex anywhere in 0.4 m", start="anywhere", smoke=True),
    _sheet("random_start_static", "every vertex anywhere, without inertia", start="anywhere", dt=None),
    _sheet("random_start_40m", "every vertex anywhere in 40 m", start="anywhere in 40 m"),
    _sheet("very_noisy", "noise of one cell", start="very noisy"),
    _sheet("shuffled", "every vertex in the place of another", start="shuffled"),
    _sheet("spike", "one vertex 10 m away", start="spike"),
    _sheet("line", "all vertices on a line, up to a micrometre", start="line"),
    _sheet("one_point", "all vertices at one point: a saddle (no hinges: they have no angle there)",
           start="point", terms="membrane", pins="none", speed=0.0),
    _sheet("one_point_weightless", "the same without weight: the force is zero, to the last bit",
           start="point", terms="membrane", pins="none", speed=0.0, gravity=0.0, smoke=True),
    _sheet("nearly_one_point", "all vertices within a nanometre, with hinges",
           start="nearly a point", pins="none", speed=0.0),
    _sheet("one_point_hinges", "all vertices at one point, with hinges: their energy has no value",
           start="point", pins="none", speed=0.0),
    _sheet("collapsed_triangle", "two neighbours at one place, with hinges: no value either",
           start="collapsed triangle"),
    # Hinges
    _sheet("hinge_through_pi", "folded by 180 degrees and closing at 30 rad/s",
           start="folded by 180", speed="closing at 30 rad/s"),
    _sheet("hinge_stiff_through_pi", "the same with hinges x1e4",
           start="folded by 180", speed="closing at 30 rad/s", bending=1e4),
    _sheet("rest_angle_90", "every hinge wants 90 degrees", rest_angles=1.5707963, bending=100.0),
    _sheet("rest_angle_180", "every hinge wants to be shut", rest_angles=3.1415, bending=100.0),
    _sheet("rest_angles_random", "rest angles anywhere within half a turn", rest_angles="random",
           bending=100.0),
    _sheet("bowl", "a rest shape that no flat sheet has", shape="bowl", start="very noisy"),
    _sheet("length_area_scaling", "hinges scaled by length and area, x1e4", scaling="length_area",
           bending=1e4),
    # What collapses without the area barrier, with it
    _sheet("stiffness_x0.001_barrier", "stiffness x0.001 with the area barrier", stiffness=1e-3, terms=ALL),
    _sheet("stiffness_x0.01_barrier", "stiffness x0.01 with the area barrier", stiffness=1e-2, terms=ALL),
    _sheet("hinge_stiff_through_pi_barrier", "hinges x1e4 through 180 degrees with the area barrier",
           start="folded by 180", speed="closing at 30 rad/s", bending=1e4, terms=ALL),
    _sheet("rest_angle_90_barrier", "every hinge wants 90 degrees, with the area barrier",
           rest_angles=1.5707963, bending=100.0, terms=ALL),
    _sheet("rest_angle_180_barrier", "every hinge wants to be shut, with the area barrier",
           rest_angles=3.1415, bending=100.0, terms=ALL),
    _sheet("rest_angles_random_barrier", "random rest angles with the area barrier", rest_angles="random",
           bending=100.0, terms=ALL),
    _sheet("sliver_row_barrier", "a row of slivers with the area barrier", shape="sliver row",
           start="flat", terms=ALL),
    # Meshes
    _sheet("slivers", "every triangle a sliver of aspect 1e4", shape="slivers"),
    _sheet("slivers_flat", "slivers, no noise and no velocity", shape="slivers", start="flat", speed=0.0),
    _sheet("sliver_row", "one row of slivers of aspect 1e4 between even triangles", shape="sliver row",
           start="flat"),
    _sheet("tiny", "a sheet of 0.4 mm", size=1e-3, start="flat"),
    _sheet("huge", "a sheet of 40 m", size=100.0),
    _sheet("a_kilometre_away", "1 km from its pins", start="a kilometre away"),
    # Bodies
    _sheet("body_teleport", "a ball appears inside the sheet", body="ball", smoke=True),
    _sheet("body_teleport_stiff", "the same with contact x1e4", body="ball", contact=1e4),
    _sheet("start_inside", "the whole sheet deep inside a ball of 1 m", body="big ball"),
    _sheet("start_inside_free", "the same, held nowhere", body="big ball", pins="none"),
    _sheet("body_pea", "a body an eighth of a cell wide", body="pea"),
    _sheet("body_plate", "a body thinner than the contact margin", body="plate"),
    _sheet("body_blade", "a body with a sharp edge, 2 mm wide", body="blade", pins="none"),
    _sheet("body_at_90", "falling at 90 m/s onto a ball", body="ball far below", pins="none",
           speed="falling at 90 m/s"),
    _sheet("body_squeezed_stiff", "a ball, stiffness x1000, 30 % of its width", body="ball", stiffness=1e3,
           start="squeezed to 30 %"),
    # A T-shirt of 300 vertices on a body
    _shirt("shirt_step", "an ordinary step of the T-shirt"),
    _shirt("shirt_body_teleport", "the body jumps sideways by half a metre, the shirt does not", jump=0.5),
    _shirt("shirt_pose_jump", "both arms go down by 60 degrees in one frame", arms=60.0),
    _shirt("shirt_turned", "the body turns by 180 degrees in one frame, the shirt does not", turn=180.0),
    _shirt("shirt_stiff_x1000", "stiffness x1000", stiffness=1e3),
    _shirt("shirt_gravity_x1000", "a thousand times the weight", gravity=1e3),
    _shirt("shirt_squeezed", "the shirt starts at half its size: all inside the body", scale=0.5),
    _shirt("shirt_inflated", "the shirt starts at twice its size", scale=2.0),
    _shirt("shirt_noisy", "noise of 2 cm", noise=0.02),
    _shirt("shirt_speed_100", "random velocities of 100 m/s", speed=100.0),
)  # fmt: skip

REFUSALS = (
    _bad("zero_area", "a face without rest area", "face 3", smoke=True),
    _bad("zero_area_uv", "a face without area in its flat pattern", "face 3"),
    _bad("coincident_vertices", "two vertices at one place", "vertices 2 and 81"),
    _bad("unused_vertex", "a vertex in no face", "vertex 81"),
    _bad("repeated_corner", "a face that names a vertex twice", "face 3"),
    _bad("non_manifold_edge", "three faces at an edge", "edge"),
    _bad("inconsistent_winding", "neighbours wound against each other", "walk edge"),
    _bad("nan_vertex", "a NaN at rest", "vertex 5"),
    _bad("infinite_vertex", "an infinite position at rest", "vertex 5"),
    _bad("vertex_out_of_range", "a face that names a vertex there is not", "face 3"),
    _bad("wrong_shape", "positions (V, 2)", "(81, 2)"),
    _bad("pin_out_of_range", "a pin that is no vertex", "pin 999"),
    _bad("nan_start", "a NaN at the start of a simulation", "start"),
    _bad("negative_stiffness", "a Young's modulus below zero", "young_modulus"),
    _bad("poisson_ratio", "a Poisson ratio of 0.7", "poisson_ratio"),
    _bad("zero_time_step", "dt = 0", "dt"),
    _bad("open_body", "a body with a hole", "not closed", smoke=True),
    _bad("inside_out_body", "a body wound inwards", "inside out"),
    _bad("nan_body", "a NaN in the motion of a body", "vertex 4 of frame 1"),
    _bad("two_cloths", "terms of two cloths in one potential", "another cloth"),
)


def _map(name: str, what: str, function: str) -> tuple[Case, ...]:
    return tuple(
        Case(
            name=f"{name}/{factor:g}/{dt:.3g}",
            description=f"{what}: stiffness x{factor:g}, dt = {dt:.3g} s",
            function=function,
            options={"stiffness": factor, "dt": dt},
            metric=f"map/{factor:g}/{dt:.3g}",
            scene=name,
        )
        for factor in STIFFNESS
        for dt in TIME_STEPS
    )


MAPS = {
    "map_sheet": _map("map_sheet", "the sheet", "hard_steps:sheet"),
    "map_shirt": _map("map_shirt", "the T-shirt", "hard_dressing:shirt"),
}

CASES = (*STEPS, *REFUSALS, *MAPS["map_sheet"], *MAPS["map_shirt"])
