"""A study is resolved into cells and cases, with motions divided into training and test."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.metrics import pick_measured
from benchmarks.plan.choose_cells import expand, matching
from benchmarks.plan.motions import Motions, split_motions
from benchmarks.plan.plan import make_plan
from benchmarks.plan.study import StudyError, read_study
from benchmarks.presets import find_preset
from benchmarks.scenes import GARMENT_SCENES
from snug.motion.library import DYNAMIC_TEST, TEST, TRAIN, VALIDATION
from tests.benchmarks.plan.planned import planned, study_with

SMOKE = find_preset("smoke")
TESTS = ("--test-motions", "kick,punch")


def test_a_cell_in_two_parts_is_run_once():
    cells = planned("full:garments,speed", *TESTS).cells
    keys = [(cell.scene.name, cell.method, cell.seed) for cell in cells]
    assert len(set(keys)) == len(keys)
    # Whole motions and their clips are scenes of their own: a part that times every solver takes the
    # clips.
    assert {cell.suites for cell in cells if cell.scene.part == "clip"} == {("speed",)}
    assert {cell.suites for cell in cells if cell.scene.name == "tshirt/kick"} == {("garments",)}
    study = study_with("full:garments,speed", scenes="tshirt/kick", methods="simulation")
    parts = {name: replace(part, scenes=("tshirt/{motion}",)) for name, part in study.parts.items()}
    (cell,) = make_plan(replace(study, parts=parts, test_motions=("kick",))).cells
    assert cell.suites == ("garments", "speed")


def test_of_whole_motions_the_first_alone_is_timed_and_all_else_is_measured_in_all():
    scenes = {cell.scene.name: cell.scene for cell in planned("full:garments,speed", *TESTS).cells}
    assert scenes["tshirt/kick"].timed and not scenes["tshirt/punch"].timed
    assert scenes["tshirt/kick@clip"].timed and scenes["hanging_sheet"].timed
    left_out = {*pick_measured(None)} - {*pick_measured(scenes["tshirt/punch"].metrics)}
    assert [measurements.name for measurements in left_out] == ["cost"]
    assert scenes["tshirt/punch"].dynamic


def test_the_reference_comes_first_in_every_scene_and_only_what_has_a_seed_is_repeated():
    first, seeds = {}, {}
    for cell in planned("full:garments,speed", *TESTS, "--seeds", "3,5").cells:
        seeds.setdefault(cell.method, set()).add(cell.seed)
        if not cell.scene.networks_only:
            first.setdefault(cell.scene.name, cell.method)
    assert set(first.values()) == {"simulation"} and len(first) == 4
    assert seeds["snug"] == {3, 5}
    assert seeds["simulation"] == seeds["skinning"] == {0}
    alone = planned("full:garments", *TESTS, "--seeds", "3,5", "--set", "one_seed=sn*").cells
    assert {cell.seed for cell in alone if cell.method == "snug"} == {3}
    assert {cell.seed for cell in alone if cell.method == "pbns"} == {3, 5}


def test_patterns_choose_scenes_methods_and_cases():
    plan = planned("full:speed,validation,extremes", "--scenes", "*sheet*,free_fall,pend*")
    assert {cell.scene.name for cell in plan.cells} == {"hanging_sheet", "free_fall"}
    assert [(case.name, case.suite) for case in plan.cases] == [
        ("free_fall", "validation"), ("pendulum", "validation"),
    ]  # fmt: skip
    assert matching(["a", "ab", "b"], ["a*", "!ab"]) == ["a"] and matching(["a", "b"], ["!b"]) == ["a"]
    assert matching(["w1", "w[1]"], ["w[1]"]) == ["w1", "w[1]"] and matching(["a"], []) == []


def test_patterns_that_take_names_out_bring_none_in():
    def met(*words: str) -> set[tuple[str, str]]:
        plan = planned("full:garments,speed,validation", *TESTS, *words)
        return {
            *((cell.scene.name, cell.method) for cell in plan.cells),
            *((c.name, "") for c in plan.cases),
        }

    usual = met()
    fewer = {(s, m) for s, m in usual if not (s.endswith("@clip") or s == "pendulum" or "newton" in m)}
    assert met("--scenes", "!*@clip,!pendulum", "--methods", "!newton*") == fewer != usual
    assert met("--scenes", "tshirt/*,!*@clip") < usual


def test_places_of_a_pattern_are_filled_by_motions_of_the_split():
    motions = Motions(("walk",), ("kick", "punch"), garments=GARMENT_SCENES[:3])
    names = expand(["{garment}/{motion}", "tunic/{motion}", "tshirt/{motion 2}@clip", "flag"], motions)
    swinging = [f"tunic/{motion}" for motion in DYNAMIC_TEST]
    assert names == ["tshirt/kick", "tshirt/punch", *swinging, "tshirt/punch@clip", "flag"]
    assert expand(["skirt/{swinging 1}"], motions) == [f"skirt/{DYNAMIC_TEST[0]}"]
    for place in ("{motion 0}", "{swinging 9}"):
        with pytest.raises(StudyError, match=f"skirt/{place}: there are 2 such motions, counted from 1"):
            expand([f"skirt/{place}"], motions)


@pytest.mark.parametrize(
    ("part", "pattern", "split"),
    [("garments", "skirt/*", "validation"), ("speed", "shorts/*@clip", "test")],
)
def test_a_pattern_of_another_garment_means_its_motions_of_the_split(part, pattern, split):
    plan = planned(f"full:{part}", "--set", f"split={split}", "--scenes", pattern)
    measured = plan.motions.pick_motions(pattern.partition("/")[0])
    assert {scene.name for scene in plan.scenes} == {pattern.replace("*", motion) for motion in measured}
    assert len(measured) > 1


def divided(files=(), **fields):
    return split_motions(study_with(**fields), files)


def test_what_no_part_lists_is_met_by_its_whole_name():
    clip, whole = "tunic/twist_stop@clip", "tshirt/twist_stop"
    met = {
        (cell.scene.name, cell.suites) for cell in planned("full", "--scenes", f"{clip},{whole}").cells
    }
    assert met == {(clip, ("speed",)), (whole, ("garments",))}
    assert not {clip, whole} & {scene.name for scene in planned("full").scenes}


def test_motions_are_divided_as_help_says():
    assert len(divided(sizes="paper").measured) == 22
    library = divided()
    assert (library.train, library.validation, library.test) == (TRAIN, VALIDATION, TEST)
    assert library.files == () and library.measured == TEST[:8]
    assert library.pick_motions("skirt") == DYNAMIC_TEST
    moved = divided(test_motions=["walk", "kick"])
    assert moved.pick_motions("skirt") == moved.pick_motions("dress") == moved.test
    assert moved.by_role("skirt")["validation"] == library.by_role("skirt")["validation"]
    assert set(moved.test) == {"walk", "kick"} and "kick" not in moved.validation
    assert not {"walk", *VALIDATION, *TEST} & set(moved.train)
    assert not {"05_02_b", "05_02_c"} & set(divided(test_motions=["05_02_a"]).validation)
    other = divided(validation_motions="bow", split="validation")
    assert (other.test, other.measured) == (TEST, ("bow",)) and not {"bow", *TEST} & set(other.train)
    small = divided(sizes="smoke")
    assert (len(small.train), len(small.measured)) == (SMOKE.train_motions, SMOKE.test_motions)

    clips = "abc"
    files, mixed, single = divided(clips), divided(clips, motions="library"), divided("a")
    assert (files.train, files.test) == (("b", "c"), ("a",))
    assert mixed.train == ("a", "b", "c", *TRAIN) and mixed.measured == TEST[:8]
    assert (single.train, single.test) == (TRAIN, ("a",))
    roles = divided(clips, test_motions="b", validation_motions=["a", "c"])  # none is left to train on
    assert (roles.train, roles.validation, roles.test) == (TRAIN, ("a", "c"), ("b",))
    assert [*map(roles.role_of, ("a", "b", "walk", "kick"))] == ["validation", "test", "", ""]
    # A user's files of clips whose parts are measured do not train, nor does the library's.
    motions = divided(["01_01", "05_02", "05_12", "a"], motions="library")
    assert motions.train[:2] == ("05_12", "a") and not {"01_01", "05_02"} & set(motions.train)
    assert "05_12" not in divided(["05_12"]).train
    assert "05_04" not in divided(test_motions=["01_01", "05_04"]).train


def test_a_published_split_divides_the_motions():
    split = {"motion_files.split": "snug"}
    motions = divided(["02_04", "01_01", "91_62", "07_02"], **split)
    assert (motions.train, motions.measured) == (("02_04", "91_62"), ("01_01", "07_02"))
    assert divided(["02_04", "01_01", "07_02"], test_motions="07_02", **split).train == ("02_04",)
    with pytest.raises(StudyError, match="split: no test clip can be read: 01_01, 07_02, 55_27, 104_54"):
        divided(["02_04"], **split)


def test_a_recipe_is_never_chosen_by_the_test_motions():
    ablations = read_study("ablations")
    assert ablations.split == "validation" and not ablations.test_motions
    motions = split_motions(ablations)
    assert motions.measured == VALIDATION[:8] and not set(TEST) & {*motions.measured, *motions.train}
