"""The energies of six small scenes, term by term and frame by frame, are those that were kept."""

from __future__ import annotations

import pytest

from tests.reference_sim.energies.regression_scenes import SCENES, computed, scales, stored

# Round-off of 1e-13 m at the start moves no term by more than 1e-11, another linear solver by 1e-14; the
# solver's own tolerance of 1e-10 is below that. 1e-9 leaves room for other processors.
TOLERANCE = 1e-9


@pytest.mark.parametrize("scene", SCENES)
def test_the_energies_are_those_that_were_kept(scene):
    kept, new = stored(), computed(scene)
    sizes = scales(kept)
    assert new.keys() == {key for key in kept if key[0] == scene}
    for (_, frame, term), value in new.items():
        far = abs(value - kept[scene, frame, term])
        assert far <= TOLERANCE * sizes[scene, term], (
            f"{scene}, frame {frame}: {term} {kept[scene, frame, term]!r} -> {value!r} J; if that is meant: "
            "python -m tests.reference_sim.energies.regression_scenes"
        )
