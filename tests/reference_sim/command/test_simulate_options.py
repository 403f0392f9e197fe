"""Options of the simulator's command: units in the help, its examples, words of --pins."""

from __future__ import annotations

import re

import numpy as np

from reference_sim.command.simulate_inputs import choose_pins
from reference_sim.command.simulate_options import EXAMPLES, make_parser


def test_help_gives_units():
    help_text = make_parser().format_help()
    for flag, unit in (("young-modulus", "[Pa]"), ("thickness", "[m]"), ("density", "[kg/m^3]")):
        assert re.search(rf"--{flag} \S+\s[^-]*{re.escape(unit)}", help_text)


def test_every_example_of_the_help_is_understood():
    lines = EXAMPLES.replace("\\\n", " ").splitlines()
    commands = [line.split("#")[0].split() for line in lines if line.strip().startswith("python -m")]
    assert len(commands) >= 4
    for arguments in commands:
        assert arguments[:3] == ["python", "-m", "reference_sim.simulate"]
        make_parser().parse_args([word.strip("'") for word in arguments[3:]])


def test_pins_by_index_place_and_height():
    tall = np.column_stack([np.arange(5.0), np.linspace(0, 2, 5), np.zeros(5)])
    assert choose_pins(None, tall).tolist() == []
    assert choose_pins("3, 1", tall).tolist() == [3, 1]
    assert choose_pins("top", tall).tolist() == [4]
    assert choose_pins("x > 1.5, y<=1.5", tall).tolist() == [2, 3]
