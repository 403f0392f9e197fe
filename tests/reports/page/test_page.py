"""The page of a run: one file that fetches nothing, true to the positions, safe with any name."""

from __future__ import annotations

import base64
import html
import itertools
import json
import re
import shutil
import subprocess
import zlib
from hashlib import sha256
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from benchmarks.results.run_folder import RunFolder
from reports.blocks import Report
from reports.finished_run import read_run
from reports.page.embedded_roll_outs import groups
from reports.page.write_page import write_page
from reports.tables import make_tables
from tests.reference_sim.meshes import box
from tests.reports.page.test_packed_arrays import unpacked
from tests.reports.report_folder import row, run_folder, sheet, skipped, write_mesh

NASTY = '</script><script>window.hacked=1</script><img src=x onerror="window.hacked=1">\'" & мантия 裾'
CLIPS, WHOLE = ("tshirt/walk@clip", "skirt/walk@clip"), "tshirt/walk"
METHODS = {"simulation": 0.0, "skinning": 0.02, "snug": 0.01, "pbns": 0.03, "newton-4": 0.001}
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


def rows_of_page():
    rows = []
    for scene in (WHOLE, *CLIPS):
        part = {"part": "clip"} if scene in CLIPS else {}
        for number, method in enumerate(METHODS):
            rows.append(row(scene, method, "cost/frame", 1.0 + number, unit="ms", **part))
            rows.append(row(scene, method, "energy/total", 2.0 + number, **part))
            if method != "simulation":
                rows.append(row(scene, method, "curvature/error", 9.0 / number, unit="1/m", **part))
    failures = ((NASTY, "failed", f"diverged {NASTY}"), ("supervised", "timeout", "over 30 s"))
    for method, status, reason in failures:
        rows.append(row(WHOLE, method, "energy/total", None, status=status, reason=reason))
    return [*rows, skipped(scene="hanging_sheet", suite="speed")]


def moving(height: float, scene: str = WHOLE) -> tuple[np.ndarray, np.ndarray]:
    """A sheet that swings, (T,V,3) and (F,3); in no scene as in another."""
    x, faces = sheet(height)
    turn = np.linspace(0.0, 1.0, len(x))[:, None]
    x[:, :, 2] += (0.05 + 0.001 * len(scene)) * np.sin(8.0 * x[:, :, 0] + 5.0 * turn)
    return x, faces


def make_folder(path: Path) -> RunFolder:
    """A run of three scenes, in whose clips one-step errors are from 0 to 3 mm, unknown in two frames."""
    run = run_folder(path, rows_of_page(), preset="smoke", commit=NASTY)
    corners, sides = box((0, 0, 0), (1, 1, 1))
    for scene in (WHOLE, *CLIPS):
        for method, height in METHODS.items():
            cloth, faces = moving(height, scene)
            energies = {"energy/total": np.linspace(1.0, 2.0, len(cloth))}
            write_mesh(run.trajectory_path(scene, method), cloth, faces, energies)
            if scene in CLIPS:
                steps = np.tile(np.linspace(0.0, 3.0, cloth.shape[1]), (len(cloth), 1))
                steps[:2] = np.nan
                np.savez(run.curves_path(scene, method), **{"step/vertices": steps})
        body = np.tile(0.5 * corners - [0.0, 0.0, 0.5], (len(cloth), 1, 1))
        write_mesh(run.trajectory_path(scene, "body"), body, sides, {})
    return run


def write(run: RunFolder, *, tables: bool = True, **options) -> tuple[str, list[str]]:
    """The page alone, without a PDF; returns it, and what could not be read."""
    data = read_run(run)
    write_page(run, Report(data, make_tables(data) if tables else {}, {}), **options)
    return run.page_path.read_text(encoding="utf-8"), data.problems


def texts_of(page: str) -> dict[str, str]:
    return dict(re.findall(r'<script type="text/plain" id="(\w+)">([^<]*)</script>', page))


def content_of(page: str) -> dict:
    return json.loads(zlib.decompress(base64.b64decode(texts_of(page)["content"])))


def arrays_of(page: str, scene: str, method: str) -> dict[str, np.ndarray]:
    where = content_of(page)["scenes"][scene]["methods"][method]
    return unpacked(where["arrays"], texts_of(page)[where["text"]])


