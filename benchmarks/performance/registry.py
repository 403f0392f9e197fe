"""Microbenchmarks: the visible tuple of declarations. Listing them imports nothing that measures."""

from __future__ import annotations

from benchmarks.performance.microbenchmark import Microbenchmark

_HERE = "benchmarks.performance"

SIMULATOR = (
    Microbenchmark(
        name="sheet/64x64",
        description="a sheet pinned at two corners, 30 frames: a frame, convergence, where the time goes",
        module=f"{_HERE}.sheet",
        function="frames",
        options={"side": 64},
    ),
    *(
        Microbenchmark(
            name=f"garment/{motion}-{vertices}",
            description=f"60 frames of a T-shirt of about {vertices} vertices on a body: {motion}",
            module=f"{_HERE}.garment",
            options={"motion": motion, "vertices": vertices},
            repeats=repeats,
        )
        for motion, vertices, repeats in (
            ("walk", 1000, 5), ("run", 1000, 5), ("jump", 1000, 5), ("walk", 4400, 3),
        )
    ),
    *(
        Microbenchmark(
            name=f"search/{motion}-{vertices}",
            description=f"closest faces of contact samples, T-shirt of about {vertices} vertices: {motion}",
            module=f"{_HERE}.search",
            options={"motion": motion, "vertices": vertices, "frames": 40},
        )
        for motion in ("walk", "jump")
        for vertices in (1000, 4400)
    ),
    *(
        Microbenchmark(
            name=f"scaling/{side}x{side}",
            description=f"an iteration of L-BFGS and of Newton's method, memory: {side * side} vertices",
            module=f"{_HERE}.sheet",
            function="scaling",
            options={"side": side, "frames": frames},
            repeats=repeats,
            smoke=side == 32,
        )
        for side, frames, repeats in ((32, 4, 5), (64, 4, 5), (128, 4, 5), (256, 4, 3), (512, 1, 1))
    ),
)  # fmt: skip

NETWORKS = (
    *(
        Microbenchmark(
            name=f"training_step/{vertices}",
            description=f"a training step and its parts, garment of about {vertices} vertices",
            module=f"{_HERE}.training_step",
            options={"vertices": vertices},
            method=network,
            trains=True,
        )
        for network in ("snug", "supervised", "pbns")
        for vertices in (500, 1000, 2000, 4400)
    ),
    *(
        Microbenchmark(
            name=f"inference/{vertices}",
            description=f"a frame at a time on one CPU core, and memory; about {vertices} vertices",
            module=f"{_HERE}.inference",
            options={"vertices": vertices},
            method=network,
            smoke=(network, vertices) == ("pbns", 1000),
        )
        for network in ("snug", "pbns", "tailornet", "santesteban2019")
        for vertices in (1000, 4400)
    ),
    Microbenchmark(
        name="convergence/4400",
        description="a whole training at 4400 vertices, rolled out on a motion that it does not see",
        module=f"{_HERE}.convergence",
        options={"vertices": 4400},
        method="snug",
        trains=True,
        files=("convergence.csv", "models/convergence/snug-4400.safetensors"),
        long=True,
    ),
)

MICROBENCHMARKS: tuple[Microbenchmark, ...] = (*SIMULATOR, *NETWORKS)
