"""Cases: the visible tuples, from the cases.py of each room. Listing them imports nothing that measures.

Each room declares its cases in its `cases.py`, beside the modules that measure them. The smallest preset runs
those marked `smoke`. Known answers without a tolerance are reported, not judged.
"""

from __future__ import annotations

from benchmarks.validation.bending import cases as bending
from benchmarks.validation.case import Case
from benchmarks.validation.contact import cases as contact
from benchmarks.validation.curvature import cases as curvature
from benchmarks.validation.dynamics import cases as dynamics
from benchmarks.validation.engines import cases as engines
from benchmarks.validation.fabric import cases as fabric
from benchmarks.validation.friction import cases as friction
from benchmarks.validation.membrane import cases as membrane
from benchmarks.validation.solvers import cases as solvers
from benchmarks.validation.stress import cases as stress

# Answers that hold to round-off, or to what the solver may leave: closed forms and discrete laws.
EXACT: tuple[Case, ...] = (
    *membrane.SCIKIT_FEM, *membrane.CLOSED_FORMS, *bending.FOLDS, *membrane.RIGID_MOTIONS,
    *solvers.DERIVATIVES, *dynamics.DISCRETE_LAWS, *contact.PLANE, *friction.DISCRETE_PATHS,
    *solvers.MINIMISERS,
)  # fmt: skip
# Answers whose error has a declared order, measured by slope over three meshes or time steps.
ORDERS: tuple[Case, ...] = (
    *membrane.ORDERS, *dynamics.PENDULUM_ORDER, *contact.SPHERE_ORDER, *dynamics.SHEET_ORDERS,
    *curvature.ORDERS, *membrane.STRINGS, *curvature.VALUES, *curvature.IRREGULAR, *dynamics.UNDAMPED,
)  # fmt: skip
# Answers by a reference that is solved independently, by scipy or scikit-fem, in the case itself.
REFERENCES: tuple[Case, ...] = (
    *bending.STIFFNESS, *bending.SUPPORTED, *bending.ELASTICA, *membrane.CLAMPED, *contact.DRUM,
    *friction.CAPSTAN_AND_STRIP, *contact.SPHERE, *bending.TORSION,
)  # fmt: skip

KNOWN_ANSWERS: tuple[Case, ...] = (*EXACT, *ORDERS, *REFERENCES)
STRESS_TESTS: tuple[Case, ...] = stress.CASES
CASES: tuple[Case, ...] = (*KNOWN_ANSWERS, *STRESS_TESTS, *fabric.TEXTILE_TESTS, *engines.CASES)
