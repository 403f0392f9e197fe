"""Known answers that hold to round-off, or to what the solver may leave: closed forms and discrete laws."""

from __future__ import annotations

from benchmarks.validation.case import known_answer

SCIKIT_FEM = tuple(
    known_answer(f"membrane_{what}_scikit_fem",
        f"{title} of the membrane beside scikit-fem's, random 3D state: relative difference",
        "membrane.closed_forms", f"scikit_fem_{what}", expected=0.0, tolerance=1e-12,
        reason="round-off of two assemblies of the same sums")
    for what, title in (("energy", "energy"), ("gradient", "gradient"), ("hessian", "Hessian"))
)  # fmt: skip

CLOSED_FORMS = (
    *(
        known_answer(f"membrane_{state.replace(' ', '_')}",
            f"energy of {state} on a rotated unstructured patch, over its closed form",
            "membrane.closed_forms", "closed_form", options={"state": state}, expected=1.0, tolerance=1e-12,
            reason="round-off of some hundred triangles")
        for state in ("uniaxial strain", "uniaxial stress", "equibiaxial", "simple shear", "collapse")
    ),
    known_answer("membrane_pull", "force on an end of unit width in uniaxial stress, nothing across",
        "membrane.closed_forms", "uniaxial_pull", unit="N", tolerance=1e-11,
        reason="round-off of a sum of ten forces of 1 N"),
    *(
        known_answer(f"constant_{name}", f"{title} of the default cotton, as the paper prints it",
            "membrane.closed_forms", "constant", options={"name": name}, unit="N/m", expected=printed, tolerance=0.051,
            reason="three printed digits")
        for name, title, printed in (("lame_lambda", "lambda", 20.9), ("lame_mu", "mu", 11.1))
    ),
    known_answer("constant_bending_stiffness", "k of the default cotton's hinges, as the paper prints it",
        "membrane.closed_forms", "constant", options={"name": "bending_stiffness"}, unit="J", expected=3.96e-5,
        tolerance=5.1e-8, reason="three printed digits"),
    known_answer("weight_of_a_square_metre",
        "of the default cotton: 426 kg/m^3 times 0.47 mm times 9.81 m/s^2",
        "membrane.closed_forms", "weight_of_a_square_metre", unit="N", expected=426.0 * 0.47e-3 * 9.81, tolerance=1e-12,
        reason="round-off"),
    *(
        known_answer(f"hinges_folded_{title}",
            f"bending energy of a folded strip, {title}, over its closed form",
            "bending.hinges", "folded", options={"scaling": scaling, "fold": fold}, expected=1.0, tolerance=1e-12,
            reason="round-off")
        for title, scaling, fold in (("unscaled", "none", 0.3), ("scaled", "length_area", -1.2))
    ),
    known_answer("hinges_past_half_a_turn",
        "bending energy of folds of -3 rad with rest angles of 3 rad: the short way is 2 pi - 6",
        "bending.hinges", "past_half_a_turn", expected=1.0, tolerance=1e-12, reason="round-off"),
    known_answer("hinges_rest_shape_force", "largest force in a folded strip that was made folded",
        "bending.hinges", "rest_shape_force", unit="N", expected=0.0, tolerance=1e-14,
        reason="round-off of angles times k over a cell of 0.1 m"),
    known_answer("rigid_motion_force", "largest force after a rigid motion of a flat patch, hinges on",
        "membrane.closed_forms", "rigid_motion", unit="N", expected=0.0, tolerance=1e-11,
        reason="round-off of a membrane of 33 N/m moved by 4 m"),
    known_answer("rigid_invariance",
        "relative change of the forces in a disordered patch under a rigid motion",
        "membrane.closed_forms", "rigid_invariance", expected=0.0, tolerance=1e-11,
        reason="round-off of positions some metres from the origin"),
    known_answer("rigid_zero_modes", "zero eigenvalues of the Hessian of a flat patch, hinges on",
        "membrane.closed_forms", "zero_modes", expected=6.0, tolerance=0.0,
        reason="three translations and three rotations, no other"),
)  # fmt: skip

DERIVATIVES = tuple(
    known_answer(f"{kind}_of_{term}",
        f"{kind} of the term {term} beside differences of {of}, relative error",
        "derivatives", f"{kind}_error", options={"term": term}, expected=0.0, tolerance=1e-7,
        reason="round-off over a step of 1e-3, and its fourth power")
    for kind, of in (("gradient", "the energy"), ("hessian", "the gradient"))
    for term in ("strain", "spring", "bending", "gravity", "inertia", "collision", "area_barrier")
    if (kind, term) != ("hessian", "gravity")  # it is zero
)  # fmt: skip

