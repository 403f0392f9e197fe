"""Record every value of a checkout that no clock gives, and compare two records to the last bit.

    python docs/notebook/same_numbers.py record CHECKOUT OUT.json [PART ...]
    python docs/notebook/same_numbers.py compare BEFORE.json AFTER.json

Without PART all parts are recorded: three runs (rows, curves, roll-outs, networks), a short training by
each recipe, and the energies that a test keeps. Rows about time and memory are left out. Every process
has one thread. `compare` prints each difference and counts the values; it exits with 1 where two values
differ.
"""

from __future__ import annotations

import csv
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

Record = dict[str, dict[str, str]]  # name of a result -> field -> its value as text

# What may be called otherwise in another version: options of a run, places that a name is imported from.
# Of several the first one is used that the checkout knows, so that one table serves both versions.
FURTHER = "simulation,santesteban2019,tailornet,handles-80,ncs,pbns-springs,snug+cleanup,snug-window6"
UNSEEN = "tshirt/01_01_a,tshirt/dance_turn,tshirt/push_recovery"
PACKAGED = "skinning,snug-packaged,pbns-packaged,supervised-packaged"
RUNS = {
    "smoke": ("smoke",),
    "networks": (f"smoke --scenes tshirt/01_01_a --methods {FURTHER}",),
    "packaged": (f"full:garments --set sizes.frames=20 --scenes {UNSEEN} --methods {PACKAGED}",),
}
PLACES = {
    "trainings": ("benchmarks.methods.declared_networks:TRAININGS",),
    "trajectory": ("reference_sim.trajectory:Trajectory",),
    "template": ("snug.garments.templates:find_template",),
    "motion": ("snug.motion.library:make_motion",),
    "kept": ("tests.snug.training.test_kept_energies:trained",),
}
REFUSED = 2  # exit status of a run whose options mean nothing
CLOCKS = ("ms", "s", "MB")  # units of rows that are left out, besides those called cost/...
COLUMNS = ("unit", "value", "status", "expected", "tolerance", "uncertainty", "moved")

VERTICES, FRAMES = 350, 20  # of the short trainings
STEPS = {"snug-paper": 100}  # of all others 60


def find(name: str) -> Any:
    """Return what the checkout calls so. Raises ImportError where none of the places has it."""
    for place in PLACES[name]:
        module, _, attribute = place.partition(":")
        try:
            return getattr(import_module(module), attribute)
        except (ImportError, AttributeError):
            continue
    raise ImportError(f"{name}: in none of {', '.join(PLACES[name])}: add its place to PLACES")


def digest(array: np.ndarray) -> str:
    """Return shape, type and a digest of the bytes of an array."""
    shape = "x".join(map(str, array.shape))
    return (
        f"{shape} {array.dtype} {hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()[:16]}"
    )


def record_run(forms: Iterable[str]) -> Record:
    """Carry out a run by the first of these forms that is no refused request; return what it left."""
    with tempfile.TemporaryDirectory() as folder:
        status = REFUSED
        for options in forms:
            command = [
                sys.executable,
                "-m",
                "benchmarks.run",
                *options.split(),
                "--workers",
                "1",
                "-o",
                folder,
            ]
            if status == REFUSED:
                status = subprocess.run(command, stdout=sys.stderr, check=False).returncode
        if status == REFUSED:
            sys.exit(f"benchmarks.run refuses all of {forms}: give it a form that it knows in RUNS")
        record = {"exit": {"status": str(status)}}
        for read in (rows_of, frame_energies_of, arrays_of):
            record |= read(Path(folder))
    return record


def rows_of(folder: Path) -> Record:
    """Return the rows of a run by scene, method, seed and metric; the suite may be called otherwise."""
    with (folder / "results.csv").open(newline="", encoding="utf-8") as stream:
        rows = [row for row in csv.DictReader(stream)]
    named = {
        "row " + " ".join(row[key] for key in ("scene", "method", "seed", "metric")): row
        for row in rows
        if row["unit"] not in CLOCKS and not row["metric"].startswith("cost/")
    }
    return {
        name: {column: row[column] for column in COLUMNS if row.get(column)}
        for name, row in named.items()
    }


def frame_energies_of(folder: Path) -> Record:
    """Return the lines of frame_energies.csv by scene, method, seed and time."""
    path = folder / "frame_energies.csv"
    if not path.is_file():
        return {}
    keys = ("scene", "method", "seed", "seconds")
    with path.open(newline="", encoding="utf-8") as stream:
        lines = list(csv.DictReader(stream))
    return {
        "frame " + " ".join(line[key] for key in keys): {
            n: v for n, v in line.items() if v and n not in keys
        }
        for line in lines
    }


