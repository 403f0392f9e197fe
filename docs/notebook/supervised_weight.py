"""Supervision with strain and collision, by lambda: excess energy and distance on validation motions.

    python docs/notebook/supervised_weight.py DIR [OPTION OF benchmarks.run ...]

trains a network for each of WEIGHTS (T-shirt of 1002 vertices, the 34 recorded training clips and one
augmented frame for each of theirs, simulated by SOLVER, 1,500 steps) and rolls it out in eight
validation motions; test motions are not read. Prints, by lambda and seed, the last losses, both parts of the
loss as they weigh, and two measures: the excess of the common energies over the reference as a share of
skinning's, pooled over the motions, and the distance from the reference. It is a run of benchmarks.run with
the methods of this file, so the same command goes on where it was killed.
"""

from __future__ import annotations

import csv
import sys
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

from benchmarks.method import Simulated, Training
from benchmarks.methods.declared_networks import network
from benchmarks.results.run_folder import RunFolder, model_path
from snug.motion.library import VALIDATION
from snug.named_recipes import SUPERVISED
from snug.networks.tensor_file import read_header

WEIGHTS = (0.0, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)  # cm^2/J
SOLVER = "fast-lbfgs-10"  # simulates what is learned from
SCENES = ",".join(f"tshirt/{motion}" for motion in VALIDATION[:8])


def name_of(weight: float) -> str:
    """Return the name of the network with that lambda."""
    return f"supervised-lambda-{weight:g}"


METHODS = tuple(
    network(
        name_of(weight), f"Supervised, lambda {weight:g} cm²/J", f"supervised, lambda {weight:g} cm^2/J",
        training=Training(
            "supervised", replace(SUPERVISED, name=name_of(weight), physics_weight=weight),
            Simulated(mixed=1, method=SOLVER),
        ),
        role="ablation", timed=False, batched=False,
    )
    for weight in WEIGHTS
)  # fmt: skip


def main() -> int:
    """Run, and print the table; return the exit status of the run."""
    from benchmarks.run import main as run

    folder, *further = sys.argv[1:]
    status = run([
        "full:garments", "--set", "split=validation", "--scenes", SCENES,
        "--methods", f"simulation,skinning,{__file__}", "--seeds", "0",
        "--set", "sizes.steps.supervised=1500", "--workers", "1", "-o", folder, *further,
    ])  # fmt: skip
    values: dict[tuple[str, str, int], list[float]] = defaultdict(list)
    if not (results := Path(folder) / "results.csv").is_file():
        return status
    with results.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if row["metric"] in ("energy/total", "distance/rms") and row["value"]:
                values[row["metric"], row["method"], int(row["seed"])].append(float(row["value"]))
    zero, full = (sum(values["energy/total", name, 0]) for name in ("simulation", "skinning"))
    print("lambda [cm^2/J] | seed | vertices [cm^2] | strain, collision [J] | weighed | excess [%] | mm")
    for (metric, name, seed), energies in sorted(values.items()):
        weight = next((weight for weight in WEIGHTS if name_of(weight) == name), None)
        if metric != "energy/total" or weight is None:
            continue
        last = read_header(model_path(RunFolder(folder).models_of("tshirt"), name, seed))["history"][-1]
        physics = [last.get(term, float("nan")) for term in SUPERVISED.terms]
        distances = values["distance/rms", name, seed]
        print(
            f"{weight:g} | {seed} | {last['vertices']:.3f} | {physics[0]:.3f}, {physics[1]:.4f} | "
            f"{weight * sum(physics):.3f} | {100 * (sum(energies) - zero) / (full - zero):.1f} | "
            f"{sum(distances) / len(distances):.2f}"
        )
    return status


if __name__ == "__main__":
    sys.exit(main())
