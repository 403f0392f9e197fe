"""A small run of three scenes, and its page."""

from __future__ import annotations

import base64
import json
import re
import zlib
from pathlib import Path

import numpy as np

from benchmarks.results.run_folder import RunFolder
from reports.blocks import Report
from reports.finished_run import read_run
from reports.page.write_page import write_page
from reports.tables import make_tables
from tests.reports.report_folder import row, run_folder, sheet, skipped, write_mesh

NASTY = '</script><script>window.hacked=1</script><img src=x onerror="window.hacked=1">\'" & мантия 裾'
CLIPS, WHOLE = ("tshirt/walk@clip", "skirt/walk@clip"), "tshirt/walk"
METHODS = {"simulation": 0.0, "skinning": 0.02, "snug": 0.01, "pbns": 0.03, "newton-4": 0.001}


def rows_of_page():
    rows = []
    for scene in (WHOLE, *CLIPS):
        part = {"part": "clip"} if scene in CLIPS else {}
        for number, method in enumerate(METHODS):
            rows.append(row(scene, method, "cost/frame", 1.0 + number, unit="ms", **part))
            rows.append(row(scene, method, "energy/total", 2.0 + number, **part))
            if method != "simulation":
                rows.append(row(scene, method, "curvature/error", 9.0 / number, unit="1/m", **part))
    failed = {"value": None, "status": "failed", "reason": f"diverged {NASTY}"}
    rows.append(row(WHOLE, NASTY, "energy/total", **failed))
    rows.append(
        row(WHOLE, "supervised", "energy/total", value=None, status="timeout", reason="over 30 s")
    )
    return [*rows, skipped(scene="hanging_sheet", suite="speed")]


def block() -> tuple[np.ndarray, np.ndarray]:
    """Corners (8,3) and faces (12,3) of the unit cube."""
    corners = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    squares = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([half for a, b, c, d in squares for half in ((a, b, c), (a, c, d))])


def moving(height: float, scene: str = WHOLE) -> tuple[np.ndarray, np.ndarray]:
    """A sheet that swings, (T,V,3) and (F,3); in no scene as in another."""
    x, faces = sheet(height)
    turn = np.linspace(0.0, 1.0, len(x))[:, None]
    x[:, :, 2] += (0.05 + 0.001 * len(scene)) * np.sin(8.0 * x[:, :, 0] + 5.0 * turn)
    return x, faces


def steps(cloth: np.ndarray) -> np.ndarray:
    """One-step errors (T,V) [mm], from 0 to 3 over the vertices; of the first two frames none are known."""
    known = np.repeat(np.linspace(0.0, 3.0, cloth.shape[1])[None], len(cloth), axis=0)
    known[:2] = np.nan
    return known


def make_folder(path: Path) -> RunFolder:
    run = run_folder(path, rows_of_page(), preset="smoke", commit=NASTY)
    for scene in (WHOLE, *CLIPS):
        corners, faces = block()
        body = np.repeat((0.5 * corners - [0.0, 0.0, 0.5])[None], len(sheet(0.0)[0]), axis=0)
        write_mesh(run.trajectory_path(scene, "body"), body, faces, {})
        for method, height in METHODS.items():
            cloth, faces = moving(height, scene)
            energies = {"energy/total": np.linspace(1.0, 2.0, len(cloth))}
            write_mesh(run.trajectory_path(scene, method), cloth, faces, energies)
            if scene in CLIPS:
                np.savez(run.curves_path(scene, method), **{"step/vertices": steps(cloth)})
    return run


def write(run: RunFolder, *, tables: bool = True, **options) -> list[str]:
    """The page alone, without a PDF; returns what could not be read."""
    data = read_run(run)
    write_page(run, Report(data, make_tables(data) if tables else {}, {}), **options)
    return data.problems


def texts_of(page: str) -> dict[str, str]:
    return dict(re.findall(r'<script type="text/plain" id="(\w+)">([^<]*)</script>', page))


def content_of(run: RunFolder) -> dict:
    text = texts_of(run.page_path.read_text(encoding="utf-8"))["content"]
    return json.loads(zlib.decompress(base64.b64decode(text)))


def arrays_of(run: RunFolder, scene: str, method: str) -> dict[str, np.ndarray]:
    where = content_of(run)["scenes"][scene]["methods"][method]
    return unpacked(where["arrays"], texts_of(run.page_path.read_text(encoding="utf-8"))[where["text"]])


def unpacked(entries: dict, text: str) -> dict[str, np.ndarray]:
    """The arrays of a pack, frame by frame as data.js has them."""
    data, arrays = zlib.decompress(base64.b64decode(text)), {}
    for name, entry in entries.items():
        shape = tuple(entry["shape"])
        size = int(np.prod(shape))
        if entry["kind"] == "positions":
            low, high = (
                np.frombuffer(data, np.uint8, 2 * size, entry["at"]).reshape(2, *shape).astype(int)
            )
            left = low + 256 * high
            left = np.where(left % 2, -(left + 1) // 2, left // 2)
            steps = np.zeros((shape[0] + 2, *shape[1:]), dtype=int)
            for k in range(shape[0]):
                moved = steps[k + 1] - steps[k] if k > 1 else 0
                steps[k + 2] = (steps[k + 1] + moved + left[k]) % 65536
            arrays[name] = np.array(entry["low"]) + entry["step"] * steps[2:]
        elif entry["kind"] == "values":
            levels = np.frombuffer(data, np.uint8, size, entry["at"]).reshape(shape).cumsum(0) % 256
            arrays[name] = entry["full"] * (levels / 255.0) ** 2
        else:
            kind = "<f4" if entry["kind"] == "numbers" else "<u4"
            arrays[name] = np.frombuffer(data, kind, size, entry["at"]).reshape(shape)
    return arrays
