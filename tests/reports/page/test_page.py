"""The page of a run: one file that fetches nothing, true to the positions, safe with any name."""

from __future__ import annotations

import base64
import html
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
from reports.blocks.block import Report
from reports.page.page_data import table_data
from reports.page.roll_out_choice import groups
from reports.page.write_page import write_page
from reports.run.reading import read_run
from reports.statistics.effects import EXCESS, RATIO, Effect
from reports.tables import make_tables
from reports.tables.table import Column, Table
from tests.reports.report_folder import row, run_folder, run_of, sheet, skipped, write_mesh

NASTY = '</script><script>window.hacked=1</script><img src=x onerror="window.hacked=1">\'" & мантия 裾'
CLIPS, WHOLE = ("tshirt/walk@clip", "skirt/walk@clip"), "tshirt/walk"
METHODS = {"simulation": 0.0, "skinning": 0.02, "snug": 0.01, "pbns": 0.03, "newton-4": 0.001}
ACTIONS = Path(__file__).with_name("page_actions.js")


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
    rows.append(row(WHOLE, "supervised", "energy/total", value=None, status="timeout", reason="over 30 s"))
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
        np.save(run.rest_areas_path(scene), np.full(len(faces), 0.4 / 3 * 0.5 / 3 / 2))
    return run


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> RunFolder:
    run = make_folder(tmp_path_factory.mktemp("page"))
    write(run)
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
            low, high = np.frombuffer(data, np.uint8, 2 * size, entry["at"]).reshape(2, *shape).astype(int)
            left = low + 256 * high
            left = np.where(left % 2, -(left + 1) // 2, left // 2)
            steps = np.zeros((shape[0] + 2, *shape[1:]), dtype=int)
            for k in range(shape[0]):
                moved = steps[k + 1] - steps[k] if k > 1 else 0
                steps[k + 2] = (steps[k + 1] + moved + left[k]) % 65536
            arrays[name] = np.array(entry["low"]) + entry["step"] * steps[2:]
        elif entry["kind"] == "values":
            levels = np.frombuffer(data, np.uint8, size, entry["at"]).reshape(shape).cumsum(0) % 256
            part = (levels - 128.0) / 127.0 if entry["signed"] else levels / 255.0
            arrays[name] = entry["full"] * part * np.abs(part)
        else:
            kind = "<f4" if entry["kind"] == "numbers" else "<u4"
            arrays[name] = np.frombuffer(data, kind, size, entry["at"]).reshape(shape)
    return arrays


def test_the_page_holds_the_roll_outs_of_the_run(folder):
    arrays = arrays_of(folder, WHOLE, "snug")
    cloth, faces = moving(METHODS["snug"])
    assert np.array_equal(arrays["faces"], faces)
    assert np.abs(arrays["positions"] - cloth).max() <= 5e-5
    np.testing.assert_allclose(arrays["times"], np.arange(len(cloth)) / 30.0, rtol=1e-6)
    np.testing.assert_allclose(arrays["energy/total"], np.linspace(1.0, 2.0, len(cloth)), rtol=1e-6)
    np.testing.assert_allclose(arrays["distance"], 10.0, rtol=1e-2)
    assert {"curvature", "area", "depth"} <= arrays.keys()


def test_one_step_errors_are_kept_and_frames_that_nobody_judged_are_named(folder):
    scenes = content_of(folder)["scenes"]
    entry = scenes[CLIPS[0]]["methods"]["snug"]["arrays"]["step"]
    assert entry["unknown"] == [0, 1]
    errors = arrays_of(folder, CLIPS[0], "snug")["step"]
    np.testing.assert_allclose(errors[2:], np.nan_to_num(steps(errors))[2:], atol=0.03)
    assert "step" not in scenes[WHOLE]["methods"]["snug"]["arrays"]
    assert scenes[CLIPS[0]]["methods"]["snug"]["arrays"]["curvature"]["unknown"] == []


def test_scenes_of_one_motion_share_the_body(folder):
    assert len({scene["body"]["text"] for scene in content_of(folder)["scenes"].values()}) == 1


def test_clips_come_first_and_leading_methods_before_others(folder):
    order = [(scene, list(seeds)) for scene, seeds in groups(folder, read_run(folder))]
    leading = ["simulation", "skinning", "snug", "pbns"]
    assert order == [
        *((scene, leading) for scene in CLIPS), *((scene, ["newton-4"]) for scene in CLIPS),
        (WHOLE, leading), (WHOLE, ["newton-4"]),
    ]  # fmt: skip


def test_a_roll_out_of_the_user_comes_before_solvers(tmp_path):
    roles = {"newton-4": "solver", "mine": "external"}
    run = run_folder(tmp_path, [row(WHOLE, name, role=role, seeded=False) for name, role in roles.items()])
    for name in roles:
        write_mesh(run.trajectory_path(WHOLE, name), *moving(0.0), {})
    assert [list(seeds) for _, seeds in groups(run, read_run(run))] == [["mine"], ["newton-4"]]


def test_what_does_not_fit_is_left_out_and_said(tmp_path):
    run = make_folder(tmp_path)
    write(run, tables=False, budget=1)
    page = run.page_path.read_text(encoding="utf-8")
    assert content_of(run)["scenes"] == {} and "0 of 15 roll-outs can be shown" in page
    size = run.page_path.stat().st_size + 12_000
    write(run, tables=False, budget=size)
    page = run.page_path.read_text(encoding="utf-8")
    kept = content_of(run)["scenes"]
    assert run.page_path.stat().st_size <= size
    count = sum(len(scene["methods"]) for scene in kept.values())
    assert 0 < count < 15 and f"{count} of 15 roll-outs" in page and f"{WHOLE} (5)" in page
    assert next(iter(kept)) == CLIPS[0]


class Markup(HTMLParser):
    """Open elements, attributes and the texts outside scripts; an end without a start is an error."""

    EMPTY = ("meta", "link", "input", "img")

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []
        self.text = ""

    def handle_starttag(self, tag, attributes):
        self.attributes += [(tag, name, value or "") for name, value in attributes]
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag, tag

    def handle_data(self, data):
        if "script" not in self.open and "style" not in self.open:
            self.text += data


def test_the_page_is_well_formed_and_asks_for_nothing(folder):
    page, markup = folder.page_path.read_text(encoding="utf-8"), Markup()
    markup.feed(page)
    assert markup.open == []
    linked = [value for _, name, value in markup.attributes if name in ("src", "href", "action", "data")]
    assert linked == ["data:,"]
    assert not re.search(r"\b(fetch|XMLHttpRequest|WebSocket|importScripts|import)\b\s*\(", page)
    addresses = set(re.findall(r"(?:https?:)?//[\w.]+\.\w+[^'\" ]*", re.sub(r">[\w+/=]{99,}<", "><", page)))
    assert addresses == {"http://www.w3.org/2000/svg"}


def test_a_browser_may_run_the_own_script_alone(folder):
    page = folder.page_path.read_text(encoding="utf-8")
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)
    assert policy and policy[1].startswith("default-src 'none'; ")
    for tag in ("script", "style"):
        (text,) = re.findall(rf"<{tag}>(.*?)</{tag}>", page, re.S)
        digest = base64.b64encode(sha256(text.encode()).digest()).decode()
        assert f"{tag}-src 'sha256-{digest}';" in policy[1]


