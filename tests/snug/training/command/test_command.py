"""The command refuses what it could not do, in one line and before any work."""

import numpy as np

from snug.motion.library import TRAIN
from snug.motion.motion import Motion
from snug.recipe import DEFAULT, Recipe
from tests.snug.training.dressing import swaying


def test_command_line_refuses_a_wrong_path(refused, tmp_path):
    from snug.train import main, parse_options
    from snug.training.train_to_file import choose_motions

    out = tmp_path / "model.safetensors"
    refused("nowhere", main, ["--motions", str(tmp_path / "nowhere"), "-o", str(out)])
    refused("say of which files by --motions", main, ["--repair", "-o", str(out)])
    np.savez(tmp_path / "a.npz", poses=np.zeros((9, 72)), trans=np.zeros((9, 3)))
    validating = ["--validation", "kick", "--validation", "bow"]
    training, validation = choose_motions(parse_options(validating), None)
    assert [motion.name for motion in validation] == ["kick", "bow"]
    assert [motion.name for motion in training] == list(TRAIN)
    of_tests = ["--validation", "dance_turn", "-o", str(out)]
    refused("--validation dance_turn: no such motion among 07_01", main, of_tests)
    arguments = ["--motions", str(tmp_path), "--motion-fps", "30", "--hold-out", "b", "-o", str(out)]
    refused("--hold-out b: no such motion among a", main, arguments)  # the motion itself was read
    assert Recipe() == DEFAULT and isinstance(swaying(), Motion)


def test_command_line_refuses_what_it_could_not_do_before_any_work(refused, tmp_path):
    from snug.train import main

    (tmp_path / "file").touch()
    for arguments, hint in (
        (["-o", str(tmp_path / "file" / "model.safetensors")], "file"),
        (["--threads", "0"], "--threads 0: at least 1"),
        (["-o", str(tmp_path)], "is a folder; name a file"),
        (["--seed", "-1"], "--seed -1: at least 0"),
        (["--checkpoint-minutes", "-1"], "--checkpoint-minutes -1.0: at least 0"),
        (["--patience", "3"], "--patience 3: add --validation NAME"),
        (["--garment", "a/shirt.obj", "--garment", "b/shirt.obj"], "model-shirt.safetensors: rename a file"),
        (["--motions", "nowhere", "-o", str(tmp_path / "new" / "sub" / "m.safetensors")], "nowhere"),
    ):
        refused(hint, main, ["-o", str(tmp_path / "model.safetensors"), *arguments])


def test_each_model_has_a_file_of_its_own():
    from snug.train import parse_options

    assert parse_options([]).out == "snug.safetensors"
    assert parse_options(["--model", "pbns"]).out == "pbns.safetensors"
    assert parse_options(["--model", "pbns", "-o", "mine.safetensors"]).out == "mine.safetensors"
