"""Small valid files of every kind that a user may bring, as bytes; the writers work in the present folder."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.results.run_folder import RunFolder
from reference_sim import Trajectory
from reference_sim.trajectory import write_obj, write_point_cache
from snug.body.parametric_body import Body
from snug.garments.templates import find_template
from snug.networks.garment_network import make_network
from snug.networks.tensor_file import read_tensors
from snug.networks.trained_model import TrainedModel
from snug.recipe import DEFAULT
from tests.reports.report_folder import all_rows, declaration
from tests.snug.motion.cmu_clips import amc_frame, cmu_like
from tests.snug.motion.motion_forms import bvh

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
MATERIAL = b"young_modulus = 1e5\npoisson_ratio = 0.3\nthickness = 5e-4\n"
JOINTS = b'pelvis = "pelvis"\nspine1 = "spine1"\n'


def written(suffix: str, write: Callable[[Path], object]) -> bytes:
    """The bytes of a file that this writes."""
    path = Path(f"valid{suffix}")
    write(path)
    return path.read_bytes()


def mesh(suffix: str, **options: Any) -> Callable[[], bytes]:
    import meshio

    made = meshio.Mesh(CORNERS, [("triangle", FACES)])
    return lambda: written(suffix, lambda path: made.write(path, **options))


def polydata(suffix: str) -> Callable[[], bytes]:
    import pyvista

    surface = pyvista.PolyData.from_regular_faces(CORNERS, FACES)
    return lambda: written(suffix, lambda path: surface.save(path, binary=False))


def arrays(**named: np.ndarray) -> Callable[[], bytes]:
    return lambda: written(".npz", lambda path: np.savez_compressed(path, **named))


def amass_arrays() -> dict[str, np.ndarray]:
    poses = np.random.default_rng(0).normal(0.0, 0.1, (6, 72))
    poses[:, :3] = [np.pi / 2, 0.0, 0.0]
    return {"poses": poses, "trans": np.tile([0.0, 0.0, 0.9], (6, 1)), "mocap_framerate": np.array(60.0)}


def roll_out() -> dict[str, np.ndarray]:
    return {"positions": np.stack([CORNERS, CORNERS + 0.1]), "faces": FACES, "fps": np.array(30.0)}


def hood_arrays() -> dict[str, np.ndarray]:
    body = {"obstacle": roll_out()["positions"], "obstacle_faces": FACES}
    return {"pred": roll_out()["positions"], "cloth_faces": FACES} | body


def pickled(arrays: dict[str, np.ndarray]) -> Callable[[], bytes]:
    return lambda: pickle.dumps(arrays)


def shirt() -> bytes:
    made = find_template("tshirt").tailor(Body.load(), vertices=200)
    return written(".obj", lambda path: write_obj(path, made.rest_positions, made.faces))


def bvh_text() -> bytes:
    clip = amass_arrays()
    poses = clip["poses"].reshape(-1, 24, 3)
    poses[:, 0] = 0.0  # y up
    return bvh(poses, clip["trans"], 60.0).encode()


def rolled_out() -> Trajectory:
    fields = {"iterations": np.arange(2.0)}
    positions, seconds = roll_out()["positions"], np.array([0.0, 0.1])
    return Trajectory(positions, FACES, seconds, np.zeros(2), "ok", frame_fields=fields)


def point_cache() -> bytes:
    return written(".pc2", lambda path: write_point_cache(path, rolled_out()))


def trajectory() -> bytes:
    return written(".vtkhdf", rolled_out().save)


def model() -> TrainedModel:
    network = make_network("pbns", 7, 4, DEFAULT, seed=0)
    return TrainedModel("pbns", network, DEFAULT, history=[{"step": 1.0}])


def model_header() -> bytes:
    model().save("model.safetensors")
    return json.dumps(read_tensors(Path("model.safetensors"))[1]).encode()


def results_csv() -> bytes:
    RunFolder(".").write_rows(all_rows())
    return Path("results.csv").read_bytes()


def run_json() -> bytes:
    settings = {"preset": "smoke", "stages": [{"name": "cells", "seconds": 1.0}], "earlier": []}
    RunFolder(".").write_config(declaration(all_rows(), **settings, started="2030-01-02T03:04:05+00:00"))
    return Path("run.json").read_bytes()


def clip_text() -> bytes:
    return (":FULLY-SPECIFIED\n:DEGREES\n" + amc_frame(1) + amc_frame(2)).encode()


def skeleton_text() -> bytes:
    return cmu_like().encode()


def model_file() -> bytes:
    return written(".safetensors", model().save)