DISCRETE = (
    known_answer("free_fall", "largest distance to backward Euler's own discrete fall over 45 frames",
        "dynamics.discrete_laws", "free_fall", unit="m", expected=0.0, tolerance=1e-12,
        reason="round-off over a fall of 11 m"),
    known_answer("free_fall_in_substeps", "the same with four steps a frame, 10 frames",
        "dynamics.discrete_laws", "free_fall_in_substeps", unit="m", expected=0.0, tolerance=1e-12,
        reason="round-off over a fall of half a metre"),
    known_answer("moving_pins_in_substeps",
        "distance of a sheet, whose pins a motion pulls, with four steps a frame to that of a quarter of the "
        "time step, 10 frames",
        "dynamics.discrete_laws", "moving_pins_in_substeps", unit="m", expected=0.0, tolerance=1e-9,
        reason="round-off of the times at which the pins are asked for"),
    known_answer("stretched_membrane_vibration",
        "largest error of the lowest mode over 30 steps, as a share of its start",
        "dynamics.discrete_laws", "membrane_vibration", expected=0.0, tolerance=1e-8,
        reason="the mode's own nonlinearity, (pi amplitude)^2"),
    known_answer("pendulum",
        "largest distance of an elastic pendulum to its discrete steps solved by scipy, 60 steps",
        "dynamics.oscillators", "pendulum", unit="m", expected=0.0, tolerance=1e-10,
        reason="scipy's tolerance, 1e-12 a step, summed twice"),
    known_answer("rotor", "largest distance of a turning hexagon to its exact discrete steps, 60 steps",
        "dynamics.oscillators", "rotor", unit="m", expected=0.0, tolerance=1e-11,
        reason="round-off of 60 steps, summed twice"),
    known_answer("numerical_damping_10",
        "amplitude left after 1 s at 30 steps a second of a swing at 10 rad/s",
        "dynamics.oscillators", "numerical_damping", options={"frequency": 10.0}, tolerance=1e-5,
        reason="amplitude 1e-5: what is not linear in it"),
    known_answer("numerical_damping_20", "the same at 20 rad/s",
        "dynamics.oscillators", "numerical_damping", options={"frequency": 20.0}, tolerance=1e-5,
        reason="amplitude 1e-5: what is not linear in it"),
    known_answer("momentum_balance",
        "largest error of P' - P = dt sum F over the steps of a crumpling free sheet",
        "dynamics.discrete_laws", "momentum_balance", expected=0.0, tolerance=2e-6,
        reason="the residual gradient that the solver may leave"),
    known_answer("angular_momentum_balance",
        "largest error of L' = L - dt sum m v x v' + dt tau(x') over the same steps, over |L|",
        "dynamics.discrete_laws", "angular_momentum_balance", expected=0.0, tolerance=2e-6,
        reason="the residual gradient that the solver may leave"),
    known_answer("energy_inequality",
        "largest rise of a step's objective above its start, over the kinetic energy",
        "dynamics.discrete_laws", "energy_inequality", expected=0.0, tolerance=1e-9,
        reason="backward Euler only ever loses energy; round-off"),
    known_answer("unique_step", "distance of two ends of one step under the convexity bound, random starts",
        "dynamics.discrete_laws", "unique_step", unit="m", expected=0.0, tolerance=1e-12,
        reason="one minimiser; Newton ends at round-off"),
    known_answer("ambiguous_step",
        "the same at 1/30 s, where there are many minimisers: how far honest solvers may differ",
        "dynamics.discrete_laws", "ambiguous_step", unit="m", smoke=False,
        reason="reported: vertex by vertex agreement means nothing there"),
    known_answer("penalty_depth", "resting depth of a sheet on a plane, as a multiple of sqrt(rho g / (3 k))",
        "contact.plane", "penalty_depth", expected=1.0, tolerance=1e-3,
        reason="the depth follows the load by a square root"),
    known_answer("contact_sampled_area", "area of all contact samples of a cloth over its own",
        "contact.plane", "sampled_area", expected=3.0, tolerance=1e-12,
        reason="vertices, edges and faces carry it once each; round-off"),
    known_answer("contact_force_is_weight", "total contact force over weight of a sheet at rest on a plane",
        "contact.plane", "contact_force", expected=1.0, tolerance=2e-6,
        reason="the residual gradient that the solver may leave"),
)  # fmt: skip

