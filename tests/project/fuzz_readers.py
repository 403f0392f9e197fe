"""Mutated files given to every reader of a user's files; what went wrong is printed as JSON.

`python -m tests.project.fuzz_readers COUNT FOLDER [FIRST]` in the repository; FOLDER is there, and empty.

A process of its own: a reader that crashes the interpreter, or takes all memory, is found out too. READERS is
the table; a new reader is one line in it.
"""

from __future__ import annotations

import dataclasses
import faulthandler
import io
import json
import os
import pickle
import random
import re
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse

from benchmarks.external.roll_out_files import read_roll_out
from benchmarks.external.roll_out_option import RollOutFileError
from benchmarks.process.memory import peak_memory
from benchmarks.results.json_file import ResultsError, read_json
from benchmarks.results.run_folder import RunFolder
from reference_sim import Trajectory, TrajectoryError
from reference_sim.cloth import Cloth, MeshError
from reference_sim.files.array_file import ArrayFileError, read_array, read_arrays
from reference_sim.files.mesh_files import read_mesh
from reference_sim.trajectory.point_cache import read_point_cache, write_obj, write_point_cache
from reference_sim.trajectory.resume import recover
from snug.body.parametric_body import Body
from snug.body.plain_pickle import PlainPickleError, read_plain_pickle
from snug.body.skeleton import BodyError
from snug.body.smpl_files import read_body
from snug.garments.garment import GarmentError
from snug.garments.options import GarmentFile
from snug.garments.reading import read_garment
from snug.garments.templates import find_template
from snug.motion.files import load_motions
from snug.motion.motion import MotionError
from snug.motion.options import MotionFileOptions
from snug.networks.architectures import make_network
from snug.networks.tensor_file import read_tensors, write_tensors
from snug.networks.trained_model import ModelFileError, TrainedModel
from snug.recipes.recipe import DEFAULT
from tests.reports.report_folder import SCENES, all_rows, declaration
from tests.snug.motion.cmu_clips import amc_frame, cmu_like
from tests.snug.motion.motion_forms import bvh

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
MATERIAL = b"young_modulus = 1e5\npoisson_ratio = 0.3\nthickness = 5e-4\n"
JOINTS = b'pelvis = "pelvis"\nspine1 = "spine1"\n'


class Reader(NamedTuple):
    """A valid file, what reads it, and what may be raised. mutate: of bytes, or of the values in JSON."""

    name: str
    suffix: str
    make: Callable[[], bytes]
    read: Callable[[Path], object]
    errors: tuple[type[Exception], ...]
    mutate: Callable[[bytes, random.Random], bytes]


# --- valid files -------------------------------------------------------------------------------------------


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
    def make() -> bytes:
        stream = io.BytesIO()
        np.savez_compressed(stream, **named)
        return stream.getvalue()

    return make


def smpl_arrays() -> dict[str, np.ndarray]:
    body = Body.load()
    keep = {"v_template": body.template, "weights": body.skinning_weights, "J_template": body.joint_template}
    parents = np.stack([body.parents, np.arange(24)]).astype(np.int64)
    directions = {"shapedirs": body.shape_directions, "J_shapedirs": body.joint_directions}
    return keep | directions | {"kintree_table": parents, "f": body.faces}


def amass_arrays() -> dict[str, np.ndarray]:
    poses = np.random.default_rng(0).normal(0.0, 0.1, (6, 72))
    poses[:, :3] = [np.pi / 2, 0.0, 0.0]
    return {"poses": poses, "trans": np.tile([0.0, 0.0, 0.9], (6, 1)), "mocap_framerate": np.array(60.0)}


def roll_out() -> dict[str, np.ndarray]:
    return {"positions": np.stack([CORNERS, CORNERS + 0.1]), "faces": FACES, "fps": np.array(30.0)}


def hood_arrays() -> dict[str, np.ndarray]:
    body = {"obstacle": roll_out()["positions"], "obstacle_faces": FACES}
    return {"pred": roll_out()["positions"], "cloth_faces": FACES} | body


def pickled(arrays: Callable[[], dict[str, np.ndarray]]) -> Callable[[], bytes]:
    return lambda: pickle.dumps(arrays())


def anything() -> dict[str, Any]:
    sparse = scipy.sparse.csc_matrix(np.eye(3))
    return {**roll_out(), "J": sparse, "names": np.array(["neck"]), "more": [(1, None, True), {"a"}]}


def shirt() -> bytes:
    made = find_template("tshirt").tailor(Body.load(), vertices=200)
    return written(".obj", lambda path: write_obj(path, made.rest_positions, made.faces))


