"""Files that nobody meant: every reader refuses them in one line, at once, without taking the memory.

READERS is the table; a new reader is one line in it. `pytest -m slow` mutates a hundred files of each.
"""

from __future__ import annotations

import os
import pickle
import random
import re
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import meshio
import numpy as np
import pytest

from benchmarks.external.roll_out_files import RollOutFileError, read_roll_out
from benchmarks.timing import peak_memory
from reference_sim import Trajectory, TrajectoryError
from reference_sim.cloth import Cloth, MeshError
from reference_sim.files.array_file import ArrayFileError, read_arrays
from reference_sim.files.mesh_files import read_mesh
from reference_sim.trajectory import read_point_cache, write_obj, write_point_cache
from snug.body.parametric_body import Body
from snug.body.skeleton import BodyError
from snug.body.smpl_files import read_body
from snug.file_options import GarmentFile
from snug.garments.garment import GarmentError
from snug.garments.reading import read_garment
from snug.motion.files import load_motions
from snug.motion.motion import MotionError
from snug.networks.garment_network import make_network
from snug.networks.trained_model import ModelFileError, TrainedModel
from snug.recipe import DEFAULT
from tests.snug.body.test_smpl_files import smpl_arrays
from tests.snug.motion.motion_forms import amc_frame, bvh, cmu_like
from tests.snug.training.dressing import tailored

NUMBERS = (
    b"-1",
    b"0",
    b"1e300",
    b"nan",
    b"inf",
    b"99999999999999999999",
    b"9" * 5000,
    b"1000000000",
    b"",
)


def mutated(data: bytes, draw: random.Random) -> bytes:
    """Make one to three mutations: bits, cuts, repeats, other numbers, words of ones."""
    for _ in range(draw.randint(1, 3)):
        at, end = sorted(draw.randint(0, len(data)) for _ in range(2))
        kind = draw.randrange(6)
        if kind == 0 and data:
            changed = bytearray(data)
            for _ in range(draw.randint(1, 8)):
                changed[draw.randrange(len(changed))] ^= 1 << draw.randrange(8)
            data = bytes(changed)
        elif kind == 1:
            data = data[:at]
        elif kind == 2:
            data = data[:end] + data[at:]
        elif kind == 3:
            data = (
                data[:at] + draw.choice((b"\xff" * 8, b"\xff\xff\xff\x7f", b"\0" * 16)) + data[at + 8 :]
            )
        elif kind == 4 and (matches := list(re.finditer(rb"\d+(\.\d+)?", data))):
            number = draw.choice(matches)
            data = data[: number.start()] + draw.choice(NUMBERS) + data[number.end() :]
        else:
            data = data[:at] + draw.randbytes(draw.randint(0, 40)) + data[at:]
    return data


CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
POSITIONS = np.stack([CORNERS, CORNERS + 0.1])
MESH = meshio.Mesh(CORNERS, [("triangle", FACES)])
ROLLED_OUT = Trajectory(
    POSITIONS, FACES, np.array([0.0, 0.1]), np.zeros(2), "ok", frame_fields={"iterations": np.arange(2.0)}
)
POSES = np.random.default_rng(0).normal(0.0, 0.1, (6, 72))
POSES[:, :3] = [np.pi / 2, 0.0, 0.0]
PATH = np.tile([0.0, 0.0, 0.9], (6, 1))
AMASS = {"poses": POSES, "trans": PATH, "mocap_framerate": np.array(60.0)}
Y_UP = np.where(np.arange(72) < 3, 0.0, POSES).reshape(-1, 24, 3)
ROLL_OUT = {"positions": POSITIONS, "faces": FACES, "fps": np.array(30.0)}
HOOD = {"pred": POSITIONS, "cloth_faces": FACES, "obstacle": POSITIONS, "obstacle_faces": FACES}
CLIP = ":FULLY-SPECIFIED\n:DEGREES\n" + amc_frame(1) + amc_frame(2)


@cache
def body() -> dict[str, np.ndarray]:
    return smpl_arrays(Body.load())


@cache
def model() -> TrainedModel:
    network = make_network("pbns", 7, 4, DEFAULT, seed=0)
    return TrainedModel("pbns", network, DEFAULT, history=[{"step": 1.0}])


def write_shirt(path: Path) -> None:
    made = tailored("tshirt", 200)
    write_obj(path, made.rest_positions, made.faces)


class Reader(NamedTuple):
    """Writer of a valid file, its reader, the error that may be raised."""

    name: str
    suffix: str
    write: Callable[[Path], object]
    read: Callable[[Path], object]
    error: type[Exception]


