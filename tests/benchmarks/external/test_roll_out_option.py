"""The option that names a roll-out of others, and what is said of one that cannot be meant."""

from __future__ import annotations

import pytest

from benchmarks.external.roll_out_files import (
    FileConventions,
    RollOutFileError,
    RollOutOption,
    parse_roll_out,
    roll_out_of,
)
from benchmarks.methods.outside import entry_of


def test_an_option_says_everything_of_a_roll_out():
    assert roll_out_of(*parse_roll_out("mine=a.npz,other-mesh")).stated.other_mesh
    option = roll_out_of(*parse_roll_out("mine=out/{scene}.pc2,units=cm,up=z,fps=60,match-vertices,ms=2.2"))
    assert option == RollOutOption("mine", "out/{scene}.pc2", FileConventions("cm", "z", 60.0, True), 2.2)
    assert option.path_for("tshirt/kick") == "out/tshirt-kick.pc2"
    assert entry_of(option, "tshirt/kick") is None  # there is no file for that scene
    assert parse_roll_out("out/my run_{scene}.npz,up=z", named=False)[0] == "my-run"  # the file's


@pytest.mark.parametrize(
    ("text", "hint"),
    [("mine", "NAME=FILE"), ("=a.npz", "NAME=FILE"), ("a b=a.npz", "letters"), ("m=a.npz,x", "unknown word"),
     ("m=a.npz,units=inch", "choose from m, cm, mm"), ("m=a.npz,fps=fast", "no number"),
     ("m=a.npz,fps=-1", "positive"), ("m=a.npz,ms=0", "positive"),
     ("m=a.npz,match-vertices=false", "match_vertices=false: say it, or leave it out"),
     ("m=a.npz,other-mesh=", "other_mesh=: say it, or leave it out")],
)  # fmt: skip
def test_a_wrong_option_is_one_line(text, hint):
    with pytest.raises(RollOutFileError, match=hint) as refused:
        roll_out_of(*parse_roll_out(text))
    assert "\n" not in str(refused.value)
