"""The page of a run in a headless browser, as a person uses it."""

from __future__ import annotations

import base64
import html
import json
import re
import shutil
import subprocess
from hashlib import sha256
from pathlib import Path

import pytest

from tests.reports.page.page_by_hand import CLIPS, METHODS, WHOLE

ACTIONS = Path(__file__).with_name("page_actions.js")


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
    not (shutil.which("chromium") or shutil.which("chromium-browser")),
    reason="no chromium on this machine",
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
    assert (
        state["pointed"] == "pbns" and "pbns" in state["withPointed"] and len(state["withPointed"]) == 4
    )
    assert state["focused"] == "pbns"
    assert state["turned"] and state["scale"] == "Mean curvature [1/m]"
    assert state["colours"] == ["plain", "curvature", "step", "distance", "depth"]
    assert state["unjudged"] == ["step not judged"] * 4 and state["judged"] == [""] * 4
    directions, columns = zip(state["up"], state["down"])
    assert directions == ("ascending", "descending")
    numbers = [[float(text.strip("×#")) for text in column] for column in columns]
    assert numbers[0] == numbers[1][::-1] == sorted(numbers[0]) and len(set(numbers[0])) == len(METHODS)
    assert state["definition"].startswith("Inference: inference time: run time divided by")
    lines = {kind: text.split("\n") for kind, text in state["copied"].items()}
    count = len(METHODS) + 1
    assert lines["csv"][0].startswith("Method,Excess in own energies [%],") and len(lines["csv"]) == count
    assert lines["markdown"][1].startswith("| --- | --- |") and len(lines["markdown"]) == count + 1
    assert lines["latex"][0] == "\\begin{tabular}{lrrrrr}" and len(lines["latex"]) == count + 5
    assert lines["latex"][2].startswith("Method & Excess in own energies [\\%] & ")
    assert state["picture"] == ["tshirt-walk@clip-4.png", "data:image/png;base64,", True]
    assert state["address"].startswith(f"#scene={CLIPS[0]}&methods=simulation,")
    assert "colour=curvature" in state["address"]
    assert state["scene"] == WHOLE and len(state["panesThere"]) == 4 and state["curves"] == 4
