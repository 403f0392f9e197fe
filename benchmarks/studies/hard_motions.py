"""Trained networks, skinning and the simulator under motions, shapes and materials that nothing was made for.

Of each case and method: the worst strain energy of a frame and what that is of the same method's worst on the
ordinary walk; how far any vertex ever is from the skinned shirt; vertices below the skin; after a glitch the
distance to the roll-out without it; under another material the energy by that material, which a network has
never heard of. A network that is not finite, or whose shirt has left the body, diverged; the simulator says
of itself how it ended. Every row carries that outcome and its reason.

Scenes "hard_motions/<case>", metrics "motion/...".
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..metrics.geometry import whole_frames
from ..plan import Plan
from ..results import Row, RunFolder
from .hard_motion_cases import AFTER, GLITCH, HARD_MOTIONS, MOTION, ORDINARY_CASE, HardMotion
from .hard_motion_stage import FREE, REFERENCE, Contestant, HardStage, RollOut, Trained, strains

if TYPE_CHECKING:
    from ..presets import Preset
    from ..scene import BuiltScene
    from ..wardrobe import Wardrobe
    from ..workers import Tell

LONG = {"smoke": 390, "quick": 10_000, "paper": 10_000}  # frames of the long roll-out
SAMPLED = 50  # of the long roll-out, one frame in so many is skinned and measured
MM = 1e3
LOST = 0.5  # [m] from the skinned shirt: a vertex so far off is on no body any more
SUITE = "extremes"
UNITS = {
    "motion/strain": "J", "motion/strain_ratio": "1", "motion/offset": "mm", "motion/penetration": "%",
    "motion/total": "J", "motion/drift": "mm",
} | {f"motion/recovery_{after}": "mm" for after in AFTER}  # fmt: skip
NO_NETWORK = "no trained network in this run: run suite garments with this one"


def rows(plan: Plan, folder: RunFolder, wardrobe: Wardrobe | None) -> list[Row]:
    """Every case, some at a time. Without trained networks the simulator and skinning do them alone."""
    from ..wardrobe import open_wardrobe
    from ..workers import Failure, Job, run_jobs

    networks = trained(plan, folder)
    cases = [case for case in HARD_MOTIONS if case.smoke or plan.preset.name != "smoke"]
    shared = (plan.preset, networks)
    jobs = [Job(case.name, do_case, (*shared, case.name), 1) for case in cases]
    if networks:
        jobs.append(Job("long", do_long, shared, 1))
    own = wardrobe or open_wardrobe(plan.preset, [], body=plan.body_file)
    found: list[Row] = []
    ended = run_jobs(jobs, own, title="hard motions", unit="case", workers=plan.workers)
    for job, result in zip(jobs, ended):
        if isinstance(result, Failure):
            found.append(
                _row(_scene(job.label), REFERENCE, 0, "motion/strain", None, "failed", result.reason)
            )
        else:
            found += result
    if not networks:
        found.append(_row("hard_motions", "networks", 0, "motion/strain", None, "skipped", NO_NETWORK))
    return found


def trained(plan: Plan, folder: RunFolder) -> tuple[Trained, ...]:
    """The T-shirt's networks that lie in the folder of the run; each once, whichever methods use it."""
    from ..methods.networks import model_path

    paths = {who: model_path(folder.models, *who) for who in plan.models if who[0] != "untrained"}
    return tuple(Trained(*who, path) for who, path in paths.items() if path.is_file())


def do_case(
    wardrobe: Wardrobe,
    tell: Tell,
    preset: Preset,
    networks: tuple[Trained, ...],
    name: str,
) -> list[Row]:
    """The rows of one case."""
    case = next(case for case in HARD_MOTIONS if case.name == name)
    stage = _stage(wardrobe, preset, networks)
    scene = stage.scene(case)
    ordinary, worst = stage.ordinary
    roll_outs = stage.roll_outs(case, scene)
    metrics = measure(case, scene, roll_outs, ordinary, worst)
    tell(1)
    return [
        _row(scene.name, method, seed, metric, value, *outcome(method, roll_outs[method, seed], found))
        for (method, seed), found in metrics.items()
        for metric, value in found.items()
    ]


