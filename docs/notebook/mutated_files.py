"""Damaged files against every reader of a user's files: python docs/notebook/mutated_files.py COUNT [SEED].

Small valid files are damaged at random: bits flipped, cut off, blocks doubled or gone, lengths and counts
made huge, pieces of text exchanged. Each is read in a process of its own under a cap of memory, beyond what
is loaded, and a limit of CPU time. A reader may return, or refuse with an error of this project in one line;
all else is a finding, and its file is kept.
"""

from __future__ import annotations

import os
import pickle
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}

import numpy as np
import pyvista as pv
import torch

from benchmarks.assets.assets import embedded_motions
from benchmarks.external.roll_out_files import read_roll_out
from benchmarks.results.json_file import read_json
from reference_sim import Trajectory
from reference_sim.files.array_file import read_array, read_arrays
from reference_sim.files.mesh_files import read_mesh, read_sequence
from reference_sim.trajectory.point_cache import write_obj, write_point_cache
from reference_sim.trajectory.resume import recover
from snug.body.smpl_files import read_body
from snug.garments.options import GarmentFile
from snug.garments.reading import read_garment
from snug.garments.templates import tailor_tshirt
from snug.motion.files import load_motions
from snug.motion.options import MotionFileOptions
from snug.networks.tensor_file import read_tensors, write_tensors
from tests.snug.body.other_bodies import plain_arrays
from tests.snug.motion.cmu_clips import amc_frame, write_clip
from tests.snug.motion.motion_forms import write_forms

MEMORY, SECONDS = 2 << 30, 10.0  # of CPU time, so that a busy machine makes no findings
PATIENCE = 12.0 * SECONDS  # by the clock, for a reader that waits for ever
HUGE = (0, 1, 255, 2**16, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63 - 1, 2**64 - 1)
PROJECT = ("benchmarks", "reference_sim", "reports", "snug")


def write_files(folder: Path) -> dict[Path, Callable[[Path], object]]:
    """Write small valid files of each kind; return file -> its reader."""
    random = np.random.default_rng(0)
    sheet = pv.Plane(i_resolution=4, j_resolution=4).triangulate()
    positions, faces = np.asarray(sheet.points, float), sheet.regular_faces
    made: dict[Path, Callable[[Path], object]] = {}
    for suffix in (".ply", ".vtk", ".vtp", ".stl", ".obj"):
        sheet.save(folder / f"binary{suffix}")
        made[folder / f"binary{suffix}"] = read_mesh
        if suffix != ".obj":
            sheet.save(folder / f"ascii{suffix}", binary=False)
            made[folder / f"ascii{suffix}"] = read_mesh
    body = read_body(None)
    shirt = tailor_tshirt(body, vertices=200)
    write_obj(folder / "shirt.obj", shirt.rest_positions, shirt.faces)
    (folder / "cotton.toml").write_text("young_modulus = 1e5\npoisson_ratio = 0.3\nthickness = 5e-4\n")
    made[folder / "shirt.obj"] = partial(read_garment, body=body)
    made[folder / "cotton.toml"] = lambda path: read_garment(
        GarmentFile(path=folder / "shirt.obj", material=path), body
    )
    moving = positions + random.normal(0.0, 0.01, (6, *positions.shape))
    trajectory = Trajectory(moving, faces, 0.1 * np.arange(6))
    for name in ("run", "roll_out", "resumed"):
        trajectory.save(folder / f"{name}.vtkhdf")
    made[folder / "run.vtkhdf"] = Trajectory.load
    made[folder / "roll_out.vtkhdf"] = read_roll_out
    made[folder / "resumed.vtkhdf"] = partial(recover, provenance={}, frames=6)
    made[write_point_cache(folder / "cache.pc2", trajectory)[0]] = read_roll_out
    arrays = {"positions": moving, "faces": faces, "fps": 30.0}
    np.savez(folder / "roll.npz", **arrays)
    np.savez_compressed(folder / "packed.npz", **arrays)
    (folder / "roll.pkl").write_bytes(pickle.dumps({"pred": moving, "cloth_faces": faces}))
    made |= dict.fromkeys([folder / name for name in ("roll.npz", "packed.npz", "roll.pkl")], read_roll_out)
    np.save(folder / "plain.npy", moving)
    made[folder / "plain.npy"] = read_array
    np.savez(folder / "plain.npz", **arrays)
    made[folder / "plain.npz"] = read_arrays
    meshes = folder / "frames"
    meshes.mkdir()
    for frame in range(3):
        write_obj(meshes / f"cloth_{frame}.obj", moving[frame], faces)
    made[meshes / "cloth_1.obj"] = lambda path: read_sequence(path.parent)
    motion = embedded_motions(["walk"])[0].cut(0, 5)
    for path in write_forms(folder, motion):
        made[path] = load_motions
    clips = folder / "clips"
    clips.mkdir()
    write_clip(clips, [amc_frame(n, lhumerus=(1.0, 2.0, 3.0)) for n in range(1, 6)])
    made[clips / "07_01.amc"] = load_motions
    made[clips / "07.asf"] = lambda path: load_motions(path.parent)
    (folder / "joints.toml").write_text('pelvis = "Hips"\nspine1 = "Spine"\n')
    made[folder / "joints.toml"] = lambda path: load_motions(
        folder / "mixamo.bvh", options=MotionFileOptions(joint_map=path)
    )
    small = plain_arrays(body)
    np.savez(folder / "body.npz", **small)
    (folder / "body.pkl").write_bytes(pickle.dumps(small))
    made |= {folder / name: read_body for name in ("body.npz", "body.pkl")}
    made[write_tensors(folder / "net.safetensors", {"w": torch.zeros(4, 4)}, {"kind": "x"})] = read_tensors
    (folder / "numbers.json").write_text('{"a": [1, 2, {"b": null}], "c": "text"}')
    made[folder / "numbers.json"] = read_json
    return made