def bvh_text() -> bytes:
    clip = amass_arrays()
    poses = clip["poses"].reshape(-1, 24, 3)
    poses[:, 0] = 0.0  # y up
    return bvh(poses, clip["trans"], 60.0).encode()


def point_cache() -> bytes:
    positions = roll_out()["positions"]
    made = Trajectory(positions, FACES, np.array([0.0, 0.1]), np.zeros(2), "ok")
    return write_point_cache("made.pc2", made)[0].read_bytes()


def trajectory() -> bytes:
    made = Trajectory(
        np.stack([CORNERS, CORNERS + 0.1]), FACES, np.array([0.0, 0.1]), np.zeros(2), "ok",
        frame_fields={"iterations": np.arange(2.0)},
    )  # fmt: skip
    return written(".vtkhdf", made.save)


def model() -> TrainedModel:
    network = make_network("pbns", 7, 4, DEFAULT, seed=0)
    return TrainedModel("pbns", network, DEFAULT, history=[{"step": 1.0}])


def model_header() -> bytes:
    model().save("model.safetensors")
    return json.dumps(read_tensors(Path("model.safetensors"))[1]).encode()


def results_csv() -> bytes:
    RunFolder(".").write_rows(all_rows())
    return Path("results.csv").read_bytes()


def frame_energies_csv() -> bytes:
    lines = [f"{SCENES[0]},{m},0,{k / 10},{k + 1}e-3,.5" for m in ("snug", "pbns") for k in range(4)]
    return "\n".join(["scene,method,seed,seconds,strain,total", *lines, ""]).encode()


def run_json() -> bytes:
    settings = {"preset": "smoke", "stages": [{"name": "cells", "seconds": 1.0}], "earlier": []}
    RunFolder(".").write_config(declaration(all_rows(), **settings, started="2030-01-02T03:04:05+00:00"))
    return Path("run.json").read_bytes()


# --- what reads them ---------------------------------------------------------------------------------------


def read_cloth(path: Path) -> None:
    surface = read_mesh(path)
    Cloth(surface.positions, surface.faces)


def read_clip(path: Path) -> None:
    load_motions(path)


def read_worn(path: Path) -> None:
    read_garment(path, Body.load())


def read_material(path: Path) -> None:
    mesh = path.with_suffix(".obj")
    if not mesh.is_file():
        mesh.write_bytes(shirt())
    read_garment(GarmentFile(path=mesh, material=path), Body.load())


def read_joints(path: Path) -> None:
    path.with_suffix(".bvh").write_bytes(bvh_text())
    load_motions(path.with_suffix(".bvh"), options=MotionFileOptions(joint_map=path))


def read_amc(path: Path) -> None:
    path.with_suffix(".asf").write_text(cmu_like())
    read_clip(path)


def read_asf(path: Path) -> None:
    clip = path.with_suffix(".amc")
    clip.write_text(":FULLY-SPECIFIED\n:DEGREES\n" + amc_frame(1) + amc_frame(2))
    read_clip(clip)


def read_resumed(path: Path) -> None:
    recover(path, {}, frames=9)


def read_header(path: Path) -> None:
    """A model whose header says something else, and whose digest is right."""
    tensors, _ = read_tensors(Path("model.safetensors"))
    write_tensors(path.with_suffix(".safetensors"), tensors, json.loads(path.read_bytes()))
    TrainedModel.load(path.with_suffix(".safetensors"))


def read_rows(path: Path, name: str = "results.csv") -> None:
    """Read a run whose file `name` is the one at `path`, the others intact, up to the report's tables."""
    from reports.blocks.block import Report
    from reports.document.content import content
    from reports.run.reading import read_run
    from reports.tables import make_tables

    folder = RunFolder(path.parent / "run")
    folder.write_rows(all_rows())
    folder.config_path.write_bytes(Path("run.json").read_bytes())
    (folder.path / name).write_bytes(path.read_bytes())
    run = read_run(folder)
    json.dumps(content(Report(run, make_tables(run), {})), allow_nan=False)


def read_config(path: Path) -> None:
    read_rows(path, "run.json")


def read_frames(path: Path) -> None:
    read_rows(path, "frame_energies.csv")


# --- mutations ---------------------------------------------------------------------------------------------

NUMBERS = (b"-1", b"0", b"1e300", b"nan", b"inf", b"99999999999999999999", b"9" * 5000, b"1000000000", b"")
VALUES = (None, True, -1, 0, 1e300, 10**30, "x", "\0" * 300, [], {}, [[]], {"a": {}}, float("nan"))


