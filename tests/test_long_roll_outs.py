"""Long roll-outs: both ends show one motion, a steady garment has no drift, a wandering one is found out."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from benchmarks.methods.networks import model_path
from dressing import swaying, tube_dress

from benchmarks.results import RunFolder
from benchmarks.studies.long_roll_outs import ENDS, FRAMES, cloth_energy, rows, there_and_back
from snug.train import untrained_model


@pytest.mark.parametrize("frames", [5, 20, 77, 150])
def test_the_last_hundred_frames_show_the_motion_of_the_first(frames):
    motion = swaying(frames)
    long = there_and_back(motion)
    assert FRAMES <= long.frames < FRAMES + 2 * frames
    assert np.array_equal(long.poses[-ENDS:], long.poses[:ENDS])
    assert np.array_equal(long.translations[-ENDS:], long.translations[:ENDS])
    steps = np.abs(np.diff(long.translations, axis=0)).max()
    assert steps <= np.abs(np.diff(motion.translations, axis=0)).max()


def test_a_static_network_does_not_drift_and_a_spoilt_one_is_named(tmp_path):
    dressed, folder = tube_dress(), RunFolder(tmp_path)
    motion = swaying(20)
    static = untrained_model("pbns", dressed, [motion], seed=0)
    static.save(model_path(folder.models, "pbns", 0))
    moving = untrained_model("snug", dressed, [motion], seed=0)
    with torch.no_grad():
        moving.network.offsets.bias[0] = torch.nan
    moving.save(model_path(folder.models, "snug", 0))
    plan = SimpleNamespace(models=(("pbns", 0), ("snug", 0), ("tailornet", 0)), test=(motion.name,))
    wardrobe = SimpleNamespace(body=dressed.body, garment=dressed.garment, motions={motion.name: motion})
    found = {(row.method, row.metric): row for row in rows(plan, folder, wardrobe)}
    assert found["pbns", "roll_out/drift"].value < 1e-3
    first, last = (found["pbns", f"roll_out/{end}"].value for end in ("first", "last"))
    assert first == pytest.approx(last, rel=1e-4) and first > 0.0
    assert [row.status for (method, _), row in found.items() if method == "snug"] == ["diverged"]
    assert "frame 0 of" in found["snug", "roll_out/last"].reason
    assert not any(method == "tailornet" for method, _ in found)


def test_energy_of_a_rigid_flight_is_none_and_a_stop_costs_inertia():
    dressed = tube_dress()
    still = np.repeat(dressed.cloth.rest_positions[None], 5, axis=0)
    flying = still + 0.1 * np.arange(5)[:, None, None]
    bending = cloth_energy(still, dressed, 30.0)
    assert cloth_energy(flying, dressed, 30.0) == pytest.approx(bending, rel=1e-9)
    stopped = flying.copy()
    stopped[3:] = flying[2]
    expected = 0.5 * dressed.cloth.masses.sum() * 3 * (0.1 * 30) ** 2 / 3
    assert cloth_energy(stopped, dressed, 30.0) - bending == pytest.approx(expected, rel=1e-9)
