"""The command refuses what it could not do, in one line and before any work."""

import pytest

from snug.motion.library import TRAIN
from snug.train import choose_motions, main, parse_options


def test_motions_that_validate_do_not_train():
    training, validation = choose_motions(parse_options(["--validation", "kick", "--validation", "bow"]))
    assert [motion.name for motion in validation] == ["kick", "bow"]
    assert [motion.name for motion in training] == list(TRAIN)


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        ("-o {0}/file/model.safetensors", "file"),
        ("--seed -1", "seed=-1: give a number from 0"),
        ("--patience 3", "--patience 3: add --validation NAME"),
        ("--motions {0}/nowhere", "nowhere"),
        ("--validation dance_turn", "no such motion among 07_01"),
    ],
)
def test_command_line_refuses_what_it_could_not_do(arguments, hint, refused, tmp_path):
    (tmp_path / "file").touch()
    given = ["-o", str(tmp_path / "model.safetensors"), "--vertices", "200"]
    refused(hint, main, [*given, *arguments.format(tmp_path).split()])
