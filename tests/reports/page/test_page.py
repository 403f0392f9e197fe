"""The page of a run: one file that fetches nothing, true to the positions, safe with any name."""

from __future__ import annotations

import base64
import html
import re
from hashlib import sha256
from html.parser import HTMLParser

import numpy as np

from reports.finished_run import read_run
from reports.page.embedded_roll_outs import groups
from tests.reports.page.page_by_hand import (
    CLIPS,
    METHODS,
    NASTY,
    WHOLE,
    arrays_of,
    content_of,
    make_folder,
    moving,
    write,
)
from tests.reports.report_folder import write_mesh


def test_the_page_holds_the_roll_outs_of_the_run(folder):
    arrays = arrays_of(folder, WHOLE, "snug")
    cloth, faces = moving(METHODS["snug"])
    assert np.array_equal(arrays["faces"], faces)
    assert np.abs(arrays["positions"] - cloth).max() <= 5e-5
    np.testing.assert_allclose(arrays["times"], np.arange(len(cloth)) / 30.0, rtol=1e-6)
    np.testing.assert_allclose(arrays["energy/total"], np.linspace(1.0, 2.0, len(cloth)), rtol=1e-6)
    np.testing.assert_allclose(arrays["distance"], 10.0, rtol=1e-2)
    assert {"curvature", "depth"} <= arrays.keys()


def test_frames_that_nobody_judged_are_named(folder):
    scenes = content_of(folder)["scenes"]
    assert scenes[CLIPS[0]]["methods"]["snug"]["arrays"]["step"]["unknown"] == [0, 1]
    assert "step" not in scenes[WHOLE]["methods"]["snug"]["arrays"]


def test_clips_come_first_and_leading_methods_before_others(folder):
    order = [(scene, list(seeds)) for scene, seeds in groups(folder, read_run(folder))]
    leading = ["simulation", "skinning", "snug", "pbns"]
    assert order == [
        *((scene, leading) for scene in CLIPS), *((scene, ["newton-4"]) for scene in CLIPS),
        (WHOLE, leading), (WHOLE, ["newton-4"]),
    ]  # fmt: skip


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
    assert 0 < count < 15 and f"{count} of 15 roll-outs" in page
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
    addresses = set(
        re.findall(r"(?:https?:)?//[\w.]+\.\w+[^'\" ]*", re.sub(r">[\w+/=]{99,}<", "><", page))
    )
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


def test_a_roll_out_that_broke_is_shown_up_to_there_and_a_broken_file_is_named(tmp_path):
    run = make_folder(tmp_path)
    cloth, faces = moving(0.0)
    cloth[3:] = np.nan
    write_mesh(run.trajectory_path(WHOLE, "snug"), cloth, faces, {})
    run.trajectory_path(WHOLE, "pbns").write_bytes(b"no mesh")
    (problem,) = write(run, tables=False)
    assert "pbns.vtkhdf" in problem
    arrays = arrays_of(run, WHOLE, "snug")
    assert len(arrays["positions"]) == 3
    assert "pbns" not in content_of(run)["scenes"][WHOLE]["methods"]
    first = run.page_path.read_bytes()
    write(run, tables=False)
    assert run.page_path.read_bytes() == first
