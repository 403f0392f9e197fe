"""Metrics performance/*: times, sizes and memory that microbenchmarks measure (benchmarks.performance)."""

from __future__ import annotations

from dataclasses import replace

from benchmarks.metric import Metric

PART = "performance"  # the suite of benchmarks.performance, which lies above this room
PROCESS_MEMORY = f"{PART}/process_memory"


def _metrics(*declared: Metric, table: str = "") -> tuple[Metric, ...]:
    """Return these metrics as columns of the table of that part."""
    name = f"{PART}_{table}" if table else PART
    return tuple(replace(metric, table=name) for metric in declared)


def _metric(name: str, unit: str, title: str, definition: str, lower_is_better: bool | None = True) -> Metric:
    return Metric(
        name=f"{PART}/{name}", unit=unit, title=title, definition=definition, lower_is_better=lower_is_better
    )


def _clocked(name: str, unit: str, title: str, definition: str) -> Metric:
    return replace(_metric(name, unit, title, definition), of="machine")


def _size(name: str, title: str, definition: str) -> Metric:
    return _metric(name, "1", title, definition, None)


METRICS = (
    *_metrics(
        _size("vertices", "Vertices", "of the sheet or the garment"),
        _clocked("process_memory", "MB", "Process", "most memory that the process of the case held at once"),
    ),
    *_metrics(
        _clocked("frame", "ms", "Frame", "median time of a frame; the median of repeats"),
        _clocked("frame_worst", "ms", "Worst frame", "longest time of a frame; the median of repeats"),
        _metric("converged_frames", "%", "Converged", "frames whose minimisation converged", False),
        _metric("gradient", "1", "Gradient", "largest relative residual at the end of a frame"),
        _clocked("linear_solver", "s", "Linear solver", "of all frames: inside factorise and solve"),
        _clocked("outside_linear_solver", "s", "Outside", "of all frames: outside factorise and solve"),
        _clocked("outside_ratio", "1", "Outside / inside", "time outside of them over time inside"),
        _metric("iterations", "1", "Iterations", "of the minimiser in a frame, median over frames"),
        _metric("iterations_worst", "1", "Most iterations", "of the minimiser in a frame"),
        _metric("penetrating_vertices", "%", "Penetration", "vertices inside the body, mean over frames"),
        _metric("deep_vertices", "%", "Deep", "vertices more than 5 mm inside the body, mean over frames"),
        _metric("depth_p999", "mm", "Depth, 99.9 %", "99.9 % of all vertices and frames are less deep"),
        table="simulator",
    ),
    *_metrics(
        _size("samples", "Samples", "contact samples of the garment"),
        _clocked("search", "ms", "Search", "closest faces of all samples in a frame, median over frames"),
        _clocked("search_worst", "ms", "Worst search", "the same in the frame that takes longest"),
        table="search",
    ),
    *_metrics(
        _clocked("iteration", "ms", "Iteration", "time of an iteration of Newton's method"),
        _clocked("iteration_per_vertex", "us", "Per vertex", "the same over the number of vertices"),
        _clocked("lbfgs_iteration", "ms", "L-BFGS", "time of an iteration of L-BFGS alone"),
        _clocked("lbfgs_slope", "1", "Slope", "its log-log slope over vertices, from 32 x 32 on"),
        _clocked("lbfgs_memory", "kB", "A vertex", "most memory of cloth and L-BFGS together, a vertex"),
        table="scaling",
    ),
    *_metrics(
        _size("training_frames", "Frames", "poses that the training draws from, augmented motions included"),
        _clocked("setup", "s", "Preprocessing", "what a training does before its first step"),
        _clocked("training_step", "ms", "Step", "a training step; the median over blocks of steps"),
        _clocked("paper_training", "h", "Preset paper", "preset paper's number of steps at the median"),
        _size("step_frames", "Frames a step", "poses of one training step"),
        _clocked("training_step_least", "ms", "Least step", "mean of the quickest block of steps"),
        _clocked("training_step_processor", "ms", "Processor",
                "processor time of a step, first ones included: tells a machine that was busy otherwise"),
        _clocked("training_step/*", "ms", "{}", "of a training step, median over blocks"),
        _clocked("device_memory", "MB", "On the device", "most memory held at once on the accelerator"),
        table="training",
    ),
    *_metrics(
        _size("timed_frames", "Timed frames", "of roll-outs, one frame at a time"),
        _clocked("inference", "ms", "Frame", "network and skinning, one frame at a time: median"),
        _clocked("inference_p95", "ms", "Frame, 95 %", "95 % of the frames took less"),
        _clocked("inference_least", "ms", "Least frame", "the quickest frame"),
        _clocked("inference_cold", "ms", "Frame, cold",
                "median of frames before each of which other work has swept 48 MB through the caches"),
        _size("parameters", "Parameters", "of the network"),
        _metric("network_memory", "MB", "Network", "memory of the network"),
        _metric("model_file", "MB", "File", "size of the network's file"),
        table="inference",
    ),
    *_metrics(
        _size("steps", "Steps", "of the training"),
        _clocked("training", "s", "Training", "time of all steps; validations are left out"),
        _clocked("training_share", "%", "Of 2 h", "time of all steps as a share of the paper's two hours"),
        _metric("window_loss", "J", "Loss", "energy of a frame in windows of training, at the end"),
        _metric("validation", "J", "Held out", "energy of a frame of the held-out motion at the end"),
        _metric("validation_best", "J", "Best held out", "the same at its lowest"),
        *(
            metric
            for share in (3, 1)
            for metric in (
                _metric(f"steps_to_{share}", "1", f"Steps to {share} %",
                        f"steps until the held-out energy stays within {share} % of its end"),
                _clocked(f"time_to_{share}", "s", f"Time to {share} %",
                        f"time until the held-out energy stays within {share} % of its end"),
            )
        ),
        table="convergence",
    ),
)  # fmt: skip
