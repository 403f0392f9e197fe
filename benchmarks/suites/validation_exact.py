"""Checks that hold to round-off, or to what the solver may leave: closed forms and discrete laws."""

from __future__ import annotations

from ..check import Check

SCIKIT_FEM = tuple(
    Check(
        name=f"membrane_{what}_scikit_fem",
        description=f"{title} of the membrane beside scikit-fem's, random 3D state: relative difference",
        expected=0.0, tolerance=1e-12, reason="round-off of two assemblies of the same sums",
        module="membrane", function=f"scikit_fem_{what}", smoke=True,
    )
    for what, title in (("energy", "energy"), ("gradient", "gradient"), ("hessian", "Hessian"))
)  # fmt: skip

CLOSED_FORMS = (
    *(
        Check(
            name=f"membrane_{state.replace(' ', '_')}",
            description=f"energy of {state} on a rotated unstructured patch, over its closed form",
            expected=1.0, tolerance=1e-12, reason="round-off of some hundred triangles",
            module="membrane", function="closed_form", arguments=(state,), smoke=True,
        )
        for state in ("uniaxial strain", "uniaxial stress", "equibiaxial", "simple shear", "collapse")
    ),
    Check(
        name="membrane_pull",
        description="force on an end of unit width in uniaxial stress, nothing across",
        unit="N", tolerance=1e-11, reason="round-off of a sum of ten forces of 1 N",
        module="membrane", function="uniaxial_pull", smoke=True,
    ),
    *(
        Check(
            name=f"constant_{name}",
            description=f"{title} of the default cotton, as the paper prints it",
            unit="N/m", expected=printed, tolerance=0.051, reason="three printed digits",
            module="membrane", function="constant", arguments=(name,), smoke=True,
        )
        for name, title, printed in (("lame_lambda", "lambda", 20.9), ("lame_mu", "mu", 11.1))
    ),
    Check(
        name="weight_of_a_square_metre",
        description="of the default cotton: 426 kg/m^3 times 0.47 mm times 9.81 m/s^2",
        unit="N", expected=426.0 * 0.47e-3 * 9.81, tolerance=1e-12, reason="round-off",
        module="membrane", function="weight_of_a_square_metre", smoke=True,
    ),
    *(
        Check(
            name=f"hinges_folded_{title}",
            description=f"bending energy of a folded strip, {title}, over its closed form",
            expected=1.0, tolerance=1e-12, reason="round-off",
            module="hinges", function="folded", arguments=(scaling, fold), smoke=True,
        )
        for title, scaling, fold in (("unscaled", "none", 0.3), ("scaled", "length_area", -1.2))
    ),
    Check(
        name="hinges_past_half_a_turn",
        description="bending energy of folds of -3 rad with rest angles of 3 rad: the short way is 2 pi - 6",
        expected=1.0, tolerance=1e-12, reason="round-off",
        module="hinges", function="past_half_a_turn", smoke=True,
    ),
    Check(
        name="hinges_rest_shape_force",
        description="largest force in a folded strip that was made folded",
        unit="N", expected=0.0, tolerance=1e-14, reason="round-off of angles times k over a cell of 0.1 m",
        module="hinges", function="rest_shape_force", smoke=True,
    ),
    Check(
        name="rigid_motion_force",
        description="largest force after a rigid motion of a flat patch, hinges on",
        unit="N", expected=0.0, tolerance=1e-11, reason="round-off of a membrane of 33 N/m moved by 4 m",
        module="membrane", function="rigid_motion", smoke=True,
    ),
    Check(
        name="rigid_invariance",
        description="relative change of the forces in a disordered patch under a rigid motion",
        expected=0.0, tolerance=1e-11, reason="round-off of positions some metres from the origin",
        module="membrane", function="rigid_invariance", smoke=True,
    ),
    Check(
        name="rigid_zero_modes",
        description="zero eigenvalues of the Hessian of a flat patch, hinges on",
        expected=6.0, tolerance=0.0, reason="three translations and three rotations, no other",
        module="membrane", function="zero_modes", smoke=True,
    ),
)  # fmt: skip

DERIVATIVES = tuple(
    Check(
        name=f"{kind}_of_{term}",
        description=f"{kind} of the term {term} beside differences of {of}, relative error",
        expected=0.0, tolerance=1e-7, reason="round-off over a step of 1e-3, and its fourth power",
        module="derivatives", function=f"{kind}_error", arguments=(term,), smoke=True,
    )
    for kind, of in (("gradient", "the energy"), ("hessian", "the gradient"))
    for term in ("strain", "spring", "bending", "gravity", "inertia", "collision", "area_barrier")
    if (kind, term) != ("hessian", "gravity")  # it is zero
)  # fmt: skip