def do_long(wardrobe: Wardrobe, tell: Tell, preset: Preset, networks: tuple[Trained, ...]) -> list[Row]:
    """The rows of the long roll-out."""
    stage = _stage(wardrobe, preset, networks)
    scene, found = stage.scene(ORDINARY_CASE), []
    for network in networks:
        who = network.method, network.seed
        sampled, away, drift = stage.long_roll_out(network, LONG[preset.name], SAMPLED)
        metrics = worst_of(strains(scene, sampled), away, stage.ordinary[1][who]) | {
            "motion/drift": MM * drift
        }
        ended = outcome(network.method, RollOut(sampled), metrics)
        found += [_row(_scene("long"), *who, metric, value, *ended) for metric, value in metrics.items()]
    tell(1)
    return found


_kept: dict[str, HardStage] = {}  # of this worker


def _stage(wardrobe: Wardrobe, preset: Preset, networks: tuple[Trained, ...]) -> HardStage:
    """The one of this process: the shirt settles and the ordinary walk is done once."""
    if "stage" not in _kept:
        from snug.motion_library import make_motion

        walk = make_motion(MOTION)
        _kept["stage"] = HardStage(
            dataclasses.replace(wardrobe, motions={MOTION: walk}), preset, walk, networks
        )
    return _kept["stage"]


def measure(
    case: HardMotion,
    scene: BuiltScene,
    roll_outs: Mapping[Contestant, RollOut],
    ordinary: Mapping[Contestant, RollOut],
    worst: Mapping[Contestant, float],
) -> dict[Contestant, dict[str, float]]:
    """Of every contestant the metrics of this case."""
    from ..metrics.energy import energy_series, mean_energy
    from ..metrics.geometry import distance_rms, penetration

    assert scene.obstacle is not None
    finite = {who: whole_frames(rolled.positions) for who, rolled in roll_outs.items()}
    inside = dict(zip(finite, penetration(list(finite.values()), scene.obstacle)))
    totals = dict(zip(finite, energy_series(scene, list(finite.values())))) if case.material else {}
    bare = roll_outs[FREE, 0].positions
    found = {}
    for who, rolled in roll_outs.items():
        x = rolled.positions
        metrics = worst_of(strains(scene, x), np.linalg.norm(x - bare[: len(x)], axis=2), worst[who])
        if len(finite[who]):
            metrics["motion/penetration"] = 100.0 * float(inside[who].share.mean())
        if who in totals and len(finite[who]) == scene.frames:
            metrics["motion/total"] = mean_energy(totals[who]["total"])
        for after in AFTER if case.glitch else ():
            here, there = (y.positions[GLITCH + after : GLITCH + after + 1] for y in (rolled, ordinary[who]))
            if len(here) and len(there):
                metrics[f"motion/recovery_{after}"] = MM * float(distance_rms(here, there)[0])
        found[who] = metrics
    return found


def worst_of(strain: np.ndarray, away: np.ndarray, ordinary: float) -> dict[str, float]:
    """Of strain energies (T,) [J] and distances to skinning (T,V) [m], beside the ordinary walk's worst."""
    return {
        "motion/strain": float(strain.max()),
        "motion/strain_ratio": float(strain.max() / ordinary),
        "motion/offset": MM * float(away.max()),
    }


def outcome(method: str, rolled: RollOut, metrics: Mapping[str, float]) -> tuple[str, str]:
    """Status and reason: the roll-out's own, unless it is not finite or its shirt is on no body any more.

    A simulated shirt may be where it likes: of a body that jumps by a metre it has to be left behind.
    """
    if rolled.status != "ok":
        return rolled.status, rolled.reason
    whole = len(whole_frames(rolled.positions))
    if whole < len(rolled.positions):
        return "diverged", f"not finite from frame {whole} on"
    if method != REFERENCE and metrics["motion/offset"] > MM * LOST:
        return "diverged", f"a vertex came {metrics['motion/offset'] / MM:.2g} m away from the skinned shirt"
    return "ok", ""


def _scene(case: str) -> str:
    return f"hard_motions/{case}"


def _row(
    scene: str, method: str, seed: int, metric: str, value: float | None, status: str, reason: str
) -> Row:
    if value is not None and not np.isfinite(value):
        value, status, reason = None, "diverged" if status == "ok" else status, reason or "not finite"
    return Row(SUITE, scene, method, seed, metric, UNITS[metric], value, status, reason)
