"""Arrays in the page: packed into few bytes, and the values that are computed for it."""

from __future__ import annotations

import base64
import zlib

import numpy as np
import pytest

from reports.page.embedded_roll_outs import Pack, depth, skin_of
from tests.reference_sim.meshes import box


def unpacked(entries: dict, text: str) -> dict[str, np.ndarray]:
    """The arrays of a pack, frame by frame as data.js has them."""
    data, arrays = zlib.decompress(base64.b64decode(text)), {}
    for name, entry in entries.items():
        shape = tuple(entry["shape"])
        size = int(np.prod(shape))
        if entry["kind"] == "positions":
            planes = np.frombuffer(data, np.uint8, 2 * size, entry["at"])
            low, high = planes.reshape(2, *shape).astype(int)
            left = low + 256 * high
            left = np.where(left % 2, -(left + 1) // 2, left // 2)
            steps = np.zeros((shape[0] + 2, *shape[1:]), dtype=int)
            for k in range(shape[0]):
                moved = steps[k + 1] - steps[k] if k > 1 else 0
                steps[k + 2] = (steps[k + 1] + moved + left[k]) % 65536
            arrays[name] = np.array(entry["low"]) + entry["step"] * steps[2:]
        elif entry["kind"] == "values":
            levels = np.frombuffer(data, np.uint8, size, entry["at"]).reshape(shape).cumsum(0) % 256
            arrays[name] = entry["full"] * (levels / 255.0) ** 2
        else:
            kind = "<f4" if entry["kind"] == "numbers" else "<u4"
            arrays[name] = np.frombuffer(data, kind, size, entry["at"]).reshape(shape)
    return arrays


@pytest.mark.parametrize(
    ("frames", "far", "least"), [(1, 30.0, 0.0), (3, 30.0, 0.0), (40, 30.0, 0.0), (9, 0.5, 1e-4)]
)
def test_positions_are_off_by_half_a_step_at_most(frames, far, least):
    random = np.random.default_rng(1)
    positions = 0.01 * far * random.normal(size=(frames, 50, 3)).cumsum(axis=0)
    positions[-1, 0], positions[0, 1] = far, -far  # as far apart as can be, from one frame to the next
    pack = Pack()
    pack.positions("x", positions)
    step = pack.entries["x"]["step"]
    assert step == pytest.approx(max(2.0 * far / 65535, least))
    error = np.abs(unpacked(pack.entries, pack.text())["x"] - positions)
    assert error.max() <= 0.5 * step * (1.0 + 1e-9)


def test_values_are_off_by_less_than_a_hundredth_and_finer_where_small():
    random = np.random.default_rng(2)
    values = random.exponential(size=(20, 60))
    values[3, 4] = np.nan
    pack = Pack()
    pack.values("v", values)
    approximation, values[3, 4] = unpacked(pack.entries, pack.text())["v"], 0.0
    full = np.abs(values).max()
    assert np.abs(approximation - values).max() <= full / 100
    small = np.abs(values) < 0.01 * full
    assert np.abs(approximation - values)[small].max() <= full / 1000


def test_the_depth_below_the_skin_is_known():
    corners, sides = box((0, 0, 0), (1, 1, 1))
    points = np.array([[0.5, 0.5, 0.98], [0.5, 0.5, 1.02], [0.01, 0.3, 0.4]])
    skin = skin_of(np.stack([corners + 1.0, corners]), sides)
    np.testing.assert_allclose(depth(points, skin, 1), [20.0, 0.0, 10.0], atol=1e-9)
    assert skin_of(corners, sides[1:]) is None
