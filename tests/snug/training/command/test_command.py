"""The command refuses what it could not do, in one line and before any work."""

import numpy as np

from snug.motion.library import TRAIN
from snug.motion.motion import Motion
from snug.recipes.recipe import DEFAULT, Recipe
from tests.snug.training.dressing import swaying


def test_command_line_refuses_a_wrong_path(capsys, tmp_path):
    from snug.train import main
    from snug.training.command.choices import choose_motions
    from snug.training.command.options import parse_options

    out = tmp_path / "model.safetensors"
    assert main(["--motions", str(tmp_path / "nowhere"), "-o", str(out)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "nowhere" in error and not out.exists()
    assert main(["--repair", "-o", str(out)]) == 2
    assert "say of which files by --motions" in capsys.readouterr().err
    np.savez(tmp_path / "a.npz", poses=np.zeros((9, 72)), trans=np.zeros((9, 3)))
    validating = ["--validation", "kick", "--validation", "bow"]
    training, validation = choose_motions(parse_options(validating), None)
    assert [motion.name for motion in validation] == ["kick", "bow"]
    assert [motion.name for motion in training] == list(TRAIN)
    assert main(["--validation", "dance_turn", "-o", str(out)]) == 2  # a test motion
    assert "--validation dance_turn: no such motion among 07_01" in capsys.readouterr().err
    words = ["--motions", str(tmp_path), "--motion-fps", "30", "--hold-out", "b", "-o", str(out)]
    assert main(words) == 2  # the motion itself was read
    assert "--hold-out b: no such motion among a" in capsys.readouterr().err
    assert Recipe() == DEFAULT and isinstance(swaying(), Motion)


def test_command_line_refuses_what_it_could_not_do_before_any_work(capsys, tmp_path):
    from snug.train import main

    (tmp_path / "file").touch()
    assert main(["-o", str(tmp_path / "file" / "model.safetensors")]) == 2
    assert main(["--threads", "0", "-o", str(tmp_path / "model.safetensors")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 2 and "file" in error and "--threads 0: at least 1" in error
    for words, said in (
        (["-o", str(tmp_path)], "is a folder; name a file"),
        (["--seed", "-1"], "--seed -1: at least 0"),
        (["--checkpoint-minutes", "-1"], "--checkpoint-minutes -1.0: at least 0"),
        (["--patience", "3"], "--patience 3: add --validation NAME"),
        (["--garment", "a/shirt.obj", "--garment", "b/shirt.obj"], "model-shirt.safetensors: rename a file"),
        (["--motions", "nowhere", "-o", str(tmp_path / "new" / "sub" / "m.safetensors")], "nowhere"),
    ):
        assert main(["-o", str(tmp_path / "model.safetensors"), *words]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and said in error
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_each_model_has_a_file_of_its_own():
    from snug.training.command.options import parse_options

    assert parse_options([]).out == "snug.safetensors"
    assert parse_options(["--model", "pbns"]).out == "pbns.safetensors"
    assert parse_options(["--model", "pbns", "-o", "mine.safetensors"]).out == "mine.safetensors"