def bytes_of(data: bytes, draw: random.Random) -> bytes:
    """One to three mutations: bits, cuts, repeats, other numbers, words of ones."""
    for _ in range(draw.randint(1, 3)):
        at, end = sorted(draw.randint(0, len(data)) for _ in range(2))
        kind = draw.randrange(7)
        if kind == 0 and data:
            changed = bytearray(data)
            for _ in range(draw.randint(1, 8)):
                changed[draw.randrange(len(changed))] ^= 1 << draw.randrange(8)
            data = bytes(changed)
        elif kind == 1:
            data = data[:at]
        elif kind == 2:
            data = data[:at] + data[min(end, at + 64) :]
        elif kind == 3:
            data = data[:end] + data[at:]
        elif kind == 4:
            data = data[:at] + draw.choice((b"\xff" * 8, b"\xff\xff\xff\x7f", b"\0" * 16)) + data[at + 8 :]
        elif kind == 5 and (matches := list(re.finditer(rb"\d+(\.\d+)?", data))):
            number = draw.choice(matches)
            data = data[: number.start()] + draw.choice(NUMBERS) + data[number.end() :]
        else:
            data = data[:at] + draw.randbytes(draw.randint(0, 40)) + data[at:]
    return data


def values_of(data: bytes, draw: random.Random) -> bytes:
    """One to three values anywhere in a JSON object are others, or are gone."""
    value = json.loads(data)
    for _ in range(draw.randint(1, 3)):
        inner, place = value, draw.choice(list(value) or ["x"])
        while isinstance(inner, dict | list) and draw.random() < 0.7:
            inside = inner.get(place) if isinstance(inner, dict) else inner[place]
            if not isinstance(inside, dict | list) or not inside:
                break
            inner = inside
            place = draw.choice(list(inner)) if isinstance(inner, dict) else draw.randrange(len(inner))
        if draw.random() < 0.2:
            inner.pop(place, None) if isinstance(inner, dict) else inner.pop(place)
        else:
            inner[place] = draw.choice(VALUES)
    return json.dumps(value).encode()


# --- the table ---------------------------------------------------------------------------------------------

MESH = (MeshError,)
READERS: tuple[Reader, ...] = (
    Reader("array", ".npy", lambda: arrays_npy(), read_array, (ArrayFileError,), bytes_of),
    Reader("arrays", ".npz", arrays(a=CORNERS, b=FACES), read_arrays, (ArrayFileError,), bytes_of),
    Reader("body", ".npz", arrays(**smpl_arrays()), read_body, (BodyError,), bytes_of),
    Reader("AMASS", ".npz", arrays(**amass_arrays()), read_clip, (MotionError,), bytes_of),
    Reader("body pickle", ".pkl", pickled(smpl_arrays), read_body, (BodyError,), bytes_of),
    Reader("motion pickle", ".pkl", pickled(amass_arrays), read_clip, (MotionError,), bytes_of),
    Reader("plain pickle", ".pkl", pickled(anything), read_plain_pickle, (PlainPickleError,), bytes_of),
    Reader("garment", ".obj", shirt, read_worn, (GarmentError,), bytes_of),
    Reader("material", ".toml", lambda: MATERIAL, read_material, (GarmentError,), bytes_of),
    Reader("joints", ".toml", lambda: JOINTS, read_joints, (MotionError,), bytes_of),
    Reader("JSON", ".json", run_json, read_json, (ResultsError,), bytes_of),
    Reader("BVH", ".bvh", lambda: bvh_text(), read_clip, (MotionError,), bytes_of),
    Reader("roll-out", ".npz", arrays(**roll_out()), read_roll_out, (RollOutFileError,), bytes_of),
    Reader("roll-out pickle", ".pkl", pickled(hood_arrays), read_roll_out, (RollOutFileError,), bytes_of),
    Reader("PC2", ".pc2", lambda: point_cache(), read_point_cache, (TrajectoryError,), bytes_of),
    Reader("amc", ".amc", lambda: clip_text(), read_amc, (MotionError,), bytes_of),
    Reader("asf", ".asf", lambda: cmu_like().encode(), read_asf, (MotionError,), bytes_of),
    Reader("OBJ", ".obj", mesh(".obj"), read_cloth, MESH, bytes_of),
    Reader("PLY", ".ply", mesh(".ply", binary=False), read_cloth, MESH, bytes_of),
    Reader("binary PLY", ".ply", mesh(".ply"), read_cloth, MESH, bytes_of),
    Reader("STL", ".stl", mesh(".stl", binary=False), read_cloth, MESH, bytes_of),
    Reader("binary STL", ".stl", mesh(".stl", binary=True), read_cloth, MESH, bytes_of),
    Reader("OFF", ".off", mesh(".off"), read_cloth, MESH, bytes_of),
    Reader("VTK", ".vtk", mesh(".vtk", binary=False), read_cloth, MESH, bytes_of),
    Reader("VTK polygons", ".vtk", polydata(".vtk"), read_cloth, MESH, bytes_of),
    Reader("VTP", ".vtp", polydata(".vtp"), read_cloth, MESH, bytes_of),
    Reader("VTU", ".vtu", mesh(".vtu"), read_cloth, MESH, bytes_of),
    Reader("trajectory", ".vtkhdf", trajectory, Trajectory.load, (TrajectoryError,), bytes_of),
    Reader("resumed", ".vtkhdf", trajectory, read_resumed, (TrajectoryError,), bytes_of),
    Reader("model", ".safetensors", lambda: written(".safetensors", model().save), TrainedModel.load,
           (ModelFileError,), bytes_of),
    Reader("model's header", ".json", model_header, read_header, (ModelFileError,), values_of),
    Reader("results.csv", ".csv", results_csv, read_rows, (ResultsError,), bytes_of),
    Reader("frame_energies.csv", ".csv", frame_energies_csv, read_frames, (ResultsError,), bytes_of),
    Reader("run.json", ".json", run_json, read_config, (ResultsError,), bytes_of),
    Reader("values of run.json", ".json", run_json, read_config, (ResultsError,), values_of),
)  # fmt: skip


