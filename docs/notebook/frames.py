"""Where the time of a frame goes, and two versions of the code in turns: an experiment.

    python docs/notebook/frames.py                          parts of each frame, beside their bounds
    python docs/notebook/frames.py OLD NEW [CASE [ROUNDS]]  two trees, for example git worktrees

Frames are of the walk in a T-shirt of 1002 or 4378 vertices: converged, by early-stopped L-BFGS, and by
one iteration from the frames of the packaged SNUG; a training step is of SNUG. Times are of processor and
thread. Two trees run in processes of their own that take turns: prints the least times [ms] and the
median of the ratios of neighbouring turns, so that other work on the machine hits both.

The bound of a factorisation is its arithmetic at the rate of a large matrix product; of a solve, the
reading of the factor, twice, at the rate of a dot product as long; of an evaluation in float32, its
arithmetic. None is reached: gathered corners and small blocks are not a large matrix product.
"""

import os
import statistics
import subprocess
import sys
import time
from functools import partial

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # for the bounds, before numpy is loaded

import numpy as np

from benchmarks.assets import make_motions
from benchmarks.methods.declared_networks import TRAININGS
from benchmarks.methods.warm_started import make_guess
from benchmarks.references import find_in_package
from benchmarks.timing import one_thread
from reference_sim import obstacle, potential
from reference_sim.energies import BendHinge, ContactPenalty, Gravity, StretchStVK
from reference_sim.minimise import compiled_lbfgs
from reference_sim.time_loop import State, TimeStepper
from snug.body.parametric_body import Body
from snug.garments.templates import TSHIRT, find_template
from snug.motion.library import TRAIN
from snug.networks.dressed_body import DressedBody
from snug.networks.roll_out import prepare_frames
from snug.networks.trained_model import TrainedModel
from snug.training.optimisation_step import Trainer

FRAMES = {1000: 12, 4400: 3}  # of a turn
FLOPS = {"strain": 130, "bending": 260, "collision": 40}  # of an element, counted in its float32 kernel


def dressed_body(vertices):
    """Return the body in a T-shirt of about so many vertices."""
    body = Body.load()
    return DressedBody(body, find_template(TSHIRT).tailor(body, vertices=vertices))


def walking(vertices, guess=False, **options):
    """Return a function that simulates some frames of the walk, and returns seconds a frame."""
    dressed, (walk,) = dressed_body(vertices), make_motions(["walk"])
    body, cloth = dressed.body, dressed.garment.cloth()
    posed = body.vertices(walk.poses, walk.translations)
    terms = [StretchStVK(cloth), BendHinge(cloth), ContactPenalty(cloth), Gravity(cloth)]
    if guess:
        frames = prepare_frames(TrainedModel.load(find_in_package("snug")), dressed, walk)
        options["guess"] = make_guess(frames, None)
    solid = obstacle.Obstacle(posed, body.faces, rest_positions=body.rest_vertices())
    stepper = TimeStepper(cloth, terms, dt=1 / 30, obstacle=solid, **options)
    start = dressed.skin(walk)[0]

    def run():
        state, begun = State(start, np.zeros_like(start)), time.thread_time()
        for frame in range(1, FRAMES[vertices] + 1):
            state, _ = stepper.advance(frame, state, None)
        return (time.thread_time() - begun) / FRAMES[vertices]

    return run


def training():
    """Return a function that trains SNUG for some steps, and returns seconds a step."""
    trainer = Trainer(
        "snug", dressed_body(1000), make_motions(TRAIN[:3]), steps=10_000, seed=0,
        recipe=TRAININGS["snug"].recipe,
    )  # fmt: skip
    numbers = iter(range(10_000))

    def run():
        begun = time.thread_time()
        for _ in range(8):
            trainer.step(next(numbers))
        return (time.thread_time() - begun) / 8

    return run


def early(iterations):
    """Return the minimiser that stops after so many iterations."""
    return partial(compiled_lbfgs.CompiledLBFGS, max_iterations=iterations)


CASES = {
    "converged, 1002": partial(walking, 1000),
    "converged, 4378": partial(walking, 4400),
    "L-BFGS 10": partial(walking, 1000, method=early(10)),
    "SNUG + 1": partial(walking, 1000, guess=True, method=early(1)),
    "training step": training,
}


def clocked(owner, name, spent):
    """Let a function add its seconds to the list `spent`."""
    function = getattr(owner, name)

    def measured(*arguments, **options):
        begun = time.thread_time()
        result = function(*arguments, **options)
        spent.append(time.thread_time() - begun)
        return result

    setattr(owner, name, measured)