def damaged(data: bytes, random: np.random.Generator) -> bytes:
    """Damage the bytes in one to three ways."""
    for _ in range(random.integers(1, 4)):
        data = WAYS[random.integers(len(WAYS))](bytearray(data), random)
    return data


def _flip(data: bytearray, random: np.random.Generator) -> bytes:
    for place in random.integers(len(data), size=random.integers(1, 9)) if data else ():
        data[place] ^= 1 << int(random.integers(8))
    return bytes(data)


def _cut(data: bytearray, random: np.random.Generator) -> bytes:
    return bytes(data[: random.integers(len(data) + 1)])


def _double(data: bytearray, random: np.random.Generator) -> bytes:
    start, end = _block(data, random)
    return bytes(data[:end] + data[start:])


def _remove(data: bytearray, random: np.random.Generator) -> bytes:
    start, end = _block(data, random)
    return bytes(data[:start] + data[end:])


def _count(data: bytearray, random: np.random.Generator) -> bytes:
    """Overwrite 4 or 8 bytes, more often near the head, where formats have their counts."""
    size = int(random.choice([4, 8]))
    place = int(len(data) * random.random() ** 3)
    number = HUGE[random.integers(len(HUGE))] % (1 << 8 * size)
    data[place : place + size] = number.to_bytes(size, "little")
    return bytes(data)


def _number(data: bytearray, random: np.random.Generator) -> bytes:
    """Replace a number written as text."""
    found = list(re.finditer(rb"\d+", bytes(data)))
    if not found:
        return bytes(data)
    match = found[int(len(found) * random.random() ** 3)]
    word = random.choice(["-1", "0", "99999999999", "1e400", "nan", "x", "4294967295", "9" * 5000])
    return bytes(data[: match.start()]) + word.encode() + bytes(data[match.end() :])