DISCRETE = (
    Check(
        name="free_fall",
        description="largest distance to backward Euler's own discrete fall over 45 frames",
        unit="m", expected=0.0, tolerance=1e-12, reason="round-off over a fall of 11 m",
        module="dynamics", function="free_fall", smoke=True,
    ),
    Check(
        name="free_fall_in_substeps",
        description="the same with four steps a frame, 10 frames",
        unit="m", expected=0.0, tolerance=1e-12, reason="round-off over a fall of half a metre",
        module="dynamics", function="free_fall_in_substeps", smoke=True,
    ),
    Check(
        name="stretched_membrane_vibration",
        description="largest error of the lowest mode over 30 steps, as a share of its start",
        expected=0.0, tolerance=1e-8, reason="the mode's own nonlinearity, (pi amplitude)^2",
        module="dynamics", function="membrane_vibration", smoke=True,
    ),
    Check(
        name="pendulum",
        description="largest distance of an elastic pendulum to its discrete steps solved by scipy, 60 steps",
        unit="m", expected=0.0, tolerance=1e-10, reason="scipy's tolerance, 1e-12 a step, summed twice",
        module="few_masses", function="pendulum", smoke=True,
    ),
    Check(
        name="rotor",
        description="largest distance of a turning hexagon to its exact discrete steps, 60 steps",
        unit="m", expected=0.0, tolerance=1e-11, reason="round-off of 60 steps, summed twice",
        module="few_masses", function="rotor", smoke=True,
    ),
    Check(
        name="numerical_damping_10",
        description="amplitude left after 1 s at 30 steps a second of a swing at 10 rad/s",
        tolerance=1e-5, reason="amplitude 1e-5: what is not linear in it",
        module="few_masses", function="numerical_damping", arguments=(10.0,), smoke=True,
    ),
    Check(
        name="numerical_damping_50",
        description="the same at 50 rad/s: backward Euler leaves nothing",
        tolerance=1e-6, reason="what is not linear in an amplitude of 1e-5, and its round-off",
        module="few_masses", function="numerical_damping", arguments=(50.0,), smoke=True,
    ),
    Check(
        name="momentum_balance",
        description="largest error of P' - P = dt sum F over the steps of a crumpling free sheet",
        expected=0.0, tolerance=2e-6, reason="the residual gradient that the solver may leave",
        module="dynamics", function="momentum_balance", smoke=True,
    ),
    Check(
        name="angular_momentum_balance",
        description="largest error of L' = L - dt sum m v x v' + dt tau(x') over the same steps, over |L|",
        expected=0.0, tolerance=2e-6, reason="the residual gradient that the solver may leave",
        module="dynamics", function="angular_momentum_balance", smoke=True,
    ),
    Check(
        name="energy_inequality",
        description="largest rise of a step's objective above its start, over the kinetic energy",
        expected=0.0, tolerance=1e-9, reason="backward Euler only ever loses energy; round-off",
        module="dynamics", function="energy_inequality", smoke=True,
    ),
    Check(
        name="unique_step",
        description="distance of two ends of one step under the convexity bound, random starts",
        unit="m", expected=0.0, tolerance=1e-12, reason="one minimiser; Newton ends at round-off",
        module="dynamics", function="unique_step", smoke=True,
    ),
    Check(
        name="ambiguous_step",
        description="the same at 1/30 s, where there are many minimisers: how far honest solvers may differ",
        unit="m", reason="reported: vertex by vertex agreement means nothing there",
        module="dynamics", function="ambiguous_step",
    ),
    Check(
        name="penalty_depth",
        description="resting depth of a sheet on a plane, as a multiple of sqrt(rho g / (3 k))",
        expected=1.0, tolerance=1e-3, reason="the depth follows the load by a square root",
        module="contact", function="penalty_depth", smoke=True,
    ),
    Check(
        name="contact_sampled_area",
        description="area of all contact samples of a cloth over its own",
        expected=3.0, tolerance=1e-12, reason="vertices, edges and faces carry it once each; round-off",
        module="contact", function="sampled_area", smoke=True,
    ),
    Check(
        name="contact_force_is_weight",
        description="total contact force over weight of a sheet at rest on a plane",
        expected=1.0, tolerance=2e-6, reason="the residual gradient that the solver may leave",
        module="contact", function="contact_force", smoke=True,
    ),
)  # fmt: skip

MINIMISERS = (
    Check(
        name="newton_quadratic",
        description="factorisations for inertia and weight alone: one step, and one to confirm the minimum",
        expected=2.0, tolerance=0.0, reason="Newton's method ends a quadratic in one step",
        module="minimisers", function="work_on_a_quadratic", smoke=True,
    ),
    Check(
        name="newton_order",
        description="order of the last steps of Newton's method on a stretched sheet",
        expected=2.0, tolerance=0.4, reason="three steps are left between 1e-3 m and round-off",
        module="minimisers", function="newton_order", smoke=True,
    ),
    Check(
        name="newton_never_rises",
        description="largest rise of the energy from one kept point to the next, from random places",
        expected=0.0, tolerance=1e-12, reason="round-off of the energy",
        module="minimisers", function="largest_rise", smoke=True,
    ),
    Check(
        name="newton_wants_small_steps",
        description="edge lengths from rest at which a strip so soft that its forces are nothing is left",
        expected=0.0, tolerance=1e-3, reason="what Newton's method calls a negligible step",
        module="minimisers", function="small_gradient", smoke=True,
    ),
    Check(
        name="newton_leaves_saddles",
        description="negative eigenvalues where a flat start under compression is said to have come to rest",
        expected=0.0, tolerance=0.0, reason="a minimum has none",
        module="minimisers", function="negative_curvature", smoke=True,
    ),
    Check(
        name="lbfgs_distance",
        description="distance of the end of 60 steps of L-BFGS to Newton's, where there is one minimiser",
        unit="m", expected=0.0, tolerance=1e-6, reason="2e-7, and 15 times that without its memory",
        module="minimisers", function="lbfgs_distance", smoke=True,
    ),
)  # fmt: skip

CHECKS = (*SCIKIT_FEM, *CLOSED_FORMS, *DERIVATIVES, *DISCRETE, *MINIMISERS)
