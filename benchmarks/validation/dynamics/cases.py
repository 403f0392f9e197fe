"""Cases of motion: discrete laws of backward Euler, orders in dt, dependence on mesh and time step."""

from __future__ import annotations

from benchmarks.validation.case import known_answer

DISCRETE_LAWS = (
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
        "dynamics.discrete_laws", "step_distance", options={"share": 0.9}, unit="m", expected=0.0,
        tolerance=1e-12,
        reason="one minimiser; Newton ends at round-off"),
    known_answer("ambiguous_step",
        "the same at 1/30 s, where there are many minimisers: how far honest solvers may differ",
        "dynamics.discrete_laws", "step_distance", options={"share": None}, unit="m", smoke=False,
        reason="reported: vertex by vertex agreement means nothing there"),
)  # fmt: skip

PENDULUM_ORDER = (
    known_answer("time_step_order", "order in dt of the place of an elastic pendulum after half a second",
        "dynamics.oscillators", "time_step_order", expected=1.0, tolerance=0.1,
        reason="backward Euler; its second order still shows at 1/480 s"),
)  # fmt: skip

SHEET_ORDERS = (
    known_answer("membrane_time_step_order", "order in dt of a vibrating membrane, against its exact motion",
        "dynamics.time_steps", "membrane_order", expected=1.0, tolerance=0.1,
        reason="backward Euler; its second order still shows at 1/3840 s"),
    known_answer("swing_time_step_order", "order in dt of a sheet that swings from its upper edge",
        "dynamics.time_steps", "swing_order", expected=1.0, tolerance=0.15,
        reason="backward Euler; faster vibrations still show at 1/1920 s"),
    known_answer("pressed_time_step_order", "order in dt of a taut sheet that a ball is pressed into",
        "dynamics.time_steps", "pressed_order", expected=1.0, tolerance=0.1,
        reason="backward Euler; its second order still shows at 1/1200 s"),
    known_answer("viscous_time_step_order",
        "order in dt of a sheet held at two corners, wrinkled, with viscous edges",
        "dynamics.time_steps", "hanging_sheet_order", options={"viscous": True}, expected=1.0, tolerance=0.1,
        reason="backward Euler; nothing swings too fast for the steps"),
)  # fmt: skip

UNDAMPED = (
    known_answer("hanging_sheet_time_step_order",
        "order in dt of the same sheet as it is, without viscosity",
        "dynamics.time_steps", "hanging_sheet_order", options={"viscous": False},
        reason="reported: its vibrations are too fast for the steps, so the first order does not show"),
    known_answer("chord_time_step_distance",
        "distance of the sheet on the ball to one whose ball moves linearly between frames of 1/30 s",
        "dynamics.time_steps", "chord_distance", unit="m",
        reason="reported: sub-steps converge to the motion along chords, not to the smooth one"),
)  # fmt: skip
