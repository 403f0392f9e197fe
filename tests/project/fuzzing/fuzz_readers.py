"""Mutated files given to every reader of a user's files; what went wrong is printed as JSON.

`python -m tests.project.fuzzing.fuzz_readers COUNT FOLDER` in the repository; FOLDER exists and is empty.

A process of its own: a reader that crashes the interpreter, or takes all memory, is found out too. READERS is
the table; a new reader is one line in it.
"""

from __future__ import annotations

import faulthandler
import json
import os
import random
import re
import sys
import time
import traceback
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.external.roll_out_files import RollOutFileError, read_roll_out
from benchmarks.results.row import ResultsError
from benchmarks.results.run_folder import RunFolder
from benchmarks.timing import peak_memory
from reference_sim import Trajectory, TrajectoryError
from reference_sim.cloth import Cloth, MeshError
from reference_sim.files.array_file import ArrayFileError, read_arrays
from reference_sim.files.mesh_files import read_mesh
from reference_sim.trajectory import read_point_cache
from snug.body.parametric_body import Body
from snug.body.skeleton import BodyError
from snug.body.smpl_files import read_body
from snug.file_options import GarmentFile, MotionFileOptions
from snug.garments.garment import GarmentError
from snug.garments.reading import read_garment
from snug.motion.files import load_motions
from snug.motion.motion import MotionError
from snug.networks.tensor_file import read_tensors, write_tensors
from snug.networks.trained_model import ModelFileError, TrainedModel
from tests.project.fuzzing import samples
from tests.reports.report_folder import all_rows
from tests.snug.body.other_bodies import smpl_arrays

NUMBERS = (b"-1", b"0", b"1e300", b"nan", b"inf", b"99999999999999999999", b"9" * 5000, b"1000000000", b"")
VALUES = (None, True, -1, 0, 1e300, 10**30, "x", "\0" * 300, [], {}, [[]], {"a": {}}, float("nan"))


def bytes_of(data: bytes, draw: random.Random) -> bytes:
    """Make one to three mutations: bits, cuts, repeats, other numbers, words of ones."""
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


class Reader(NamedTuple):
    """A valid file, what reads it, and what may be raised. mutate: of bytes, or of the values in JSON."""

    name: str
    suffix: str
    make: Callable[[], bytes]
    read: Callable[[Path], object]
    error: type[Exception]
    mutate: Callable[[bytes, random.Random], bytes]


def read_cloth(path: Path) -> None:
    surface = read_mesh(path)
    Cloth(surface.positions, surface.faces)


def read_material(path: Path) -> None:
    mesh = path.with_suffix(".obj")
    mesh.write_bytes(SHIRT())
    read_garment(GarmentFile(path=mesh, material=path), Body.load())


def read_joints(path: Path) -> None:
    path.with_suffix(".bvh").write_bytes(samples.bvh_text())
    load_motions(path.with_suffix(".bvh"), options=MotionFileOptions(joint_map=path))


def read_amc(path: Path) -> None:
    path.with_suffix(".asf").write_bytes(samples.skeleton_text())
    load_motions(path)


def read_asf(path: Path) -> None:
    path.with_suffix(".amc").write_bytes(samples.clip_text())
    load_motions(path.with_suffix(".amc"))


def read_header(path: Path) -> None:
    """A model whose header says something else, and whose digest is right."""
    tensors, _ = read_tensors(Path("model.safetensors"))
    write_tensors(path.with_suffix(".safetensors"), tensors, json.loads(path.read_bytes()))
    TrainedModel.load(path.with_suffix(".safetensors"))


def read_rows(path: Path, name: str = "results.csv") -> None:
    """Read a run whose file `name` is the one at `path`, the others intact, up to the report's tables."""
    from reports.blocks import Report
    from reports.finished_run import read_run
    from reports.pdf import content
    from reports.tables import make_tables

    folder = RunFolder(path.parent / "run")
    folder.write_rows(all_rows())
    folder.config_path.write_bytes(Path("run.json").read_bytes())
    (folder.path / name).write_bytes(path.read_bytes())
    run = read_run(folder)
    json.dumps(content(Report(run, make_tables(run), {})), allow_nan=False)


def read_config(path: Path) -> None:
    read_rows(path, "run.json")


