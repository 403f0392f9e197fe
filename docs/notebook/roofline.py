"""How near each network's frame is to what the core's memory allows: an experiment.

    python docs/notebook/roofline.py [VERTICES]

A frame reads every weight once and does one multiplication and one addition with it, so it takes at least
as long as reading them. The bound is the least time of a dot product of as many numbers, warm, on the
same core; that of arithmetic, by a large matrix product, is far lower. Prints, for each network with
random weights: megabytes of weights, the bound by reading, the bound by arithmetic, the median frame, and
frame over bound.
"""

import sys
import time
from functools import partial

import numpy as np

from benchmarks.assets import make_motions
from benchmarks.timing import one_thread
from snug.body.parametric_body import Body
from snug.garments.templates import TSHIRT, find_template
from snug.motion.library import TRAIN
from snug.networks.dressed_body import DressedBody
from snug.networks.roll_out import prepare_frames
from snug.training.train_network import train_network

MEASURED = ("snug", "pbns", "handles-80", "ncs", "tailornet")
REPEATS = 200


def frame_seconds(model, dressed, motion):
    """Return wall times [s] of each frame of a roll-out; inputs and joint transforms are ready before."""
    frames, seconds = prepare_frames(model, dressed, motion)(), []
    for _ in range(motion.frames):
        begun = time.perf_counter()
        next(frames)
        seconds.append(time.perf_counter() - begun)
    return seconds


def least(run):
    """Return the least of REPEATS times of run() [s]."""
    times = []
    for _ in range(REPEATS):
        begun = time.perf_counter()
        run()
        times.append(time.perf_counter() - begun)
    return min(times)


def main():
    """Print the table."""
    one_thread()
    vertices = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    body = Body.load()
    dressed = DressedBody(body, find_template(TSHIRT).tailor(body, vertices=vertices))
    motions = make_motions(TRAIN[:1])
    skinned = {motion.name: dressed.skin(motion) for motion in motions}  # for those that learn vertices
    square = np.ones((1024, 1024), np.float32)
    operations = 2 * 1024**3 / least(lambda: square @ square)  # a second
    print(f"{dressed.vertices} vertices; {operations / 1e9:.0f} GFLOP/s")
    print("network      weights  reading  arithmetic    frame  frame over reading")
    for kind in MEASURED:
        model = train_network(
            kind, dressed, motions, steps=1, seed=0, trajectories=skinned, progress=False
        )
        count = sum(p.numel() for p in model.network.parameters())
        weights, inputs = np.ones((2, count // 2), np.float32)
        reading = least(partial(np.dot, weights, inputs))
        for _ in range(2):  # the first one compiles
            frames = frame_seconds(model, dressed, motions[0])
        frame = float(np.median(frames))
        print(
            f"{kind:12} {4e-6 * count:5.2f} MB {1e3 * reading:5.3f} ms {2e3 * count / operations:8.4f} ms "
            f"{1e3 * frame:5.3f} ms {frame / reading:8.1f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
