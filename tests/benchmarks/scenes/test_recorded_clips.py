"""The reference on every frame of every recorded clip."""

import numpy as np
import pytest

from benchmarks.assets import Assets
from benchmarks.presets import find_preset
from benchmarks.scenes import of_garment
from reference_sim.time_loop import simulate
from snug.body.parametric_body import Body
from snug.garments.templates import TSHIRT, find_template
from snug.motion.library import CLIPS, SEGMENTS, make_motion


@pytest.fixture(scope="module")
def dressed():
    body = Body.load()
    return body, find_template(TSHIRT).tailor(body, vertices=1000)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*CLIPS, *SEGMENTS])
def test_the_reference_converges_on_every_frame(name, dressed):
    body, garment = dressed
    scene = of_garment(TSHIRT).scene(name).at(find_preset("quick"))
    motion = make_motion(name)
    built = scene.build(Assets(body, {TSHIRT: garment}, {name: motion}, {}))
    trajectory = simulate(
        built.cloth,
        built.energies,
        dt=built.dt,
        frames=built.frames,
        obstacle=built.obstacle,
        start=built.start,
    )
    assert trajectory.frames == motion.frames
    assert np.flatnonzero(trajectory.frame_fields["converged"] < 1).tolist() == []