def print_parts():
    """Print milliseconds a frame and calls of each part of the simulated frames, and of the rest."""
    from reference_sim.cholesky import Cholesky  # not in every old tree

    parts = (
        ("contact planes", obstacle.Obstacle, "planes"),
        ("first guess", obstacle.Obstacle, "transport"),
        ("float32 L-BFGS", compiled_lbfgs, "descend"),
        ("its factor", compiled_lbfgs, "precondition"),
        ("evaluations", potential.Potential, "value_and_gradient"),
        ("assembly", potential.HessianPattern, "assemble"),
        ("factorisations", Cholesky, "factorise"),
        ("solves", Cholesky, "solve"),
    )
    seconds = {title: [] for title, _, _ in parts}
    for title, owner, name in parts:
        clocked(owner, name, seconds[title])
    for case, make in list(CASES.items())[:-1]:
        run = make()
        run()
        for spent in seconds.values():
            spent.clear()
        frame = run()
        frames = FRAMES[4400 if "4378" in case else 1000]
        print(f"\n{case}: {1e3 * frame:.2f} ms a frame")
        for title, spent in seconds.items():
            if spent:
                print(f"  {title:16}{1e3 * sum(spent) / frames:8.2f} ms {len(spent) / frames:7.1f} calls")
        rest = frame - sum(map(sum, seconds.values())) / frames
        print(f"  {'Python and rest':16}{1e3 * rest:8.2f} ms", flush=True)


def least(run, repeats=20):
    """Return the least seconds of run()."""
    times = []
    for _ in range(repeats):
        begun = time.thread_time()
        run()
        times.append(time.thread_time() - begun)
    return min(times)


def print_bounds():
    """Print the bounds of a factorisation, a solve and an evaluation in float32."""
    from reference_sim.elimination import eliminate  # not in every old tree

    rates = {}
    for kind in (np.float64, np.float32):
        square = np.ones((1024, 1024), kind)
        rates[kind] = 2 * 1024**3 / least(partial(np.matmul, square, square))
    print(
        "\nBounds    rates: " + ", ".join(f"{k.__name__} {r / 1e9:.0f} GFLOP/s" for k, r in rates.items())
    )
    for vertices in FRAMES:
        cloth = dressed_body(vertices).garment.cloth()
        terms = [StretchStVK(cloth), BendHinge(cloth)]
        pattern = potential.HessianPattern(terms, np.ones(cloth.vertex_count, bool), block=1)
        ends = np.stack(
            [pattern.indices, np.repeat(np.arange(len(pattern.order)), np.diff(pattern.indptr))]
        )
        counts = eliminate(pattern.order, ends.T[ends[0] > ends[1]])[3]
        columns = 3.0 * (counts + 0.5)  # of the 3n factor, three alike
        numbers = int(3 * columns.sum())
        a, b = np.ones((2, numbers // 2))
        counts = dict(
            zip(FLOPS, (len(cloth.faces), len(cloth.hinges), len(ContactPenalty(cloth).stencils)))
        )
        operations = sum(FLOPS[name] * count for name, count in counts.items())
        print(
            f"{cloth.vertex_count} vertices: factorisation "
            f" {3e3 * (columns**2).sum() / rates[np.float64]:.2f} ms, "
            f"solve {2e3 * least(partial(np.dot, a, b)):.3f} ms ({8e-6 * numbers:.1f} MB), "
            f"evaluation in float32 {1e3 * operations / rates[np.float32]:.4f} ms",
            flush=True,
        )


def take_turns(trees, chosen, rounds):
    """Print the times of both trees, case by case."""
    for case in (c for c in CASES if chosen in c):
        children = [
            subprocess.Popen(
                [sys.executable, os.path.abspath(__file__), "--child", case], text=True, cwd=tree,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=dict(os.environ, PYTHONPATH=tree),
            )
            for tree in map(os.path.abspath, trees)
        ]  # fmt: skip
        turns = []
        for _ in range(rounds):
            times = []
            for child in children:
                child.stdin.write("\n")
                child.stdin.flush()
                times.append(float(child.stdout.readline()))
            turns.append(times)
        for child in children:
            child.stdin.close()
            child.wait()
        old, new = (1e3 * min(times) for times in zip(*turns))
        ratio = statistics.median(times[1] / times[0] for times in turns)
        print(f"{case:16} old {old:8.2f} ms   new {new:8.2f} ms   ratio {ratio:.3f}", flush=True)


def main():
    """Print parts and bounds, or compare two trees."""
    one_thread()
    match sys.argv[1:]:
        case ["--child", case]:
            run = CASES[case]()
            run()
            for _ in sys.stdin:
                print(run(), flush=True)
        case [old, new, *rest]:
            take_turns((old, new), rest[0] if rest else "", int(rest[1]) if len(rest) > 1 else 9)
        case _:
            print_parts()
            print_bounds()


if __name__ == "__main__":
    main()