def _lines(data: bytearray, random: np.random.Generator) -> bytes:
    """Exchange two lines."""
    lines = bytes(data).split(b"\n")
    one, other = random.integers(len(lines), size=2)
    lines[one], lines[other] = lines[other], lines[one]
    return b"\n".join(lines)


def _block(data: bytearray, random: np.random.Generator) -> tuple[int, int]:
    start = int(random.integers(len(data) + 1))
    return start, min(len(data), start + int(2 ** random.uniform(0, 12)))


WAYS = (_flip, _cut, _double, _remove, _count, _number, _lines)


def outcome_of(read: Callable[[Path], object], path: Path) -> tuple[str, float, float]:
    """Read in a process; return "read", "refused" or a finding, CPU time [s], and peak memory [MB].

    The peak includes what the project has loaded, some 400 MB.
    """
    loaded = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    receiver, sender = os.pipe()
    started = time.monotonic()
    if (child := os.fork()) == 0:
        resource.setrlimit(resource.RLIMIT_AS, (loaded + MEMORY, resource.RLIM_INFINITY))
        resource.setrlimit(resource.RLIMIT_CPU, (int(SECONDS), int(SECONDS)))
        for stream in (1, 2):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
        try:
            read(path)
            line = "read"
        except ValueError as error:
            of_project = type(error).__module__.partition(".")[0] in PROJECT
            short = of_project and "\n" not in str(error) and len(str(error)) < 1000
            line = "refused" if short else traceback.format_exc()
        except BaseException:
            line = traceback.format_exc()
        os.write(sender, line[-3000:].encode(errors="replace"))
        os._exit(0)
    os.close(sender)
    status, usage, done = 0, None, 0
    while not done:
        done, status, usage = os.wait4(child, os.WNOHANG)
        if not done and time.monotonic() - started > PATIENCE:
            os.kill(child, signal.SIGKILL)
            done, status, usage = os.wait4(child, 0)
        elif not done:
            time.sleep(0.002)
    seconds, waited = usage.ru_utime + usage.ru_stime, time.monotonic() - started
    with os.fdopen(receiver, "rb") as stream:
        line = stream.read().decode()
    if not line and waited > PATIENCE:
        line = f"no answer in {waited:.0f} s"
    elif not line or seconds > SECONDS:
        line = f"killed by signal {status & 127} after {seconds:.1f} s of CPU time"
    return line, seconds, usage.ru_maxrss / 1024


def main(count: int, seed: int = 0) -> None:
    """Damage the files in turn; print the findings, what came of each kind, and the largest peak."""
    random = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        made = write_files(Path(folder))
        for path, read in made.items():
            with suppress(ValueError):
                read(path)  # compiles what it needs: the limit of time is for reading
            whole = outcome_of(read, path)[0]
            assert whole in ("read", "refused"), (path, whole)
            if whole == "refused":
                print(f"{path.name}: refused while whole")
        kinds: dict[str, Counter[str]] = {}
        longest, peak = (0.0, ""), (0.0, "")
        kept = Path(tempfile.mkdtemp(prefix="mutated_"))
        for number in range(count):
            path, read = list(made.items())[number % len(made)]
            whole = path.read_bytes()
            path.write_bytes(damaged(whole, random))
            line, seconds, memory = outcome_of(read, path)
            longest, peak = max(longest, (seconds, path.name)), max(peak, (memory, path.name))
            kinds.setdefault(path.suffix, Counter())[line if line in ("read", "refused") else "found"] += 1
            if line not in ("read", "refused"):
                shutil.copy(path, kept / f"{number}_{path.name}")
                print(f"--- {number} {path.name}:\n{line}", flush=True)
            path.write_bytes(whole)
    for suffix, counts in sorted(kinds.items()):
        print(suffix, dict(counts))
    print(
        f"longest {longest[0]:.1f} s of CPU time ({longest[1]}), "
        f"largest peak {peak[0]:.0f} MB ({peak[1]}); {kept}"
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
