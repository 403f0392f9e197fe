"""Files of a user's motions: which of a folder are read, and what they may be called."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks import run
from benchmarks.plan.motions import split_motions
from benchmarks.plan.study import StudyError, read_study
from snug.motion.library import TEST, VALIDATION
from snug.motion.motion import MotionError
from tests.benchmarks.assets.test_inputs import write_motions
from tests.benchmarks.plan.planned import planned, study_with

WORDS = ("smoke:garments", "--methods", "skinning")


@pytest.mark.parametrize("name", ["walk  slow", "walk ", " walk", "walk,slow"])
@pytest.mark.parametrize("named", ["folder", "file"])
def test_a_name_that_rows_or_options_cannot_have_is_refused(name, named, tmp_path):
    folder = write_motions(tmp_path / "clips", name)
    path = folder if named == "folder" else f"{folder}/{name}.npz"
    with pytest.raises(MotionError, match="without a comma, without spaces side by side") as refused:
        planned(*WORDS, "--motions", path, "-o", str(tmp_path / "run"))
    assert f"{folder}/{name}.npz" in str(refused.value) and "\n" not in str(refused.value)


def test_single_spaces_name_a_motion(tmp_path):
    folder = write_motions(tmp_path / "clips", "a b")
    plan = planned(*WORDS, "--motions", folder, "-o", str(tmp_path / "run"))
    assert plan.motions.test == ("a b",)


def subject(folder: Path, *clips: str) -> str:
    """A subject of AMASS: its shape lies beside its clips."""
    path = write_motions(folder, *clips)
    np.savez(folder / "shape.npz", gender=np.array("male"), betas=np.zeros(16))
    return path


def test_a_file_of_a_body_shape_beside_clips_is_left_out(tmp_path, capsys):
    folder = subject(tmp_path / "01", "01_01", "01_02")
    plan = planned(*WORDS, "--motions", folder, "-o", str(tmp_path / "run"))
    assert set(plan.inputs.motions) == {"01_01", "01_02"}
    write_motions(tmp_path / "02", "shape")  # a motion of that name is one
    other = planned(*WORDS, "--motions", str(tmp_path / "02"), "-o", str(tmp_path / "run"))
    assert set(other.inputs.motions) == {"shape"}
    # Named by itself it was meant to be a motion.
    assert run.main([*WORDS, "--motions", f"{folder}/shape.npz", "-o", str(tmp_path / "run")]) == 2
    assert "no array of a motion" in capsys.readouterr().err


def test_a_folder_without_any_motion_and_a_damaged_file_are_refused(tmp_path, refused):
    options = [*WORDS, "-o", str(tmp_path / "run"), "--motions"]
    refused("no array of a motion", run.main, [*options, subject(tmp_path / "shapes")])
    folder = subject(tmp_path / "clips", "a")
    (tmp_path / "clips" / "b.npz").write_bytes(b"PK")
    refused("b.npz", run.main, [*options, folder])
    assert refused("no such file", run.main, [*options, str(tmp_path / "nowhere")])


def test_a_recipe_is_never_chosen_by_the_test_motions():
    ablations = read_study("ablations")
    assert ablations.split == "validation" and not ablations.test_motions
    motions = split_motions(ablations)
    assert motions.measured == VALIDATION[:8] and not set(TEST) & {*motions.measured, *motions.train}
    with pytest.raises(StudyError, match="'dance_turn' is a test motion"):
        split_motions(study_with(validation_motions="dance_turn", split="validation"))
