"""The trajectory file: what goes in comes out, nothing half-written counts, and VTK itself reads it."""

from __future__ import annotations

import struct
from dataclasses import replace

import h5py
import numpy as np
import pytest

from reference_sim import Trajectory, TrajectoryError
from reference_sim.files.mesh_files import read_mesh
from reference_sim.trajectory import read_point_cache, write_point_cache
from tests.reference_sim.meshes import grid

REST, FACES = grid(4, 3)


def wave(frames: int = 5) -> Trajectory:
    phase = np.arange(frames)[:, None]
    positions = np.tile(REST, (frames, 1, 1))
    positions[:, :, 1] = 0.1 * np.sin(3 * REST[:, 0] + phase) / 3  # no float32 holds these
    return Trajectory(
        positions=positions,
        faces=FACES,
        times=np.arange(frames) / 30,
        frame_seconds=np.array([np.nan, *np.linspace(0.1, 0.2, frames - 1)]),
        status="stalled",
        reason="frame 3: no step lowers the energy",
        provenance={"dt_s": 1 / 30, "terms": {"strain": {"mu": 11.1}}, "list": [1, None, "two"]},
        frame_fields={"energy/strain": np.arange(frames) / 7, "iterations": np.arange(frames, dtype=float)},
    )


def assert_same(loaded: Trajectory, expected: Trajectory) -> None:
    assert loaded.positions.dtype == np.float64 and loaded.positions.shape == expected.positions.shape
    for name in ("positions", "faces", "times", "frame_seconds"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(expected, name), err_msg=name)
    assert (loaded.status, loaded.reason) == (expected.status, expected.reason)
    assert loaded.provenance == expected.provenance
    assert set(loaded.frame_fields) == set(expected.frame_fields)
    for name, values in expected.frame_fields.items():
        np.testing.assert_array_equal(loaded.frame_fields[name], values, err_msg=name)


@pytest.mark.parametrize("frames", [1, 2, 5])
def test_what_is_saved_is_loaded_to_the_last_bit(tmp_path, frames):
    wave(frames).save(tmp_path / "wave.vtkhdf")
    assert_same(Trajectory.load(tmp_path / "wave.vtkhdf"), wave(frames))
    wave(2).save(tmp_path / "wave.vtkhdf")  # replaces a file whole
    assert Trajectory.load(tmp_path / "wave.vtkhdf").dt == pytest.approx(1 / 30)
    assert np.isnan(wave(1).dt) and len(list(tmp_path.iterdir())) == 1


def test_a_trajectory_of_no_frames_is_saved_too(tmp_path):
    """A method that fails at once returns one; its reader finds no frames in it, instead of no file."""
    none = replace(wave(2), positions=np.nan * wave(2).positions).finite()
    none.save(tmp_path / "none.vtkhdf")
    loaded = Trajectory.load(tmp_path / "none.vtkhdf")
    assert_same(loaded, none)
    assert loaded.positions.shape == (0, len(REST), 3)


def test_what_is_no_trajectory_is_named_with_its_path(tmp_path):
    with pytest.raises(TrajectoryError, match=r"absent\.vtkhdf: no such trajectory file"):
        Trajectory.load(tmp_path / "absent.vtkhdf")
    (tmp_path / "text.vtkhdf").write_text("not HDF5")
    with h5py.File(tmp_path / "other.vtkhdf", "w") as file:
        file["numbers"] = [1, 2, 3]
    for name in ("text", "other"):
        with pytest.raises(TrajectoryError, match=rf"{name}\.vtkhdf: not a VTKHDF trajectory"):
            Trajectory.load(tmp_path / f"{name}.vtkhdf")


def vtk_frames(path) -> tuple[list[float], list[np.ndarray], list[np.ndarray]]:
    """Times, points and faces of every step, read by VTK's own reader."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOHDF import vtkHDFReader

    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    times, points, faces = [], [], []
    for step in range(reader.GetNumberOfSteps()):
        reader.SetStep(step)
        reader.Update()
        mesh = reader.GetOutputDataObject(0)
        assert mesh.GetClassName() == "vtkPolyData" and mesh.GetNumberOfPolys() == len(FACES)
        assert mesh.GetNumberOfCells() == len(FACES)
        offsets = vtk_to_numpy(mesh.GetPolys().GetOffsetsArray())
        assert offsets.tolist() == list(range(0, 3 * len(FACES) + 1, 3))
        times.append(reader.GetTimeValue())
        points.append(vtk_to_numpy(mesh.GetPoints().GetData()).copy())
        faces.append(vtk_to_numpy(mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3).copy())
    return times, points, faces


def test_vtk_steps_through_time_with_the_right_points(tmp_path):
    expected = wave(5)
    expected.save(tmp_path / "wave.vtkhdf")
    times, points, faces = vtk_frames(tmp_path / "wave.vtkhdf")
    assert times == pytest.approx(expected.times.tolist(), rel=1e-15)
    for k in range(5):
        assert points[k].dtype == np.float64
        np.testing.assert_array_equal(points[k], expected.positions[k])
        np.testing.assert_array_equal(faces[k], FACES)


def test_point_cache_by_its_bytes(tmp_path):
    positions, faces = grid(2, 1)
    moving = np.stack([positions, positions + 0.1, positions + 0.2])
    trajectory = Trajectory(moving, faces, np.arange(3) / 30, np.zeros(3))
    cache, mesh = write_point_cache(tmp_path / "sheet.pc2", trajectory)
    data = cache.read_bytes()
    assert data[:12] == b"POINTCACHE2\0"
    assert struct.unpack("<iiffi", data[12:32]) == (1, 6, 0.0, 1.0, 3)
    samples = np.frombuffer(data[32:], dtype="<f4").reshape(3, 6, 3)
    np.testing.assert_array_equal(samples, moving.astype(np.float32))
    np.testing.assert_array_equal(read_point_cache(cache), samples)
    surface = read_mesh(mesh)
    np.testing.assert_array_equal(surface.faces, faces)
    np.testing.assert_allclose(surface.positions, positions, atol=1e-9)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["sheet.obj", "sheet.pc2"]
    with pytest.raises(ValueError, match=r"ends in \.pc2"):
        write_point_cache(tmp_path / "sheet.abc", trajectory)
