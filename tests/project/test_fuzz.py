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
from pathlib import Path

import meshio
import numpy as np
import pytest

from benchmarks.external.roll_out_files import read_roll_out
from benchmarks.timing import peak_memory
from reference_sim import Trajectory
from reference_sim.cloth import Cloth
from reference_sim.files.array_file import read_arrays
from reference_sim.files.mesh_files import read_mesh
from reference_sim.trajectory import read_point_cache, write_obj, write_point_cache
from snug.body.parametric_body import Body
from snug.body.smpl_files import read_body
from snug.file_options import GarmentFile
from snug.garments.reading import read_garment
from snug.motion.files import load_motions
from snug.motion.motion import MotionError
from snug.networks.garment_network import make_network
from snug.networks.trained_model import TrainedModel
from snug.recipe import DEFAULT
from tests.snug.body.test_smpl_files import saved, smpl_arrays
from tests.snug.motion.motion_forms import amc_frame, bvh, cmu_like
from tests.snug.training.dressing import tailored

NUMBERS = [*b"-1 0 1e300 nan inf 99999999999999999999".split(), b"9" * 5000, b"1000000000", b""]


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
            word = draw.choice((b"\xff" * 8, b"\xff\xff\xff\x7f", b"\0" * 16))
            data = data[:at] + word + data[at + 8 :]
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
MATERIAL = "young_modulus = 1e5\npoisson_ratio = 0.3\nthickness = 5e-4\n"
CLIP = ":FULLY-SPECIFIED\n:DEGREES\n" + amc_frame(1) + amc_frame(2)


def write_body(path: Path) -> None:
    saved(path, smpl_arrays(Body.load()))


def write_model(path: Path) -> None:
    network = make_network("pbns", 7, 4, DEFAULT, seed=0)
    TrainedModel("pbns", network, DEFAULT, history=[{"step": 1.0}]).save(path)


def write_shirt(path: Path) -> None:
    shirt = tailored("tshirt", 200)
    write_obj(path, shirt.rest_positions, shirt.faces)


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


# File -> writer of a valid one, its reader.
READERS: dict[str, tuple[Callable[[Path], object], Callable[[Path], object]]] = {
    "arrays.npz": (lambda path: np.savez(path, a=CORNERS, b=FACES), read_arrays),
    "body.npz": (write_body, read_body),
    "amass.npz": (lambda path: np.savez_compressed(path, **AMASS), load_motions),
    "body.pkl": (write_body, read_body),
    "garment.obj": (write_shirt, lambda path: read_garment(path, Body.load())),
    "material.toml": (lambda path: path.write_text(MATERIAL), read_material),
    "motion.bvh": (lambda path: path.write_text(bvh(Y_UP, PATH, 60.0)), load_motions),
    "roll_out.npz": (lambda path: np.savez_compressed(path, **ROLL_OUT), read_roll_out),
    "roll_out.pkl": (lambda path: path.write_bytes(pickle.dumps(HOOD)), read_roll_out),
    "cache.pc2": (lambda path: write_point_cache(path, ROLLED_OUT), read_point_cache),
    "clip.amc": (lambda path: path.write_text(CLIP), read_amc),
    "skeleton.asf": (lambda path: path.write_text(cmu_like()), read_asf),
    **{f"mesh{ending}": (lambda path: MESH.write(path), read_cloth) for ending in (".obj", ".ply")},
    "trajectory.vtkhdf": (ROLLED_OUT.save, Trajectory.load),
    "model.safetensors": (write_model, TrainedModel.load),
}
QUICK = ("arrays.npz", "amass.npz", "body.pkl", "motion.bvh", "clip.amc", "skeleton.asf")


@pytest.mark.parametrize(
    ("name", "count"),
    [*((name, 8) for name in QUICK), *(pytest.param(n, 100, marks=pytest.mark.slow) for n in READERS)],
)
def test_mutated_files_are_refused_in_one_line_that_names_them(name, count, tmp_path):
    """Read a valid file, then mutated ones, always the same: most are refused, all at once."""
    (write, read), whole, path, refused = READERS[name], tmp_path / name, tmp_path / f"mutated_{name}", 0
    write(whole)
    read(whole)
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
    before = peak_memory()
    for number in range(count):
        path.write_bytes(mutated(whole.read_bytes(), random.Random(number)))
        clock = time.process_time()  # a busy machine makes no problem
        try:
            read(path)
        except ValueError as error:
            refused += 1
            line = str(error)
            assert path.stem in line and "\n" not in line and len(line) < 1000, (number, line)
            assert type(error).__module__.startswith(("reference_sim", "snug", "benchmarks")), number
        assert time.process_time() - clock < 10.0, number
    assert refused > count / 3 and peak_memory() < before + 1000.0


@pytest.mark.parametrize("name", [b"a" * 246, b"walk\xff", b"two\nlines", b"=1+1"])
def test_a_motion_that_no_file_can_be_named_after_is_refused(name, tmp_path):
    path = tmp_path / os.fsdecode(name + b".npz")
    path.write_bytes(b"")
    with pytest.raises(MotionError, match="a name of at most 100 bytes") as refused:
        load_motions(path)
    assert str(refused.value).isascii() and "\n" not in str(refused.value)