FRICTION = (
    known_answer("friction_creep",
        "speed of a patch on a slope of tan(a) = .8 mu, over (1 - .2^.5) of the smoothing's: it creeps",
        "friction.plane", "creep_speed", options={"ratio": 0.8}, expected=1.0, tolerance=1e-9,
        reason="the residual gradient that the solver may leave"),
    *(
        known_answer(f"friction_slope_{name}",
            f"distance of a patch on a slope of tan(a) = {ratio:g} mu to its exact discrete path, 30 steps",
            "friction.plane", "slope_path", options={"ratio": ratio}, unit="m", expected=0.0, tolerance=1e-10,
            reason="the residual gradient that the solver may leave, summed twice")
        for name, ratio in (("below", 0.8), ("at", 1.0))
    ),
    known_answer("friction_slide",
        "the same at 1.2 mu, to the path of the constant force g (sin a - mu cos a): no smoothing is left",
        "friction.plane", "slide_path", options={"ratio": 1.2}, unit="m", expected=0.0, tolerance=1e-10,
        reason="the residual gradient that the solver may leave, summed twice"),
    known_answer("friction_belt",
        "distance of a patch put at rest on a moving belt to its exact discrete path, 15 steps",
        "friction.plane", "belt_path", unit="m", expected=0.0, tolerance=1e-10,
        reason="the residual gradient that the solver may leave, summed twice"),
    known_answer("friction_belt_in_substeps", "the same with four steps a frame, while the belt moves on",
        "friction.plane", "belt_path", options={"substeps": 4}, unit="m", expected=0.0, tolerance=1e-10,
        reason="the residual gradient that the solver may leave, summed twice"),
    known_answer("friction_landing",
        "speed that a sliding patch keeps when it lands, over v - mu (v_n + g t)",
        "friction.plane", "landing_speed", expected=1.0, tolerance=1e-9,
        reason="what is left of its bounce, and the residual gradient"),
    known_answer("friction_spring_path",
        "distance of a point that a spring pulls along to discrete steps solved by scipy, 300 steps",
        "friction.pull", "spring_path", unit="m", expected=0.0, tolerance=1e-10,
        reason="the residual gradient that the solver may leave, summed twice"),
    known_answer("friction_spring_pull",
        "pull of that spring over mu m g once the point slides: no more than to break it loose",
        "friction.pull", "spring_pull", expected=1.0, tolerance=1e-4,
        reason="what is left of its swing after 300 steps"),
)  # fmt: skip

MINIMISERS = (
    known_answer("newton_quadratic",
        "factorisations for inertia and weight alone: one step, and one to confirm the minimum",
        "solvers.minimisers", "work_on_a_quadratic", expected=2.0, tolerance=0.0,
        reason="Newton's method ends a quadratic in one step"),
    known_answer("newton_order", "order of the last steps of Newton's method on a stretched sheet",
        "solvers.minimisers", "newton_order", expected=2.0, tolerance=0.4,
        reason="three steps are left between 1e-3 m and round-off"),
    known_answer("newton_never_rises",
        "largest rise of the energy from one kept point to the next, from random places",
        "solvers.minimisers", "largest_rise", expected=0.0, tolerance=1e-12, reason="round-off of the energy"),
    known_answer("newton_wants_small_steps",
        "edge lengths from rest at which a strip so soft that its forces are nothing is left",
        "solvers.minimisers", "small_gradient", expected=0.0, tolerance=1e-3,
        reason="what Newton's method calls a negligible step"),
    known_answer("newton_leaves_saddles",
        "negative eigenvalues where a flat start under compression is said to have come to rest",
        "solvers.minimisers", "negative_curvature", expected=0.0, tolerance=0.0, reason="a minimum has none"),
    known_answer("lbfgs_distance",
        "distance of the end of 60 steps of L-BFGS to Newton's, where there is one minimiser",
        "solvers.minimisers", "lbfgs_distance", unit="m", expected=0.0, tolerance=1e-6,
        reason="2e-7, and 15 times that without its memory"),
)  # fmt: skip

CASES = (*SCIKIT_FEM, *CLOSED_FORMS, *DERIVATIVES, *DISCRETE, *FRICTION, *MINIMISERS)
