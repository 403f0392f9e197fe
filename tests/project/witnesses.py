"""For every judged check of the validation suite a fault of tests/project/faults.py that makes it fail."""

from __future__ import annotations

WITNESSES = {
    "areas doubled": (
        "membrane_energy_scikit_fem", "membrane_gradient_scikit_fem", "membrane_hessian_scikit_fem",
        "membrane_uniaxial_strain", "membrane_uniaxial_stress", "membrane_equibiaxial",
        "membrane_simple_shear", "membrane_collapse", "weight_of_a_square_metre",
        "hinges_folded_scaled", "contact_sampled_area", "contact_force_is_weight", "manufactured_order",
        "manufactured_gradient_order", "catenary_force", "plate_stiffness_right_scaled",
        "plate_stiffness_cross_scaled", "plate_stiffness_union_jack_scaled",
        "plate_stiffness_equilateral_scaled", "slit_annulus_inner", "slit_annulus_outer",
        "end_loaded_cantilever_1", "end_loaded_cantilever_3", "end_loaded_cantilever_10",
        "drum_tension", "drum_pressure",
    ),
    "mu without the thickness": (
        "constant_lame_mu", "rigid_motion_force", "rigid_zero_modes", "stretched_membrane_vibration",
        "newton_order", "lbfgs_distance", "catenary_order", "time_step_order", "catenary_sag",
        "heavy_elastica_10", "heavy_elastica_100", "heavy_elastica_1000",
    ),
    "curvature over 2 A": (
        "curvature_sphere_order", "curvature_cylinder_order", "curvature_torus_order", "curvature_sphere",
        "curvature_cylinder",
    ),
    "half the hinge stiffness": (
        "plate_stiffness_right_unscaled", "plate_stiffness_cross_unscaled",
        "plate_stiffness_union_jack_unscaled", "plate_stiffness_equilateral_unscaled",
    ),
    "velocity backwards": (
        "free_fall", "leaving_point",
    ),
    "lambda and mu swapped": ("pendulum", "numerical_damping_10", "numerical_damping_20"),
    "first vertex feels one neighbour": ("momentum_balance", "angular_momentum_balance"),
    "hinge angle with the wrong sign": ("gradient_of_bending", "hessian_of_bending"),
    "contact dropped from the force": ("gradient_of_collision", "hessian_of_collision"),
    "half the shear stress in the force": ("gradient_of_strain",),
    "strain as seen from above": ("rigid_invariance",),
    "half a spring's force": ("gradient_of_spring",),
    "slack springs stiff across": ("hessian_of_spring",),
    "rest angle added": ("hinges_rest_shape_force",),
    "any step will do": ("newton_never_rises",),
    "convergence ignores the gradient": ("unique_step",),
    "lambda of plane strain": ("constant_lame_lambda",),
    "hinges of ten times the stiffness": ("constant_bending_stiffness",),
    "pins jump in the first sub-step": ("moving_pins_in_substeps",),
    "an obstacle moves on as fast in sub-steps": ("friction_belt_in_substeps",),
    "geometric stiffness with the wrong sign": ("hessian_of_strain",),
    "hinge energy doubled": ("hinges_folded_unscaled",),
    "angle not wrapped": ("hinges_past_half_a_turn",),
    "weight upwards in the force": ("gradient_of_gravity",),
    "inertia over dt in the force": ("hessian_of_inertia",),
    "inertia's energy doubled": ("gradient_of_inertia",),
    "velocity forgets dt": ("energy_inequality",),
    "contact stiffness without the area": ("penalty_depth",),
    "friction of two thirds of the force": (
        "friction_capstan_rough", "friction_capstan_smooth", "friction_capstan_order",
    ),
    "a first step without friction": (
        "friction_slope_below", "friction_slope_at", "friction_slide", "friction_landing",
    ),
    "friction against the ground, not its skin": ("friction_belt",),
    "Newton uphill": ("newton_quadratic",),
    "convergence ignores the step": ("newton_wants_small_steps",),
    "saddles pass for minima": ("newton_leaves_saddles",),
    "rest frame transposed": ("heavy_elastica_1", "lateral_buckling"),
}  # fmt: skip
