"""One-line faults in the metrics, by the file of tests that has to notice each."""

from __future__ import annotations

from tests.project.faults import Fault

ENERGY_GAP, STEP, ENERGY, CURVATURE, DISTANCES, BODY, HEM, DYNAMICS, EXCESS, CONSERVATION = (
    f"benchmarks/metrics/{name}.py"
    for name in (
        "energies/energy_gap", "energies/replayed_step", "energies/energy", "surface/curvature",
        "surface/penetration_and_distances", "surface/body_intersections", "motion/hem", "motion/dynamics",
        "energies/excess", "motion/conservation",
    )
)  # fmt: skip
SELF, STRETCHES, VELOCITY, SWEPT, WRINKLES, SURFACES = (
    f"benchmarks/metrics/{name}.py"
    for name in (
        "surface/self_intersections", "surface/principal_stretches", "motion/velocity_error",
        "surface/swept_crossings", "surface/wrinkle_spectrum", "surface/surface_distance",
    )
)  # fmt: skip
FRICTION = "reference_sim/energies/contact_friction.py"

METRIC_FAULTS = {
    "benchmarks/metrics/test_energy_gap": (
        Fault("gap of the frame before", ENERGY_GAP, "ascontiguousarray(positions[frame])\n        guess",
              "ascontiguousarray(positions[frame - 1])\n        guess"),
        Fault("past one frame late", STEP, "previous = positions[max(frame - 1, 0)]",
              "previous = positions[max(frame - 2, 0)]"),
        Fault("velocity over two steps", STEP, "2, 0)]) / scene.dt", "2, 0)]) / (2 * scene.dt)"),
        Fault("scale of the guess alone", ENERGY_GAP, "potential.value(start) - potential.value(here)",
              "potential.value(start)"),
        Fault("gap to the minimum below", ENERGY_GAP, "append(here - best)", "append(here - below.energy)"),
        Fault("warm-up judged", ENERGY_GAP, "range(scene.warm_up, len(", "range(2, len("),
        Fault("areas of the frame instead of the minimum", ENERGY_GAP,
              "ours, _ = mean_curvature(x, faces)\n    theirs, areas = mean_curvature(y, faces)",
              "ours, areas = mean_curvature(x, faces)\n    theirs, _ = mean_curvature(y, faces)"),
        Fault("distance of coordinates", ENERGY_GAP, "np.linalg.norm(x - y, axis=1)",
              "np.abs(x - y).mean(axis=1)"),
        Fault("standard error of an endless population", ENERGY_GAP, "left = 1.0 - count / self.judged",
              "left = 1.0"),
        Fault("planes not searched again", ENERGY_GAP, "positions, frame, guess=x)", "positions, frame)"),
    ),
    "reference_sim/energies/test_friction": (
        Fault("terms copied one by one", STEP,
              "vars(twin).update({name: twins[id(v)] for name, v in vars(twin).items() if id(v) in twins})",
              "pass"),
        Fault("the step before not prepared", STEP, "if frame > 1 and", "if frame < 0 and"),
    ),
    "benchmarks/metrics/test_curvature": (
        Fault("curvature areas of the wrong surface", CURVATURE, "reference.curvature), reference.area",
              "reference.curvature), series.area"),
    ),
    "benchmarks/metrics/test_metrics": (
        Fault("gravity at a fixed height", ENERGY, "scene.origin_heights[frame] - term.origin_height",
              "scene.origin_heights[0] - term.origin_height"),
        Fault("inertia of half the velocity", STEP, "2, 0)]) / scene.dt", "2, 0)]) / (2 * scene.dt)"),
        Fault("inside by the skin itself", BODY, "x + OFFSET * vertex_normals",
              "x - OFFSET * vertex_normals"),
        Fault("inside at rest too", BODY, "& ~at_rest", ""),
        Fault("depth outside too", DISTANCES, "inside = trajectories[k][frame], distance < 0.0",
              "inside = trajectories[k][frame], distance < 0.3"),
        Fault("area of equal weights", DISTANCES, "weights = samples[k].weights(x)",
              "weights = np.ones(len(distance))"),
        Fault("centroids of too little weight", DISTANCES, "0.45 * areas", "0.15 * areas"),
        Fault("histogram of equal weights", CURVATURE, "area / area.sum(), -area_ref / area_ref.sum()",
              "area / area.sum(), -np.full(len(area_ref), 1 / len(area_ref))"),
        Fault("contours from one side", SELF, "faces[f], faces[e], ends, crossings)",
              "faces[f], faces[e], ends, 0)"),
        Fault("crossings at the end of an edge", SELF, "before / (before - behind)", "1.0"),
    ),
    "benchmarks/metrics/test_principal_stretches": (
        Fault("tension for compression", STRETCHES, "[np.maximum(mean - radius, 0.0), mean + radius]",
              "[mean + radius, np.maximum(mean - radius, 0.0)]"),
        Fault("no shear", STRETCHES, "np.hypot(half, (along * across).sum(-1))", "np.abs(half)"),
        Fault("areas of other triangles", STRETCHES, "np.cumsum(weights.ravel()[order])",
              "np.cumsum(weights.ravel())"),
        Fault("stretches of the warm-up", STRETCHES, "positions[roll_out.judged]", "positions"),
    ),
    "benchmarks/metrics/test_velocity_error": (
        Fault("reference one frame late", VELOCITY, "- reference.positions[frames]",
              "- np.roll(reference.positions, 1, axis=0)[frames]"),
        Fault("reference reversed", VELOCITY, "- reference.positions[frames]",
              "+ reference.positions[frames]"),
        Fault("acceleration over one step", VELOCITY, "axis=0) / dt**order", "axis=0) / dt"),
    ),
    "benchmarks/metrics/test_swept_crossings": (
        Fault("near is through", SWEPT, "conservative_rescaling=1.0", "conservative_rescaling=0.8"),
        Fault("planes at the ends alone", SWEPT, "coefficients.min(axis=0), coefficients.max(axis=0)",
              "coefficients[[0, 3]].min(axis=0), coefficients[[0, 3]].max(axis=0)"),
        Fault("one frame twice", SWEPT, "swept_crossings(x[step], x[step + 1]",
              "swept_crossings(x[step + 1], x[step + 1]"),
    ),
    "benchmarks/metrics/test_wrinkle_spectrum": (
        Fault("curvature without its sign", WRINKLES, "along = (laplacian * normals).sum(axis=-1)",
              "along = np.linalg.norm(laplacian, axis=-1)"),
        Fault("half waves", WRINKLES, "lengths = 2.0 * np.pi /", "lengths = np.pi /"),
        Fault("spectrum one frame late", WRINKLES, "- theirs[frames])",
              "- np.roll(theirs, 1, axis=0)[frames])"),
        Fault("spectrum at the boundary", WRINKLES, "interior[cloth.faces].all(axis=1)",
              "interior[cloth.faces].any(axis=1)"),
    ),
    "benchmarks/metrics/test_surface_distance": (
        Fault("one way", SURFACES, "(forth[0] + back[0]) / 2.0", "forth[0]"),
        Fault("every vertex alike", SURFACES, "np.repeat(triangle_areas(x, faces), 3), len(x))",
              "minlength=len(x))"),
        Fault("squared distances", SURFACES, "np.stack([np.sqrt(squared), angles])",
              "np.stack([squared, angles])"),
        Fault("other surface one frame late", SURFACES, "y[frame], others)", "y[frame - 1], others)"),
        Fault("normals without a side", SURFACES, "(here * of_nearest).sum(axis=1)",
              "np.abs((here * of_nearest).sum(axis=1))"),
    ),
    "benchmarks/metrics/test_uncertainty": (
        Fault("spread without the reference", "benchmarks/results/ensemble.py", "values = [0.0, *changes]",
              "values = [*changes]"),
        Fault("smaller steps are in the ensemble", "benchmarks/results/ensemble.py",
              '("simulation-tolerance", 1e-8)', '("simulation-dt", 8)'),
        Fault("energies of the warm-up", ENERGY, "series[roll_out.judged].mean()", "series[2:].mean()"),
        Fault("excess with the zero of gravity", EXCESS, 'above["total"] - above.get("gravity", 0.0)',
              'above["total"]'),
        Fault("common dynamics by the own static answer", DYNAMICS, "common = hem.measure(x)",
              "common = hem.measure(x, static)"),
    ),
    "benchmarks/metrics/test_dynamics": (
        Fault("static answer one frame late", HEM, "difference = moving - static\n",
              "difference = moving - np.roll(static, 1, axis=0)\n"),
    ),
    "benchmarks/metrics/test_conservation": (
        Fault("momentum without the time step", CONSERVATION, "v) - dt * force", "v) - force"),
    ),
}  # fmt: skip
