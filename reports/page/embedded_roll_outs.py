"""Roll-outs embedded in the page: cloths, their colours and curves, and a coarser body.

Packed arrays are integers, predicted from frame to frame, deflated, in base64, which data.js undoes.
Positions are 16-bit steps of one length per trajectory; values per vertex are 8 bits on the scale of square
roots.
"""

from __future__ import annotations

import base64
import hashlib
import zlib
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.metrics.curvature import curvature_series
from benchmarks.results.run_folder import RunFolder
from reference_sim.obstacle import Obstacle
from reference_sim.trajectory import Trajectory
from reports.finished_run import STEP, Run, pick_seeds
from reports.statistics.outcomes import leads
from reports.tables.table import name_scene

STEPS = 2**16 - 1
FINEST = 1e-4  # [m] of a step: nothing finer is seen, and noise does not deflate
LEVELS = 255  # of values of vertices


@dataclass
class Pack:
    """Arrays one behind the other; entries: by name, where each lies and how it is read."""

    entries: dict[str, dict[str, Any]] = field(default_factory=dict)
    parts: list[bytes] = field(default_factory=list)

    def _add(self, name: str, array: np.ndarray, **fields: Any) -> None:
        start = sum(map(len, self.parts))
        self.parts.append(array.tobytes())
        self.entries[name] = {"at": start, "shape": list(array.shape), **fields}

    def positions(self, name: str, positions: np.ndarray) -> None:
        """Add finite positions (T,V,3) [m]: low bytes, then high ones, of differences from linear motion."""
        low = positions.reshape(-1, 3).min(axis=0)
        step = max(float((positions - low).max()) / STEPS, FINEST)
        steps = np.rint((positions - low) / step).astype(np.uint16)
        surprise = residuals(steps)
        planes = np.stack([surprise & 255, surprise >> 8]).astype(np.uint8)
        self._add(name, planes, kind="positions", low=[float(x) for x in low], step=step)
        self.entries[name]["shape"] = list(positions.shape)

    def values(self, name: str, values: np.ndarray) -> None:
        """Add numbers of vertices (T,V), none negative, each byte less that of the frame before.

        A number that is not finite is 0; frames without a finite number are named, and not coloured.
        """
        unknown = np.flatnonzero(~np.isfinite(values).any(axis=1))
        values = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
        full = max(float(values.max(initial=0.0)), 1e-12)
        levels = np.rint(LEVELS * np.sqrt(values / full)).astype(np.uint8)
        changes = np.diff(levels, axis=0, prepend=np.zeros_like(levels[:1]))
        self._add(name, changes, kind="values", full=full, unknown=unknown.tolist())

    def numbers(self, name: str, numbers: np.ndarray) -> None:
        """Add one number per frame (T,), to single precision."""
        self._add(name, numbers.astype("<f4"), kind="numbers")

    def indices(self, name: str, indices: np.ndarray) -> None:
        """Add corners of triangles (F,3)."""
        self._add(name, indices.astype("<u4"), kind="indices")

    def text(self) -> str:
        """Return all arrays, in letters that mean nothing to a browser."""
        return deflate(b"".join(self.parts))


def residuals(steps: np.ndarray) -> np.ndarray:
    """Return differences of (T,...) uint16 from linear motion through the two frames before.

    Small differences of either sign are small numbers: 0, -1, 1, -2, ... as 0, 1, 2, 3, ...
    """
    moved = np.diff(steps, axis=0, prepend=np.zeros_like(steps[:1]))
    delta = moved.copy()
    delta[2:] = moved[2:] - moved[1:-1]
    signed = delta.view(np.int16)
    return ((signed << 1) ^ (signed >> 15)).view(np.uint16)


def deflate(data: bytes) -> str:
    """Return data in zlib's format, in base64."""
    return base64.b64encode(zlib.compress(data, 6)).decode("ascii")


BUDGET = 25_000_000  # bytes of the whole page
RULE = "first the methods of page one, of these whole motions, clips, then scenes without a body"


def groups(folder: RunFolder, run: Run) -> Iterator[tuple[str, dict[str, int]]]:
    """Yield scene and method -> seed of all roll-outs on disk, the most wanted first.

    Those of a scene come in one or two groups.
    """
    cells = run.cells()
    seeds = pick_seeds(cells)
    first = leads(run, cells)
    traits = cells.drop_duplicates("scene").set_index("scene")[["garment", "part"]]
    kinds: list[list[str]] = [[], [], []]
    for scene, garment, part in traits.itertuples():
        kinds[1 if part == "clip" else 0 if garment else 2].append(str(scene))
    for leading in (True, False):
        for scene in (scene for scenes in kinds for scene in scenes):
            firsts = {m: int(seeds[scene, m]) for m in run.order(seeds[scene].index)}
            stored = {
                m: s for m, s in firsts.items()
                if (m in first) is leading and folder.trajectory_path(scene, m, s).is_file()
            }  # fmt: skip
            if stored:
                yield scene, stored


SKIN_FACES = 5000  # of the body as it is drawn; depths are those below the whole one
ROOM = 1500  # bytes beside a text: its tags, and what the content says of it


@dataclass
class Embedded:
    """Roll-outs as texts of the page.

    scenes: scene -> its body and methods, each the id of a text and what lies in it. texts: id -> text.
    missing: how many roll-outs did not fit.
    """

    scenes: dict[str, dict[str, Any]] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    missing: int = 0

    @property
    def remark(self) -> str:
        """How many roll-outs the page has, and by what rule."""
        have = sum(len(scene["methods"]) for scene in self.scenes.values())
        if self.missing:
            return f"{have} of {have + self.missing} roll-outs can be shown, for a page of 25 MB: {RULE}."
        return f"All {have} roll-outs that this run kept can be shown: the first seed of each method."