def test_names_with_markup_stay_text(folder):
    page, markup = folder.page_path.read_text(encoding="utf-8"), Markup()
    markup.feed(page)
    assert NASTY not in page and html.escape(NASTY) in page and NASTY in markup.text
    assert not any(tag == "img" or name.startswith("on") for tag, name, _ in markup.attributes)
    assert content_of(folder)["methods"][NASTY]["label"] == NASTY


def test_what_did_not_run_stands_at_the_top(folder):
    page = folder.page_path.read_text(encoding="utf-8")
    head = page[: page.index("<main>")]
    assert "Not every number could be had. Of 18 cells 1 failed, 1 timeout, 1 skipped." in head
    assert "over 30 s" in head and "no body here" in head and 'class="trouble wrong"' in head


def test_tables_sort_by_numbers_and_define_their_columns(folder):
    table = next(t for t in content_of(folder)["tables"] if t["name"] == "energies_by_scene")
    total = table["columns"][-1]
    assert total["definition"] == "definition of energy/total; lower is better"
    values = [line[-1] for line in table["rows"] if line[1] == WHOLE]
    assert [value[:2] for value in values] == [[f"{2 + k:.2f}", 2.0 + k] for k in range(len(METHODS))]


def test_effects_sort_by_the_numbers_that_they_show():
    run = run_of([row()])
    effects = [Effect(0.9, EXCESS), Effect(0.5, EXCESS, second=2.0), Effect(0.7, RATIO)]
    column, rows = Column("effect", "Effect", mixed=True), tuple((effect,) for effect in effects)
    cells = [cell for (cell,) in table_data(run, Table("findings", (column,), rows, "Effects."))["rows"]]
    assert [number for _, number, *_ in cells] == pytest.approx([effect.shown for effect in effects])


def test_heads_have_no_unit_where_each_duration_has_its_own():
    columns = (
        Column("run", "Run", text=True),
        Column("train", "Training", "s"),
        Column("rms", "Distance", "mm"),
    )
    data = table_data(run_of([]), Table("t", columns, (("a", 143.4, 5.0),), "t"))
    assert [column["unit"] for column in data["columns"]] == ["", "", "mm"]
    assert data["rows"][0][1][:2] == ["2.39 min", 143.4]


def test_a_roll_out_that_broke_is_shown_up_to_there_and_a_broken_file_is_named(tmp_path):
    run = make_folder(tmp_path)
    cloth, faces = moving(0.0)
    cloth[3:] = np.nan
    write_mesh(run.trajectory_path(WHOLE, "snug"), cloth, faces, {})
    run.trajectory_path(WHOLE, "pbns").write_bytes(b"no mesh")
    run.rest_areas_path(WHOLE).write_bytes(b"no areas")
    (problem,) = write(run, tables=False)
    assert "pbns.vtkhdf" in problem
    arrays = arrays_of(run, WHOLE, "snug")
    assert len(arrays["positions"]) == 3 and "area" not in arrays
    assert "pbns" not in content_of(run)["scenes"][WHOLE]["methods"]
    first = run.page_path.read_bytes()
    assert first.decode().count(problem) == 1
    write(run, tables=False)
    assert run.page_path.read_bytes() == first