def arrays_npy() -> bytes:
    stream = io.BytesIO()
    np.save(stream, CORNERS)
    return stream.getvalue()


def clip_text() -> bytes:
    return (":FULLY-SPECIFIED\n:DEGREES\n" + amc_frame(1) + amc_frame(2)).encode()


# --- running it --------------------------------------------------------------------------------------------


@dataclasses.dataclass
class Problem:
    reader: str
    number: int
    what: str
    seconds: float = 0.0


def problem_of(reader: Reader, path: Path) -> tuple[str, bool]:
    """Return the fault in how `reader` handles a file (empty if none), and whether it refused the file."""
    try:
        with quiet() as noise:
            reader.read(path)
    except reader.errors as error:
        text = str(error)
        wrong = "" if "\n" not in text and len(text) < 1000 else f"no one line: {text[:200]!r}"
        return wrong or (f"printed: {noise[0][:200]!r}" if noise else ""), True
    except Exception:
        return traceback.format_exc(limit=-3), True
    return "", False


@contextmanager
def quiet() -> Iterator[list[str]]:
    """Everything printed meanwhile, also by libraries in C, in place of printing it."""
    output: list[str] = []
    with open("printed", "w+b") as file:
        kept = [os.dup(1), os.dup(2)]
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
        try:
            yield output
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            for number, descriptor in zip((1, 2), kept):
                os.dup2(descriptor, number)
                os.close(descriptor)
            file.seek(0)
            if printed := file.read().decode(errors="replace"):
                output.append(printed)


def main(count: int, folder: Path, first: int = 0) -> dict[str, Any]:
    """`count` mutated files over all readers in turn, always the same ones, from number `first` on."""
    os.chdir(folder)
    problems, refused, slowest = [], 0, 0.0
    valid = [reader.make() for reader in READERS]
    run_json()
    for reader, data in zip(READERS, valid):
        place = Path(f"whole{reader.suffix}")
        place.write_bytes(data)
        print(reader.name, file=sys.stderr, flush=True)
        reader.read(place)  # what nobody has touched is read
    start = peak_memory()
    for number in range(first, first + count):
        reader, data = READERS[number % len(READERS)], valid[number % len(READERS)]
        path = folder / f"mutated{reader.suffix}"
        path.write_bytes(reader.mutate(data, random.Random(number)))
        Path("last").write_text(f"{reader.name} {number}")  # to be found after a crash
        faulthandler.dump_traceback_later(120, exit=True)
        clock = time.process_time()  # a busy machine makes no problem
        what, was_refused = problem_of(reader, path)
        seconds = time.process_time() - clock
        slowest, refused = max(slowest, seconds), refused + was_refused
        if what or seconds > 10.0:
            problems.append(dataclasses.asdict(Problem(reader.name, number, what, seconds)))
    peak = peak_memory()
    return {
        "problems": problems, "refused": refused, "slowest": slowest,
        "megabytes": peak - start, "peak": peak,
    }  # fmt: skip


if __name__ == "__main__":
    numbers = [int(word) for word in sys.argv[1:] if word.isdigit()]
    print(json.dumps(main(numbers[0], Path(sys.argv[2]).resolve(), *numbers[1:]), indent=1))
