"""The reference on every frame of every recorded clip."""

import numpy as np
import pytest

from benchmarks.assets import Assets
from benchmarks.methods.simulation import Simulation
from benchmarks.presets import find_preset
from snug.body.parametric_body import Body
from snug.garments.templates import TSHIRT, find_template
from snug.motion.library import CLIPS, SEGMENTS, make_motion
from tests.benchmarks.runner.tasks_by_hand import dressed_scene


@pytest.fixture(scope="module")
def dressed():
    body = Body.load()
    return body, find_template(TSHIRT).tailor(body, vertices=1000)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*CLIPS, *SEGMENTS])
def test_the_reference_converges_on_every_frame(name, dressed):
    body, garment = dressed
    motion, method = make_motion(name), Simulation()
    assets = Assets(body, {TSHIRT: garment}, {name: motion}, {})
    method.prepare(dressed_scene(name, preset=find_preset("quick")).build(assets))
    trajectory = method.run()
    assert trajectory.frames == motion.frames
    assert np.flatnonzero(trajectory.frame_fields["converged"] < 1).tolist() == []