SHIRT, body = cache(samples.shirt), cache(lambda: smpl_arrays(Body.load()))
READERS: tuple[Reader, ...] = (
    Reader("arrays", ".npz", samples.arrays(a=samples.CORNERS, b=samples.FACES),
           read_arrays, ArrayFileError, bytes_of),
    Reader("body", ".npz", lambda: samples.arrays(**body())(), read_body, BodyError, bytes_of),
    Reader("AMASS", ".npz", samples.arrays(**samples.amass_arrays()), load_motions, MotionError, bytes_of),
    Reader("body pickle", ".pkl", lambda: samples.pickled(body())(), read_body, BodyError, bytes_of),
    Reader("garment", ".obj", SHIRT, lambda path: read_garment(path, Body.load()), GarmentError, bytes_of),
    Reader("material", ".toml", lambda: samples.MATERIAL, read_material, GarmentError, bytes_of),
    Reader("joints", ".toml", lambda: samples.JOINTS, read_joints, MotionError, bytes_of),
    Reader("BVH", ".bvh", samples.bvh_text, load_motions, MotionError, bytes_of),
    Reader("roll-out", ".npz", samples.arrays(**samples.roll_out()),
           read_roll_out, RollOutFileError, bytes_of),
    Reader("roll-out pickle", ".pkl", samples.pickled(samples.hood_arrays()),
           read_roll_out, RollOutFileError, bytes_of),
    Reader("PC2", ".pc2", samples.point_cache, read_point_cache, TrajectoryError, bytes_of),
    Reader("amc", ".amc", samples.clip_text, read_amc, MotionError, bytes_of),
    Reader("asf", ".asf", samples.skeleton_text, read_asf, MotionError, bytes_of),
    Reader("OBJ", ".obj", samples.mesh(".obj"), read_cloth, MeshError, bytes_of),
    Reader("binary PLY", ".ply", samples.mesh(".ply"), read_cloth, MeshError, bytes_of),
    Reader("OFF", ".off", samples.mesh(".off"), read_cloth, MeshError, bytes_of),
    Reader("VTK", ".vtk", samples.mesh(".vtk", binary=False), read_cloth, MeshError, bytes_of),
    Reader("VTP", ".vtp", samples.polydata(".vtp"), read_cloth, MeshError, bytes_of),
    Reader("VTU", ".vtu", samples.mesh(".vtu"), read_cloth, MeshError, bytes_of),
    Reader("trajectory", ".vtkhdf", samples.trajectory, Trajectory.load, TrajectoryError, bytes_of),
    Reader("model", ".safetensors", samples.model_file, TrainedModel.load, ModelFileError, bytes_of),
    Reader("model's header", ".json", samples.model_header, read_header, ModelFileError, values_of),
    Reader("results.csv", ".csv", samples.results_csv, read_rows, ResultsError, bytes_of),
    Reader("run.json", ".json", samples.run_json, read_config, ResultsError, bytes_of),
    Reader("values of run.json", ".json", samples.run_json, read_config, ResultsError, values_of),
)  # fmt: skip


def problem_of(reader: Reader, path: Path) -> tuple[str, bool]:
    """Return the fault in how `reader` handles a file (empty if none), and whether it refused the file."""
    try:
        reader.read(path)
    except reader.error as error:
        text = str(error)
        return "" if "\n" not in text and len(text) < 1000 else f"no one line: {text[:200]!r}", True
    except Exception:
        return traceback.format_exc(limit=-3), True
    return "", False


def main(count: int, folder: Path) -> dict[str, Any]:
    """Read `count` mutated files over all readers in turn, always the same ones."""
    os.chdir(folder)
    problems, refused, slowest = [], 0, 0.0
    valid = [reader.make() for reader in READERS]
    samples.run_json()
    for reader, data in zip(READERS, valid):
        Path(f"whole{reader.suffix}").write_bytes(data)
        print(reader.name, file=sys.stderr, flush=True)
        reader.read(Path(f"whole{reader.suffix}"))  # what nobody has touched is read
    for number in range(count):
        reader, data = READERS[number % len(READERS)], valid[number % len(READERS)]
        path = folder / f"mutated{reader.suffix}"
        path.write_bytes(reader.mutate(data, random.Random(number)))
        Path("last").write_text(f"{reader.name} {number}")  # to be found after a crash
        faulthandler.dump_traceback_later(120, exit=True)
        clock = time.process_time()  # a busy machine makes no problem
        problem, was_refused = problem_of(reader, path)
        slowest, refused = max(slowest, time.process_time() - clock), refused + was_refused
        if problem:
            problems.append({"reader": reader.name, "number": number, "problem": problem})
    return {"problems": problems, "refused": refused, "slowest": slowest, "peak": peak_memory()}


if __name__ == "__main__":
    sys.stdout, out = sys.stderr, sys.stdout
    out.write(json.dumps(main(int(sys.argv[1]), Path(sys.argv[2]).resolve()), indent=1))