class Markup(HTMLParser):
    """Open elements, attributes and the texts outside scripts; an end without a start is an error."""

    EMPTY = ("meta", "link", "input", "img")

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []
        self.text = ""
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.attributes += [(tag, name, value or "") for name, value in attributes]
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag, tag

    def handle_data(self, data):
        if "script" not in self.open and "style" not in self.open:
            self.text += data


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> RunFolder:
    return make_folder(tmp_path_factory.mktemp("page"))


@pytest.fixture(scope="module")
def page(folder) -> str:
    return write(folder)[0]


def test_the_page_holds_the_roll_outs_of_the_run(page):
    arrays = arrays_of(page, WHOLE, "snug")
    cloth, faces = moving(METHODS["snug"])
    assert np.array_equal(arrays["faces"], faces)
    assert np.abs(arrays["positions"] - cloth).max() <= 5e-5
    np.testing.assert_allclose(arrays["times"], np.arange(len(cloth)) / 30.0, rtol=1e-6)
    np.testing.assert_allclose(arrays["energy/total"], np.linspace(1.0, 2.0, len(cloth)), rtol=1e-6)
    np.testing.assert_allclose(arrays["distance"], 10.0, rtol=1e-2)
    assert {"curvature", "depth"} <= arrays.keys() and "step" not in arrays
    clip = content_of(page)["scenes"][CLIPS[0]]["methods"]["snug"]["arrays"]
    assert clip["step"]["unknown"] == [0, 1]  # frames that nobody judged


def test_whole_motions_of_the_methods_of_page_one_come_before_all_others(folder):
    order = [(scene, list(seeds)) for scene, seeds in groups(folder, read_run(folder))]
    leading = ["simulation", "skinning", "snug", "pbns"]
    assert order == [(s, names) for names in (leading, ["newton-4"]) for s in (WHOLE, *CLIPS)]


def test_tables_stand_under_the_headings_of_the_report(page):
    tables = content_of(page)["tables"]
    groups_of_tables = [group for group, _ in itertools.groupby(table["group"] for table in tables)]
    assert groups_of_tables[:3] == ["Answer", "The paper's tables", "Findings"]
    assert len(groups_of_tables) == 4
    assert [table["title"] for table in tables][:2] == ["Overview", "Energies"]


def test_what_does_not_fit_is_left_out_and_said(tmp_path):
    run = make_folder(tmp_path)
    page, _ = write(run, tables=False, budget=1)
    assert content_of(page)["scenes"] == {} and "0 of 15 roll-outs can be shown" in page
    size = run.page_path.stat().st_size + 12_000
    page, _ = write(run, tables=False, budget=size)
    scenes = content_of(page)["scenes"]
    assert run.page_path.stat().st_size <= size
    count = sum(len(scene["methods"]) for scene in scenes.values())
    assert 0 < count < 15 and f"{count} of 15 roll-outs" in page
    assert next(iter(scenes)) == WHOLE


def test_the_page_is_well_formed_and_asks_for_nothing(page):
    markup = Markup(page)
    assert markup.open == []
    linked = [value for _, name, value in markup.attributes if name in ("src", "href", "action", "data")]
    assert linked == ["data:,", "report.pdf", "results.csv", "tables/"]
    assert not re.search(r"\b(fetch|XMLHttpRequest|WebSocket|importScripts|import)\b\s*\(", page)
    bare = re.sub(r">[\w+/=]{99,}<", "><", page)
    assert {*re.findall(r"(?:https?:)?//[\w.]+\.\w+[^'\" ]*", bare)} == {"http://www.w3.org/2000/svg"}


def test_a_browser_may_run_the_own_script_alone(page):
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)
    assert policy and policy[1].startswith("default-src 'none'; ")
    for tag in ("script", "style"):
        (text,) = re.findall(rf"<{tag}>(.*?)</{tag}>", page, re.S)
        digest = base64.b64encode(sha256(text.encode()).digest()).decode()
        assert f"{tag}-src 'sha256-{digest}';" in policy[1]


def test_names_with_markup_stay_text(page):
    markup = Markup(page)
    assert NASTY not in page and html.escape(NASTY) in page and NASTY in markup.text
    assert not any(tag == "img" or name.startswith("on") for tag, name, _ in markup.attributes)
    assert content_of(page)["methods"][NASTY]["label"] == NASTY


