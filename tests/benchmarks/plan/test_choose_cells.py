"""A request is resolved into cells and cases, with motions divided into training and test."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.metrics import names_of
from benchmarks.plan import choose_cells as choosing
from benchmarks.plan.choose_cells import Selection, choose_cells
from benchmarks.plan.motion_split import split_motions
from benchmarks.plan.plan import Motions, PlanError
from benchmarks.presets import find_preset
from tests.benchmarks.plan.planned import planned

SMOKE = find_preset("smoke")


def chosen(suites, *, full=False, scenes=(), methods=(), seeds=(0,), test=("kick", "punch")):
    cells, cases = choose_cells(
        Selection(
            suites=tuple(suites), full=full, preset=find_preset("quick"), scenes=tuple(scenes),
            motions=Motions(("walk",), test, {}), methods=tuple(methods), seeds=seeds,
        )
    )  # fmt: skip
    return cells, cases


def test_a_cell_in_two_suites_is_run_once():
    cells, _ = chosen(("garments", "speed"))
    keys = [(cell.scene.name, cell.method, cell.seed) for cell in cells]
    assert len(set(keys)) == len(keys)
    # Whole motions and their clips are scenes of their own: a suite that times every solver takes the clips.
    assert {cell.suites for cell in cells if cell.scene.part == "clip"} == {("speed",)}
    assert {cell.suites for cell in cells if cell.scene.name == "tshirt/kick"} == {("garments",)}


def test_of_whole_motions_the_first_alone_is_timed_and_all_else_is_measured_in_all():
    cells, _ = chosen(("garments", "speed"))
    scenes = {cell.scene.name: cell.scene for cell in cells}
    assert scenes["tshirt/kick"].timed and not scenes["tshirt/punch"].timed
    assert scenes["tshirt/kick@clip"].timed and scenes["hanging_sheet"].timed
    assert set(names_of(None)) - set(names_of(scenes["tshirt/punch"].metrics)) == {"cost"}
    assert scenes["tshirt/punch"].dynamic
    cells, _ = chosen(("garments",), scenes=("tshirt/punch",))
    assert all(cell.scene.timed for cell in cells)


def test_a_method_that_a_suite_lists_twice_is_of_it_once():
    cells, _ = chosen(("garments",), methods=("simulation", "simulation-perturbed-*", "simulation-refrozen"))
    assert len(cells) > 4 and all(cell.suites == ("garments",) for cell in cells)


def test_the_reference_comes_first_in_every_scene():
    cells, _ = chosen(("garments", "speed"), full=True)
    first = {}
    for cell in cells:
        if not cell.scene.networks_only:
            first.setdefault(cell.scene.name, cell.method)
    assert set(first.values()) == {"simulation"} and len(first) == 8


def test_only_what_has_a_seed_is_repeated_and_the_rest_is_the_same_whatever_the_seeds():
    cells, _ = chosen(("garments",), seeds=(3, 5))
    seeds = {}
    for cell in cells:
        seeds.setdefault(cell.method, set()).add(cell.seed)
    assert seeds["snug"] == seeds["untrained"] == {3, 5} and seeds["simulation"] == seeds["skinning"] == {0}


def test_patterns_choose_scenes_methods_and_cases():
    cells, cases = chosen(("speed", "validation", "extremes"), scenes=["*sheet*", "free_fall"])
    assert {cell.scene.name for cell in cells} == {"hanging_sheet", "sheet_on_sphere", "free_fall"}
    known = [case.name for case in cases if case.suite == "validation"]
    assert known == ["free_fall", "hanging_sheet_time_step_order"]
    assert [case for case in cases if case.suite == "extremes"] == []
    _, cases = chosen(("validation", "extremes"), methods=["sim*"])
    assert sum(case.suite == "validation" for case in cases) >= 10
    assert sum(case.suite == "extremes" for case in cases) >= 8


def test_a_pattern_of_another_garment_means_its_motions_of_the_split():
    def names(pattern, split="test", suites=("garments",)):
        of = split_motions([], [], find_preset("quick"), split=split)
        cells = choose_cells(
            Selection(suites=suites, preset=find_preset("quick"), motions=of, scenes=(pattern,))
        )[0]
        return of, {cell.scene.name for cell in cells}

    for split in ("test", "validation"):
        of, scenes = names("trousers/*", split)
        assert scenes == {f"trousers/{motion}" for motion in of.measured} and len(scenes) >= 4
    of, scenes = names("skirt/*")
    assert scenes == {f"skirt/{motion}" for motion in of.dynamic_measured}
    of, scenes = names("shorts/*@clip", suites=("speed",))
    assert scenes == {f"shorts/{motion}@clip" for motion in of.measured}


def test_a_name_means_itself_whatever_is_in_it():
    cells, _ = chosen(("garments",), scenes=["tshirt/w[1]"], test=("w[1]", "w2"))
    assert {cell.scene.name for cell in cells} == {"tshirt/w[1]"}


def test_what_is_left_out_of_a_default_run_is_there_where_its_suite_or_itself_is_named():
    both = ("speed", "extremes")
    slow = {"newton-2", "lbfgs-40", "gradient-descent-10", "simulation-perturbed-1e-9"}
    for choice, expected in (({}, False), ({"full": True}, True), ({"methods": ("*",)}, True)):
        cells, cases = chosen(both, **choice)
        assert (slow & {cell.method for cell in cells}) == (slow if expected else set())
        assert {case.suite for case in cases} == {"extremes"}
    assert {cell.method for cell in chosen(both, methods=("lbfgs-40",))[0]} == {"lbfgs-40"}
    long = "slit_annulus_inner"
    for choice, expected in (({}, False), ({"full": True}, True)):
        assert (long in [case.name for case in chosen(("validation",), **choice)[1]]) == expected


def dynamic(suites, **changes):
    motions = Motions(("walk",), ("kick",), {}, ("twist_stop",))
    criteria = {name: tuple(value) for name, value in changes.items()}
    return choose_cells(
        Selection(suites=tuple(suites), preset=find_preset("quick"), motions=motions, **criteria)
    )[0]


def test_preset_quick_has_eight_motions_preset_paper_all_and_either_those_that_are_named():
    def motions(full=False, preset="quick", **choice):
        of = split_motions([], choice.get("tests", []), find_preset(preset), **choice.get("split", {}))
        request = Selection(suites=("garments",), full=full, preset=find_preset(preset), motions=of)
        return {cell.scene.motion for cell in choose_cells(request)[0] if cell.scene.part == "whole"}

    everything = set(split_motions([], [], find_preset("quick")).measured)
    assert len(everything) == 8 and motions() == motions(full=True) == everything < motions(preset="paper")
    assert len(motions(preset="paper")) == 22
    named = ["kick", "punch", "walk", "bow"]
    assert motions(tests=named) == set(named)
    assert motions(split={"validation_names": named, "split": "validation"}) == set(named)
    assert len(motions(tests=["walk"], split={"split": "validation"})) == 8


def test_networks_of_a_second_garment_are_left_out_with_a_reason_until_its_scenes_are_named():
    motions = Motions(("walk",), ("kick",), {}, dynamic_test=("twist_stop",))
    request = Selection(suites=("speed",), full=True, preset=find_preset("quick"), motions=motions)
    skirt = {
        cell.method: cell.entry.skip(cell.scene)
        for cell in choose_cells(request)[0]
        if "skirt" in cell.scene.name
    }
    assert "second garment" in skirt["snug"] and "second garment" in skirt["pbns"] and not skirt["newton-4"]
    named = choose_cells(replace(request, scenes=("skirt/twist_stop@clip",)))[0]
    assert {cell.entry.skip(cell.scene) for cell in named if cell.method == "snug"} == {None}


def test_what_no_suite_lists_is_met_by_its_whole_name():
    both = ("garments", "speed")
    plain = {(cell.scene.name, cell.suites) for cell in dynamic(both, scenes=["tunic/*"])}
    assert plain == {("tunic/twist_stop", ("garments",))}
    clip, whole = "tunic/twist_stop@clip", "tshirt/twist_stop"
    met = {(cell.scene.name, cell.suites) for cell in dynamic(both, scenes=[clip, whole])}
    assert met == {(clip, ("speed",)), (whole, ("garments",))}
    assert not {clip, whole} & {cell.scene.name for cell in dynamic(both)}


def test_an_added_scene_or_method_needs_its_line_and_its_name(monkeypatch):
    from benchmarks import scenes
    from benchmarks.method import MethodEntry
    from benchmarks.methods.catalogue import all_methods as methods
    from benchmarks.scene import Scene

    mine = Scene(name="my_scene", description="", module="my_scene")
    monkeypatch.setattr(scenes, "SCENES", (*scenes.SCENES, mine))
    entries = (*methods.METHODS, MethodEntry(name="my-method", description="", module="my_method"))
    for module in (methods, choosing):
        monkeypatch.setattr(module, "METHODS", entries)
    cells = dynamic(("garments", "speed"), scenes=["my_scene"], methods=["simulation", "my-method"])
    assert [(c.scene, c.method, c.suites) for c in cells] == [
        (mine, "simulation", ("speed",)),
        (mine, "my-method", ("speed",)),
    ]
    worn = dynamic(("garments", "speed"), scenes=["tshirt/kick"], methods=["my-method"])
    assert [(c.scene.name, c.suites) for c in worn] == [("tshirt/kick", ("garments",))]
    for choice in ({}, {"scenes": ["*"]}, {"methods": ["*"]}):
        assert not {"my_scene", "my-method"} & {
            name for c in dynamic(("speed",), **choice) for name in (c.scene.name, c.method)
        }


def test_motions_are_divided_as_help_says():
    from snug.motion.library import TEST, TRAIN, VALIDATION

    quick = find_preset("quick")
    library = split_motions([], [], quick)
    assert (library.train, library.validation, library.test) == (TRAIN, VALIDATION, TEST)
    assert library.files == () and library.measured == TEST[:8]
    assert split_motions([], [], find_preset("paper")).measured == TEST
    moved = split_motions([], ["walk", "kick"], quick)
    assert set(moved.test) == {"walk", "kick"} and "kick" not in moved.validation
    assert not {"walk", *VALIDATION, *TEST} & set(moved.train)
    assert not {"05_02_b", "05_02_c"} & set(split_motions([], ["05_02_a"], quick).validation)
    other = split_motions([], [], quick, validation_names=["bow"], split="validation")
    assert (other.validation, other.test, other.measured) == (("bow",), TEST, ("bow",))
    assert not {"bow", *VALIDATION, *TEST} & set(other.train)
    small = split_motions([], [], SMOKE)
    assert (len(small.train), len(small.measured)) == (SMOKE.train_motions, SMOKE.test_motions)

    clips = "abc"
    files = split_motions(clips, [], quick)
    assert (files.train, files.test, sorted(files.files)) == (("b", "c"), ("a",), ["a", "b", "c"])
    named = split_motions([], ["kick", "punch", "walk"], SMOKE)  # all those named, whatever the preset
    assert set(named.test) == {"kick", "punch", "walk"} and len(named.train) == SMOKE.train_motions
    chosen = split_motions(clips, ["c", "b"], quick)
    assert (chosen.train, chosen.test) == (("a",), ("b", "c"))
    both = split_motions(clips, [], quick, library=True)
    assert both.train == ("a", "b", "c", *TRAIN) and both.measured == TEST[:8]
    single = split_motions("a", [], quick)
    assert (single.train, single.test) == (TRAIN, ("a",))
    roles = split_motions(clips, ["b"], quick, validation_names=["a", "c"])  # none is left to train on
    assert (roles.train, roles.validation, roles.test) == (TRAIN, ("a", "c"), ("b",))
    assert [roles.role_of(name) for name in ("a", "b", "walk", "kick")] == [
        "validation", "test", "", "",
    ]  # fmt: skip
    # A user's files of clips whose parts are measured do not train, nor does the library's.
    motions = split_motions(["01_01", "05_02", "05_12", "a"], [], quick, library=True)
    assert motions.train[:2] == ("05_12", "a") and not {"01_01", "05_02"} & set(motions.train)
    alone = split_motions(["01_01", "05_02", "05_12"], ["05_12"], quick)
    assert (alone.train, alone.test) == (("01_01", "05_02"), ("05_12",))
    assert "05_12" not in split_motions(["05_12"], [], quick).train
    whole = split_motions([], ["01_01", "05_04"], quick)
    assert set(whole.test) == {"01_01", "05_04"} and "05_04" not in whole.train
    for choice, message in (
        ({"test_names": ["a"], "validation_names": ["a"]}, "'a' is a test motion"),
        ({"test_names": [], "validation_names": ["d"]}, "--validation-motions: unknown motion 'd'"),
        ({"test_names": ["a"], "split": "validation"}, "name some by --validation-motions"),
    ):
        with pytest.raises(PlanError, match=message):
            split_motions(clips, preset=quick, **choice)


def test_own_clips_that_are_cut_are_named_and_frames_measures_more(tmp_path):
    import numpy as np

    poses = np.zeros((200, 24, 3))
    np.savez(
        tmp_path / "long.npz", poses=poses.reshape(200, 72), trans=np.zeros((200, 3)), mocap_framerate=30.0
    )

    def plan_of(*options: str):
        return planned(
            "--motions", str(tmp_path), "--test-motions", "long", "--methods", "skinning", *options
        )

    assert plan_of().cut_motions == {"long": "the first 150 of 200 frames"}
    assert plan_of("--frames", "200").cut_motions == {} and plan_of("--frames", "180").preset.frames == 180
    with pytest.raises(PlanError, match="--frames 2: give 3 or more"):
        plan_of("--frames", "2")
