"""A body of the user's own has to have the shapes that the scenes of a run ask for."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.plan.study import StudyError
from snug.body.parametric_body import Body
from tests.benchmarks.plan.planned import planned


@pytest.fixture(scope="module")
def shapeless(tmp_path_factory) -> str:
    """The package's body without its shapes, which a file may lack."""
    body, path = Body.load(), tmp_path_factory.mktemp("body") / "mine.npz"
    table = np.stack([np.maximum(body.parents, 0), np.arange(24)])
    np.savez(
        path, v_template=body.template, f=body.faces, weights=body.skinning_weights, kintree_table=table,
        J_template=body.joint_template,
    )  # fmt: skip
    return str(path)


@pytest.mark.parametrize(
    ("suite", "scene", "count"),
    [("shapes", "shapes/1", 10), ("extremes", "out_of_distribution/height_+5", 1)],
)
def test_scenes_of_other_body_shapes_need_a_body_that_has_shapes(suite, scene, count, shapeless, tmp_path):
    options = (f"full:{suite}", "--body", shapeless, "-o", str(tmp_path / "run"))
    with pytest.raises(StudyError, match=r"mine\.npz: has 0 body shapes .*'shapedirs'") as refused:
        planned(*options)
    assert f"scene {scene} needs {count}" in str(refused.value) and "\n" not in str(refused.value)


def test_a_body_without_shapes_takes_part_elsewhere(shapeless, tmp_path):
    options = ("smoke", "--body", shapeless, "-o", str(tmp_path / "run"))
    assert planned(*options).inputs.body is not None
    walks = planned("smoke:extremes", *options[1:], "--scenes", "out_of_distribution/walk*")
    assert [scene.name for scene in walks.scenes] == ["out_of_distribution/walk_x4"]
