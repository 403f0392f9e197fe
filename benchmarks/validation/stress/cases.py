"""Stress tests: one time step each, which has to converge truly, or to fail and say so.

What counts as passing: the energy did not rise, everything is finite, and a claim of convergence is true, by
a path that shares no kernel with the solver (convergence_check.py). A false claim, a NaN, a crash and a hang
are failed rows; an honest "stalled", "diverged" or "timeout" keeps that name and its reason. Two maps repeat
one step over stiffness and time step.
"""

from __future__ import annotations

from typing import Any

from benchmarks.validation.case import RELATIVE_RESIDUAL, Case

DEADLINE = 60.0  # [s] for one test, after which its process is ended
ALL = "membrane+bending+area"


def _sheet(name: str, description: str, *, smoke: bool = False, **options: Any) -> Case:
    """Declare one step of a sheet that differs by `options` from an ordinary one, see sheet_steps."""
    return _solved(name, description, "stress.sheet_steps", "solve_sheet", options, smoke)


def _shirt(name: str, description: str, **options: Any) -> Case:
    """Declare one step of a T-shirt on a body, see tshirt_steps."""
    return _solved(name, description, "stress.tshirt_steps", "solve_shirt", options, False)


def _solved(
    name: str, description: str, module: str, function: str, options: dict[str, Any], smoke: bool
) -> Case:
    return Case(
        name=name, suite="extremes", description=description, smoke=smoke, seconds=DEADLINE,
        module=f"benchmarks.validation.{module}", function=function, options=options,
        metric="outcome", expected=0.0, tolerance=RELATIVE_RESIDUAL,
    )  # fmt: skip


def stability_map(
    name: str, what: str, module: str, function: str, *, long: bool = False
) -> tuple[Case, ...]:
    """Declare the iterations of one step at every stiffness and time step, the rows of one scene."""
    return tuple(
        Case(
            name=f"{name}/{factor:g}/{dt:.3g}", scene=name, suite="extremes", seconds=DEADLINE, long=long,
            description=f"{what}: stiffness x{factor:g}, dt = {dt:.3g} s",
            module=f"benchmarks.validation.{module}", function=function,
            options={"stiffness": factor, "dt": dt, "counted": True}, map_point=(factor, dt),
            metric=f"map/{factor:g}/{dt:.3g}", unit="iterations",
        )
        for factor in (1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6)
        for dt in (1e-4, 1e-3, 1e-2, 1 / 30, 0.1, 1.0)
    )  # fmt: skip


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
    _sheet("printed_bending", "hinges not scaled, as the SNUG paper prints them, x1e4", scaling="none",
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

MAPS = {
    "map_sheet": stability_map("map_sheet", "the sheet", "stress.sheet_steps", "solve_sheet"),
    "map_shirt": stability_map("map_shirt", "the T-shirt", "stress.tshirt_steps", "solve_shirt", long=True),
}

CASES = (*STEPS, *MAPS["map_sheet"], *MAPS["map_shirt"])