def embed(folder: RunFolder, run: Run, budget: int) -> Embedded:
    """Embed roll-outs in the order of groups() until the next would exceed the budget [bytes]."""
    embedded = Embedded()
    references: dict[str, Trajectory | None] = {}
    for scene, seeds in groups(folder, run):
        if embedded.missing:
            embedded.missing += len(seeds)
            continue
        stored = {method: run.roll_outs.cloth(scene, method, seed) for method, seed in seeds.items()}
        finite_cloths = {method: cloth.finite() for method, cloth in stored.items() if cloth is not None}
        cloths = {method: cloth for method, cloth in finite_cloths.items() if cloth.frames}
        references.setdefault(scene, cloths.get(run.reference))
        body = run.roll_outs.body(scene)
        skin = skin_of(body.positions, body.faces) if body else None
        depths = _depths(cloths, skin) if skin else {}
        for method, cloth in cloths.items():
            texts: dict[str, str] = {}
            record = embedded.scenes.get(scene) or {
                "title": name_scene(scene), "methods": {},
                "body": _keep(texts, _body(body)) if body else None,
            }  # fmt: skip
            pack = _cloth(cloth, references[scene], depths.get(method), run.metrics)
            fine = cloth.status in ("ok", "converged")
            ending = "" if fine else f"{cloth.status}: {cloth.reason}"
            entry = _keep(texts, pack) | {"ending": ending}
            additions = {name: text for name, text in texts.items() if name not in embedded.texts}
            budget -= sum(ROOM + len(text) for text in additions.values())
            if budget < 0:
                embedded.missing += 1
            else:
                embedded.texts |= additions
                embedded.scenes[scene] = {**record, "methods": {**record["methods"], method: entry}}
    return embedded


def _keep(texts: dict[str, str], pack: Pack) -> dict[str, Any]:
    """Keep a pack under a name of its content, so that one body of two garments is kept once."""
    text = pack.text()
    name = "b" + hashlib.sha256(text.encode()).hexdigest()[:16]
    texts[name] = text
    return {"text": name, "arrays": pack.entries}


def _cloth(
    cloth: Trajectory, reference: Trajectory | None, depths: np.ndarray | None, curves: Container[str]
) -> Pack:
    """Pack positions, times, colours, and those numbers per frame that `curves` holds, of a roll-out."""
    pack, faces = Pack(), cloth.faces
    pack.indices("faces", faces)
    pack.numbers("times", cloth.times)
    pack.positions("positions", cloth.positions)
    curvature = curvature_series(cloth.positions, faces)
    pack.values("curvature", np.where(curvature.area > 0.0, curvature.curvature, 0.0))  # 0 on boundaries
    if reference is not None and _can_compare(cloth, reference):
        offsets = cloth.positions - reference.positions[: cloth.frames]
        pack.values("distance", MM * np.linalg.norm(offsets, axis=-1))
    if depths is not None:
        pack.values("depth", depths)
    if STEP in cloth.frame_fields:
        pack.values("step", cloth.frame_fields[STEP])
    for name, curve in cloth.frame_fields.items():
        if name in curves:
            pack.numbers(name, curve)
    return pack


def _can_compare(cloth: Trajectory, reference: Trajectory) -> bool:
    same = np.array_equal(cloth.faces, reference.faces) and cloth.frames <= reference.frames
    return same and np.allclose(cloth.times, reference.times[: cloth.frames])


def _depths(cloths: Mapping[str, Trajectory], skin: Obstacle) -> dict[str, np.ndarray]:
    """Return method -> penetration (T,V) [mm]; a frame's search tree is built once."""
    depths = {method: np.zeros(cloth.positions.shape[:2]) for method, cloth in cloths.items()}
    for frame in range(skin.frames):
        methods = [method for method, cloth in cloths.items() if frame < cloth.frames]
        if methods:
            points = [cloths[method].positions[frame] for method in methods]
            deep = depth(np.concatenate(points), skin, frame)
            for method, values in zip(methods, np.split(deep, np.cumsum([len(x) for x in points])[:-1])):
                depths[method][frame] = values
    return depths


def _body(body: Trajectory) -> Pack:
    """Pack the body with few faces, the same vertices in every frame; whole where its faces do not close."""
    import igl

    births, faces = np.arange(body.positions.shape[1]), body.faces.astype(np.int64)
    if len(faces) > SKIN_FACES:
        first = np.ascontiguousarray(body.positions[0], dtype=float)
        _, fewer, _, birth = igl.decimate(first, np.ascontiguousarray(faces), SKIN_FACES)
        births, faces = (birth, fewer) if len(fewer) else (births, faces)
    pack = Pack()
    pack.indices("faces", faces)
    pack.numbers("times", body.times)
    pack.positions("positions", body.positions[:, births])
    return pack


MM = 1e3


def depth(points: np.ndarray, skin: Obstacle, frame: int) -> np.ndarray:
    """Return the penetration (P,) [mm] of points (P,3) [m] into the body at that frame, 0 outside.

    Inside is the side behind the normal of the nearest point: a winding number takes six times as long.
    """
    planes = skin.planes(np.ascontiguousarray(points, dtype=float), frame)
    return MM * np.maximum(-np.einsum("pi,pi->p", planes.normals, points - planes.points), 0.0)


def skin_of(positions: np.ndarray, faces: np.ndarray) -> Obstacle | None:
    """Return a body (T,B,3) [m], or (B,3), as an obstacle; None where its faces (F,3) do not close."""
    try:
        return Obstacle(positions, faces)
    except ValueError:
        return None