def test_a_roll_out_that_broke_is_shown_up_to_there_and_a_broken_file_is_named(tmp_path):
    run = make_folder(tmp_path)
    cloth, faces = moving(0.0)
    cloth[3:] = np.nan
    write_mesh(run.trajectory_path(WHOLE, "snug"), cloth, faces, {})
    run.trajectory_path(WHOLE, "pbns").write_bytes(b"no mesh")
    page, (problem,) = write(run, tables=False)
    assert "pbns.vtkhdf" in problem and "files could not be read: standard error names them" in page
    assert len(arrays_of(page, WHOLE, "snug")["positions"]) == 3
    assert "pbns" not in content_of(page)["scenes"][WHOLE]["methods"]
    assert write(run, tables=False)[0] == page


def in_browser(page: str, script: str, folder: Path) -> dict:
    """Open the page from disk in a headless browser and return the result of the script."""
    digest = base64.b64encode(sha256(script.encode()).digest()).decode()
    page = page.replace("script-src '", f"script-src 'sha256-{digest}' '", 1)
    copy = folder / "page.html"
    copy.write_text(page.replace("<body>", f"<body><script>{script}</script>", 1), encoding="utf-8")
    command = [
        str(CHROMIUM), "--headless", "--no-sandbox",
        "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
        "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
        "--disable-sync", f"--user-data-dir={folder / 'profile'}", "--virtual-time-budget=400000",
        "--window-size=1400,1000", "--dump-dom", copy.as_uri(),
    ]  # fmt: skip
    process = subprocess.run(command, capture_output=True, text=True, timeout=170)
    (text,) = re.findall(r'<pre id="found">(.*?)</pre>', process.stdout, re.S)
    return json.loads(html.unescape(text))


@pytest.mark.slow
@pytest.mark.skipif(not CHROMIUM, reason="no chromium on this machine")
def test_a_person_can_use_it(page, tmp_path):
    actions = Path(__file__).with_name("page_actions.js").read_text(encoding="utf-8")
    state = in_browser(page, actions, tmp_path)
    assert state["wrong"] == [] and not state["hacked"]
    assert state["opens"] == ["Pause", "distance", ""]
    assert state["panes"] == ["Simulation", "Skinning alone", "SNUG", "PBNS"]
    assert state["shades"] > 8
    assert (state["first"], state["right"], state["home"]) == (2, 3, 0)
    assert (state["playing"], state["paused"]) == ("Pause", "Play") and state["played"]
    assert state["clock"] == "0.07 s · 3 of 5"
    assert state["added"] == "newton-4" and state["withAdded"][-1] == "Newton, 4 iterations"
    assert state["pointed"] == state["focused"] == "pbns"
    assert "pbns" in state["withPointed"] and len(state["withPointed"]) == 4
    assert state["turned"] and state["scale"] == "Mean curvature [1/m]"
    assert state["colours"] == ["plain", "curvature", "step", "distance", "depth"]
    assert state["unjudged"] == ["step not judged"] * 4 and state["judged"] == [""] * 4
    directions, columns = zip(state["up"], state["down"])
    assert directions == ("ascending", "descending")
    numbers = [[float(text.strip("×#")) for text in column] for column in columns]
    assert numbers[0] == numbers[1][::-1] == sorted(numbers[0]) and len(set(numbers[0])) == 4
    assert state["definition"].startswith("Inference: inference time: run time divided by")
    lines = {kind: text.split("\n") for kind, text in state["copied"].items()}
    count = 4 + 1  # without the solver
    assert lines["csv"][0].startswith("Method,Excess in own energies [%],") and len(lines["csv"]) == count
    assert lines["markdown"][1].startswith("| --- | --- |") and len(lines["markdown"]) == count + 1
    assert all(
        re.fullmatch(r"[\d.e-]+|–", cell) for line in lines["csv"][1:] for cell in line.split(",")[1:]
    )
    assert state["picture"] == ["tshirt-walk@clip-4.png", "data:image/png;base64,", True]
    assert state["address"].startswith(f"#scene={CLIPS[0]}&methods=simulation,")
    assert "colour=curvature" in state["address"]
    assert state["scene"] == CLIPS[1] and len(state["panesThere"]) == 4 and state["curves"] == 4