def read_cloth(path: Path) -> None:
    surface = read_mesh(path)
    Cloth(surface.positions, surface.faces)


def read_material(path: Path) -> None:
    write_shirt(path.with_suffix(".obj"))
    read_garment(GarmentFile(path=path.with_suffix(".obj"), material=path), Body.load())


def read_amc(path: Path) -> None:
    path.with_suffix(".asf").write_text(cmu_like())
    load_motions(path)


def read_asf(path: Path) -> None:
    path.with_suffix(".amc").write_text(CLIP)
    load_motions(path.with_suffix(".amc"))


READERS: tuple[Reader, ...] = (
    Reader("arrays", ".npz", lambda path: np.savez(path, a=CORNERS, b=FACES), read_arrays, ArrayFileError),
    Reader("body", ".npz", lambda path: np.savez_compressed(path, **body()), read_body, BodyError),
    Reader("AMASS", ".npz", lambda path: np.savez_compressed(path, **AMASS), load_motions, MotionError),
    Reader("body pickle", ".pkl", lambda path: path.write_bytes(pickle.dumps(body())), read_body, BodyError),
    Reader("garment", ".obj", write_shirt, lambda path: read_garment(path, Body.load()), GarmentError),
    Reader("material", ".toml", lambda path: path.write_text(
        "young_modulus = 1e5\npoisson_ratio = 0.3\nthickness = 5e-4\n"), read_material, GarmentError),
    Reader("BVH", ".bvh", lambda path: path.write_text(bvh(Y_UP, PATH, 60.0)), load_motions, MotionError),
    Reader("roll-out", ".npz", lambda path: np.savez_compressed(path, **ROLL_OUT),
           read_roll_out, RollOutFileError),
    Reader("roll-out pickle", ".pkl", lambda path: path.write_bytes(pickle.dumps(HOOD)),
           read_roll_out, RollOutFileError),
    Reader("PC2", ".pc2", lambda path: write_point_cache(path, ROLLED_OUT),
           read_point_cache, TrajectoryError),
    Reader("amc", ".amc", lambda path: path.write_text(CLIP), read_amc, MotionError),
    Reader("asf", ".asf", lambda path: path.write_text(cmu_like()), read_asf, MotionError),
    *(Reader(suffix, suffix, lambda path: MESH.write(path), read_cloth, MeshError)
      for suffix in (".obj", ".ply", ".off")),
    Reader("trajectory", ".vtkhdf", ROLLED_OUT.save, Trajectory.load, TrajectoryError),
    Reader("model", ".safetensors", lambda path: model().save(path), TrainedModel.load, ModelFileError),
)  # fmt: skip


def check_mutated(reader: Reader, folder: Path, count: int) -> None:
    """Read a valid file, then `count` mutated ones, always the same: most are refused, all at once."""
    whole, path, refused = folder / f"whole{reader.suffix}", folder / f"mutated{reader.suffix}", 0
    reader.write(whole)
    reader.read(whole)
    before = peak_memory()
    for number in range(count):
        path.write_bytes(mutated(whole.read_bytes(), random.Random(number)))
        clock = time.process_time()  # a busy machine makes no problem
        try:
            reader.read(path)
        except reader.error as error:
            refused += 1
            assert "\n" not in str(error) and len(str(error)) < 1000, number
        assert time.process_time() - clock < 10.0, number
    assert refused > count / 3 and peak_memory() < before + 1000.0


@pytest.mark.parametrize("name", ["arrays", "AMASS", "body pickle", "BVH", "amc", "asf"])
def test_some_mutated_files_are_refused_in_one_line(name, tmp_path):
    (reader,) = (reader for reader in READERS if reader.name == name)
    check_mutated(reader, tmp_path, 8)


@pytest.mark.slow
@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.name + reader.suffix)
def test_mutated_files_are_refused_in_one_line(reader, tmp_path):
    check_mutated(reader, tmp_path, 100)


@pytest.mark.parametrize("name", [b"a" * 246, b"walk\xff", b"two\nlines", b"=1+1"])
def test_a_motion_that_no_file_can_be_named_after_is_refused(name, tmp_path):
    path = tmp_path / os.fsdecode(name + b".npz")
    path.write_bytes(b"")
    with pytest.raises(MotionError, match="a name of at most 100 bytes") as refused:
        load_motions(path)
    assert str(refused.value).isascii() and "\n" not in str(refused.value)