def in_browser(path: Path, script: str, folder: Path, address: str = "") -> dict:
    """Open the page from disk in a headless browser and return the result of the script."""
    page = path.read_text(encoding="utf-8")
    digest = base64.b64encode(sha256(script.encode()).digest()).decode()
    page = page.replace("script-src '", f"script-src 'sha256-{digest}' '", 1)
    copy = folder / "page.html"
    copy.write_text(page.replace("<body>", f"<body><script>{script}</script>", 1), encoding="utf-8")
    command = [
        str(shutil.which("chromium") or shutil.which("chromium-browser")), "--headless", "--no-sandbox",
        "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
        "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
        "--disable-sync", f"--user-data-dir={folder / 'profile'}", "--virtual-time-budget=400000",
        "--window-size=1400,1000", "--dump-dom", copy.as_uri() + address,
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=170)
    (text,) = re.findall(r'<pre id="found">(.*?)</pre>', done.stdout, re.S)
    return json.loads(html.unescape(text))


@pytest.mark.slow
@pytest.mark.skipif(
    not (shutil.which("chromium") or shutil.which("chromium-browser")), reason="no chromium on this machine"
)
def test_a_person_can_use_it(folder, tmp_path):
    state = in_browser(folder.page_path, ACTIONS.read_text(encoding="utf-8"), tmp_path)
    assert state["wrong"] == [] and not state["hacked"]
    assert state["opens"] == ["Pause", "distance", ""]
    assert state["panes"] == ["Simulation", "Skinning alone", "SNUG", "PBNS"]
    assert state["shades"] > 8
    assert (state["first"], state["right"], state["home"]) == (2, 3, 0)
    assert (state["playing"], state["paused"]) == ("Pause", "Play") and state["played"]
    assert state["clock"] == "0.07 s · 3 of 5"
    assert state["added"] == "newton-4" and state["withAdded"][-1] == "Newton, 4 iterations"
    assert state["pointed"] == "pbns" and "pbns" in state["withPointed"] and len(state["withPointed"]) == 4
    assert state["focused"] == "pbns"
    assert state["turned"] and state["scale"] == "Mean curvature [1/m]"
    assert state["colours"] == ["plain", "curvature", "area", "step", "distance", "depth"]
    assert state["unjudged"] == ["step not judged"] * 4 and state["judged"] == [""] * 4
    directions, columns = zip(state["up"], state["down"])
    assert directions == ("ascending", "descending")
    numbers = [[float(text.strip("×#")) for text in column] for column in columns]
    assert numbers[0] == numbers[1][::-1] == sorted(numbers[0]) and len(set(numbers[0])) == len(METHODS)
    assert state["definition"] == "Frame: definition of cost/frame."
    lines = {kind: text.split("\n") for kind, text in state["copied"].items()}
    count = len(METHODS) + 1
    assert lines["csv"][0].startswith("Method,Relative excess [%],") and len(lines["csv"]) == count
    assert lines["markdown"][1].startswith("| --- | --- |") and len(lines["markdown"]) == count + 1
    assert lines["latex"][0] == "\\begin{tabular}{lrrr}" and len(lines["latex"]) == count + 5
    assert lines["latex"][2].startswith("Method & Relative excess [\\%] & ")
    assert state["picture"] == ["tshirt-walk@clip-4.png", "data:image/png;base64,", True]
    assert state["groups"] == ["Means", "Each scene or motion"]
    assert (
        state["address"].startswith(f"#scene={CLIPS[0]}&methods=simulation,")
        and "colour=curvature" in state["address"]
    )
    assert state["scene"] == WHOLE and len(state["panesThere"]) == 4 and state["curves"] == 4


OPENED = """addEventListener('DOMContentLoaded', () => setTimeout(() => {
  const text = (id) => document.getElementById(id).value;
  const chosen = [...document.querySelectorAll('#methods input:checked')].map((box) => box.value);
  const note = Object.assign(document.createElement('pre'), { id: 'found' });
  const playing = document.getElementById('play').getAttribute('aria-label') === 'Pause';
  const [scene, frame, colour] = ['scene', 'time', 'colour'].map(text);
  note.textContent = JSON.stringify({ scene, chosen, frame, colour, playing });
  document.body.append(note);
}, 3000));"""


@pytest.mark.slow
@pytest.mark.skipif(
    not (shutil.which("chromium") or shutil.which("chromium-browser")), reason="no chromium on this machine"
)
def test_an_address_opens_what_it_names(folder, tmp_path):
    address = f"#scene={WHOLE}&methods=snug,moon,pbns&colour=area&frame=3"
    state = in_browser(folder.page_path, OPENED, tmp_path, address)
    assert state == {
        "scene": WHOLE, "chosen": ["snug", "pbns"], "frame": "3", "colour": "area", "playing": False,
    }  # fmt: skip
