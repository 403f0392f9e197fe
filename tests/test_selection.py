"""What a request becomes: cells, checks and cases, and motions divided into training and test."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks import plan
from benchmarks.plan import Motions, PlanError, choose_cells, choose_motions
from benchmarks.presets import find_preset
from benchmarks.validation import stress_tests

SMOKE = find_preset("smoke")


def cells(suites, *, full=False, scenes=(), methods=(), seeds=(0,), test=("kick", "punch")):
    return choose_cells(
        suites,
        full=full,
        preset=find_preset("quick"),
        motions=Motions(("walk",), test, {}),
        scenes=scenes,
        methods=methods,
        seeds=seeds,
    )


def test_a_cell_in_two_suites_is_run_once():
    found, _, _ = cells(("garments", "speed"))
    keys = [(cell.scene.name, cell.method, cell.seed) for cell in found]
    assert len(set(keys)) == len(keys)
    # Whole motions and their clips are scenes of their own: a suite that times every solver takes the clips.
    assert {cell.suites for cell in found if cell.scene.name.endswith("@clip")} == {("speed",)}
    assert {cell.suites for cell in found if cell.scene.name == "dressed/kick"} == {("garments",)}


def test_the_reference_comes_first_in_every_scene():
    found, _, _ = cells(("garments", "speed"), full=True)
    first = {}
    for cell in found:
        first.setdefault(cell.scene.name, cell.method)
    assert set(first.values()) == {"simulation"} and len(first) == 8


def test_only_what_has_a_seed_is_repeated_and_the_rest_is_the_same_whatever_the_seeds():
    found, _, _ = cells(("garments",), seeds=(3, 5))
    seeds = {}
    for cell in found:
        seeds.setdefault(cell.method, set()).add(cell.seed)
    assert seeds["snug"] == seeds["untrained"] == {3, 5} and seeds["simulation"] == seeds["skinning"] == {0}


def test_patterns_choose_scenes_methods_checks_and_cases():
    found, checks, cases = cells(("speed", "validation", "extremes"), scenes=["*sheet*", "free_fall"])
    assert {cell.scene.name for cell in found} == {"hanging_sheet", "sheet_on_sphere", "free_fall"}
    assert [check.name for check in checks] == ["free_fall"]
    assert cases == stress_tests.MAPS["map_sheet"]
    _, checks, cases = cells(("validation", "extremes"), methods=["sim*"])
    assert len(checks) >= 10 and len(cases) >= 8


def swinging(suites, **chosen):
    motions = Motions(("walk",), ("kick",), {}, ("walk",), ("twist_stop",))
    options = {"full": False, "preset": find_preset("quick"), "seeds": (0,), "scenes": (), "methods": ()}
    return choose_cells(suites, motions=motions, **(options | chosen))[0]


def test_what_no_suite_lists_is_met_by_its_whole_name():
    both = ("garments", "speed")
    plain = {(cell.scene.name, cell.suites) for cell in swinging(both, scenes=["tunic/*"])}
    assert plain == {("tunic/twist_stop", ("garments",))}
    clip, whole = "tunic/twist_stop@clip", "dressed/twist_stop"
    met = {(cell.scene.name, cell.suites) for cell in swinging(both, scenes=[clip, whole])}
    assert met == {(clip, ("speed",)), (whole, ("garments",))}
    assert not {clip, whole} & {cell.scene.name for cell in swinging(both)}


def test_an_added_scene_or_method_needs_its_line_and_its_name(monkeypatch):
    from benchmarks import meetings, methods, scenes
    from benchmarks.method import MethodEntry
    from benchmarks.scene import Scene

    mine = Scene(name="my_scene", description="", module="my_scene")
    monkeypatch.setattr(scenes, "SMALL_SCENES", (*scenes.SMALL_SCENES, mine))
    entries = (*methods.METHODS, MethodEntry(name="my-method", description="", module="my_method"))
    for module in (methods, meetings, plan):
        monkeypatch.setattr(module, "METHODS", entries)
    found = swinging(("garments", "speed"), scenes=["my_scene"], methods=["simulation", "my-method"])
    assert [(c.scene, c.method, c.suites) for c in found] == [
        (mine, "simulation", ("speed",)),
        (mine, "my-method", ("speed",)),
    ]
    worn = swinging(("garments", "speed"), scenes=["dressed/kick"], methods=["my-method"])
    assert [(c.scene.name, c.suites) for c in worn] == [("dressed/kick", ("garments",))]
    for choice in ({}, {"scenes": ["*"]}, {"methods": ["*"]}):
        assert not {"my_scene", "my-method"} & {
            name for c in swinging(("speed",), **choice) for name in (c.scene.name, c.method)
        }


def test_motions_are_divided_as_help_says(tmp_path):
    from snug.motion_library import TEST, TRAIN

    quick = find_preset("quick")
    library = choose_motions([], [], quick)
    assert (library.train, library.test, library.files) == (TRAIN, TEST, {})
    moved = choose_motions([], ["walk"], quick)
    assert moved.test == ("walk",) and "walk" not in moved.train and set(TEST) <= set(moved.train)
    small = choose_motions([], [], SMOKE)
    assert (len(small.train), len(small.test)) == (SMOKE.train_motions, SMOKE.test_motions)

    clips = clips_folder(tmp_path, "b", "a", "c")
    files = choose_motions([clips], [], quick)
    assert (files.train, files.test, sorted(files.files)) == (("b", "c"), ("a",), ["a", "b", "c"])
    named = choose_motions([], ["kick", "punch", "walk"], SMOKE)  # all those named, whatever the preset
    assert set(named.test) == {"kick", "punch", "walk"} and len(named.train) == SMOKE.train_motions
    chosen = choose_motions([clips], ["c", "b"], quick)
    assert (chosen.train, chosen.test) == (("a",), ("b", "c"))
    both = choose_motions(["library", clips], [], quick)
    assert both.train == ("a", "b", "c", *TRAIN) and both.test == TEST
    single = choose_motions([str(Path(clips) / "a.npz")], [], quick)
    assert (single.train, single.test) == (TRAIN, ("a",))
    with pytest.raises(PlanError, match="taken"):
        choose_motions([clips, clips], [], quick)


def clips_folder(folder: Path, *names: str) -> str:
    for name in names:
        poses = np.zeros((12, 52 * 3))
        np.savez(folder / f"{name}.npz", poses=poses, trans=np.zeros((12, 3)), mocap_framerate=30.0)
    return str(folder)