def arrays_of(folder: Path) -> Record:
    """Return digests of the arrays in every file of a run."""
    from safetensors.numpy import load_file

    trajectory = find("trajectory")
    readers = {
        ".npz": lambda path: dict(np.load(path)),
        ".npy": lambda path: {"array": np.load(path)},
        ".safetensors": load_file,
        ".vtkhdf": lambda path: {"positions": trajectory.load(path).positions},
    }
    paths = sorted(path for path in folder.rglob("*") if path.suffix in readers)
    return {
        path.relative_to(folder).as_posix(): {n: digest(a) for n, a in readers[path.suffix](path).items()}
        for path in paths
    }


def record_trainings() -> Record:
    """Train networks for a small T-shirt briefly, one by each recipe; PBNS makes up for simulated data."""
    import snug

    body = snug.Body.load()
    dressed = snug.DressedBody(body, find("template")("tshirt").tailor(body, vertices=VERTICES))
    motions = [find("motion")(name).cut(0, FRAMES) for name in ("walk", "05_03")]
    targets: dict[str, np.ndarray] = {}
    record = {}
    trainings = find("trainings")
    for name in ("pbns", *sorted(set(trainings) - {"pbns"})):
        model = snug.train_network(
            trainings[name].kind, dressed, motions, steps=STEPS.get(name, 60), seed=0, trajectories=targets,
            recipe=trainings[name].recipe, progress=False,
        )  # fmt: skip
        targets = targets or {m.name: snug.roll_out(model, dressed, m).positions for m in motions}
        weights = {n: digest(tensor.numpy()) for n, tensor in model.network.state_dict().items()}
        losses = {
            f"last {n}": repr(value)
            for n, value in model.history[-1].items()
            if not n.startswith("seconds")
        }
        record[f"training {name}"] = weights | losses
        print(f"{name}: {len(weights)} tensors", file=sys.stderr, flush=True)
    return record


def record_kept() -> Record:
    """Return the energies of the small training that a test keeps, here to the last bit."""
    return {"kept energies": {name: repr(value) for name, value in find("kept")().items()}}


PARTS = (*RUNS, "trainings", "kept")


def record_part(part: str) -> Record:
    """Return what the code on the path of this process gives for one part."""
    if part in RUNS:
        return record_run(RUNS[part])
    return {"trainings": record_trainings, "kept": record_kept}[part]()


def record(checkout: Path, out: Path, parts: Iterable[str]) -> None:
    """Record parts of a checkout, each in a process of its own with one thread."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    environment = os.environ | threads | {"PYTHONPATH": str(checkout.resolve())}
    values: Record = {}
    for part in parts:
        command = [sys.executable, str(Path(__file__).resolve()), "part", part]
        done = subprocess.run(command, env=environment, cwd=checkout, stdout=subprocess.PIPE, check=True)
        values |= {f"{part}: {name}": fields for name, fields in json.loads(done.stdout).items()}
        out.write_text(json.dumps(values, indent=0), encoding="utf-8")
        print(f"{part} of {checkout}: {out} has {sum(map(len, values.values()))} values", file=sys.stderr)


def compare(before: Record, after: Record) -> bool:
    """Print how two records differ; return whether every value that both have is the same."""
    shared = [
        (name, field)
        for name in before.keys() & after.keys()
        for field in before[name]
        if field in after[name]
    ]
    differing = sorted((n, f) for n, f in shared if before[n][f] != after[n][f])
    for name, field in differing:
        print(f"differs: {name}, {field}: {before[name][field]} -> {after[name][field]}")
    for title, one, other in (("gone", before, after), ("new", after, before)):
        fields = [
            n if n not in other else f"{n}, {f}" for n in one for f in one[n] if f not in other.get(n, {})
        ]
        for name in sorted(set(fields)):
            print(f"{title}: {name}")
        print(f"{len(fields)} values {title}")
    print(
        f"{len(shared)} values compared: {len(shared) - len(differing)} equal, {len(differing)} not equal"
    )
    return not differing


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["record", checkout, out, *parts]:
            record(Path(checkout), Path(out), parts or PARTS)
        case ["compare", *paths] if len(paths) == 2:
            sys.exit(not compare(*(json.loads(Path(path).read_text(encoding="utf-8")) for path in paths)))
        case ["part", part]:
            print(json.dumps(record_part(part)))
        case _:
            sys.exit(__doc__)
