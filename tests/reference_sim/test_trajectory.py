"""The trajectory file: what goes in comes out, nothing half-written counts, and VTK itself reads it."""

from __future__ import annotations

import struct
from dataclasses import asdict, replace

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
        positions, FACES, np.arange(frames) / 30, np.array([np.nan, *np.linspace(0.1, 0.2, frames - 1)]),
        status="stalled", reason="frame 3: no step lowers the energy",
        provenance={"dt_s": 1 / 30, "terms": {"strain": {"mu": 11.1}}, "list": [1, None, "two"]},
        frame_fields={"energy/strain": np.arange(frames) / 7, "iterations": np.arange(frames, dtype=float)},
    )  # fmt: skip


def test_what_is_saved_is_loaded_to_the_last_bit(tmp_path):
    """Also a trajectory of no frames, which a method that fails at once returns."""
    none = replace(wave(2), positions=np.nan * wave(2).positions).finite()
    for expected in (wave(1), wave(5), none):
        expected.save(tmp_path / "wave.vtkhdf")  # replaces a file whole
        loaded = Trajectory.load(tmp_path / "wave.vtkhdf")
        assert loaded.positions.dtype == np.float64 and loaded.positions.shape == expected.positions.shape
        np.testing.assert_equal(asdict(loaded), asdict(expected))
    assert np.isnan(wave(1).dt) and len(list(tmp_path.iterdir())) == 1


def test_what_is_no_trajectory_is_named_with_its_path(tmp_path):
    (tmp_path / "text").write_text("not HDF5")
    with h5py.File(tmp_path / "other", "w") as file:
        file["numbers"] = [1, 2, 3]
    replace(wave(2), times=np.zeros(1), provenance={"dt": np.float32(1)}).save(tmp_path / "short")
    replace(wave(2), faces=FACES + 1).save(tmp_path / "faces")
    for name in ("absent", "text", "other", "short", "faces"):
        message = "no such" if name == "absent" else "not a VTKHDF"
        with pytest.raises(TrajectoryError, match=f"{name}: {message} trajectory"):
            Trajectory.load(tmp_path / name)


def test_vtk_steps_through_time_with_the_right_points(tmp_path):
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOHDF import vtkHDFReader

    expected = wave(5)
    expected.save(tmp_path / "wave.vtkhdf")
    reader = vtkHDFReader()
    reader.SetFileName(str(tmp_path / "wave.vtkhdf"))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == 5
    for step in range(5):
        reader.SetStep(step)
        reader.Update()
        mesh = reader.GetOutputDataObject(0)
        assert mesh.GetClassName() == "vtkPolyData" and mesh.GetNumberOfCells() == len(FACES)
        assert reader.GetTimeValue() == pytest.approx(expected.times[step], rel=1e-15)
        offsets, corners = mesh.GetPolys().GetOffsetsArray(), mesh.GetPolys().GetConnectivityArray()
        assert vtk_to_numpy(offsets).tolist() == list(range(0, 3 * len(FACES) + 1, 3))
        np.testing.assert_array_equal(vtk_to_numpy(corners).reshape(-1, 3), FACES)
        np.testing.assert_array_equal(vtk_to_numpy(mesh.GetPoints().GetData()), expected.positions[step])


def test_point_cache_by_its_bytes(tmp_path):
    trajectory = wave(3)
    cache, mesh = write_point_cache(tmp_path / "sheet.pc2", trajectory)
    data = cache.read_bytes()
    assert data[:12] == b"POINTCACHE2\0"
    assert struct.unpack("<iiffi", data[12:32]) == (1, len(REST), 0.0, 1.0, 3)
    samples = np.frombuffer(data[32:], dtype="<f4").reshape(3, len(REST), 3)
    np.testing.assert_array_equal(samples, trajectory.positions.astype(np.float32))
    np.testing.assert_array_equal(read_point_cache(cache), samples)
    surface = read_mesh(mesh)
    np.testing.assert_array_equal(surface.faces, FACES)
    np.testing.assert_allclose(surface.positions, trajectory.positions[0], atol=1e-9)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["sheet.obj", "sheet.pc2"]
