"""A roll-out written for other programs: read back, it has the run's vertices, faces and times."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from benchmarks.results.run_folder import RunFolder
from reference_sim import Trajectory
from reference_sim.point_cache import read_point_cache
from reports import export
from tests.reports.report_folder import row, run_folder, sheet, write_mesh

SCENE = "tshirt/walk"


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> RunFolder:
    """A simulation, a network of two seeds, one that diverged, and a body."""
    rows = [row(SCENE, "simulation"), *(row(SCENE, "snug", seed=seed) for seed in (0, 1))]
    rows += [row(SCENE, "pbns"), row(SCENE, "supervised"), row("tshirt/jump", "snug")]
    folder = run_folder(tmp_path_factory.mktemp("run"), rows)
    body, faces = sheet(-0.05)
    write_mesh(folder.trajectory_path(SCENE, "body"), body, faces, {})
    for number, (method, seed) in enumerate((("simulation", 0), ("snug", 0), ("snug", 1), ("pbns", 0))):
        cloth, faces = sheet(0.1 * number)
        cloth += 0.01 * np.arange(len(cloth))[:, None, None]
        if method == "pbns":
            cloth[3:] = np.nan
        write_mesh(folder.trajectory_path(SCENE, method, seed), cloth, faces, {})
    return folder


def written(run, path, *more) -> int:
    return export.main([str(run.path), "--scene", SCENE, "--method", "snug", "-o", str(path), *more])


def truth(run, method="snug", seed=0) -> Trajectory:
    return Trajectory.load(run.trajectory_path(SCENE, method, seed))


def read_obj(path):
    lines = [line.split() for line in path.read_text().splitlines()]
    vertices = np.array([fields[1:] for fields in lines if fields[0] == "v"], dtype=float)
    return vertices, np.array([fields[1:] for fields in lines if fields[0] == "f"], dtype=int) - 1


def test_point_caches_of_garment_and_body_have_their_meshes_beside_them(run, tmp_path, capsys):
    assert written(run, tmp_path / "x.pc2", "--seed", "1") == 0
    assert "vertices keep their order" in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {"x.pc2", "x.obj", "x_body.pc2", "x_body.obj"}
    for name, mesh in (("x", truth(run, seed=1)), ("x_body", truth(run, "body"))):
        assert read_point_cache(tmp_path / f"{name}.pc2") == pytest.approx(mesh.positions, abs=1e-7)
        vertices, faces = read_obj(tmp_path / f"{name}.obj")
        assert vertices == pytest.approx(mesh.positions[0], abs=1e-7) and np.array_equal(faces, mesh.faces)


def test_a_folder_has_a_file_for_each_frame(run, tmp_path):
    assert written(run, tmp_path / "frames") == 0
    mesh = truth(run)
    names = {f"{what}_{k:04d}.obj" for what in ("garment", "body") for k in range(mesh.frames)}
    assert {path.name for path in (tmp_path / "frames").iterdir()} == names
    vertices, faces = read_obj(tmp_path / "frames" / "garment_0004.obj")
    assert vertices == pytest.approx(mesh.positions[4], abs=1e-7) and np.array_equal(faces, mesh.faces)


def test_frames_that_are_not_finite_are_left_out_of_garment_and_body(run, tmp_path):
    arguments = [str(run.path), "--scene", SCENE, "--method", "pbns", "-o", str(tmp_path / "x.pc2")]
    assert export.main(arguments) == 0
    assert len(read_point_cache(tmp_path / "x.pc2")) == len(read_point_cache(tmp_path / "x_body.pc2")) == 3


def uneven(run) -> dict[str, Trajectory]:
    """Times as of a long roll-out of which not all frames are kept."""
    times = np.array([0.0, 1.0, 2.0, 30.0, 31.0]) / 30.0
    return {"garment": dataclasses.replace(truth(run), times=times), "body": truth(run, "body")}


def test_alembic_has_the_same_points_and_times(run, tmp_path):
    abc = pytest.importorskip("alembic3d.Abc", reason="the extra [alembic] is not installed")
    from alembic3d.AbcGeom import IPolyMesh

    path, meshes = tmp_path / "x.abc", uneven(run)
    export.write(path, meshes)
    top = abc.IArchive(str(path)).getTop()
    for name, mesh in meshes.items():
        schema = IPolyMesh(top, name).getSchema()
        assert schema.getNumSamples() == mesh.frames
        for frame, time in enumerate(mesh.times):
            assert schema.getTimeSampling().getSampleTime(frame) == pytest.approx(time)
            sample = schema.getValue(abc.ISampleSelector(float(time)))
            points = np.array([(p.x, p.y, p.z) for p in sample.getPositions()])
            assert points == pytest.approx(mesh.positions[frame], abs=1e-7)
        assert set(sample.getFaceCounts()) == {3}
        turned = np.array(list(sample.getFaceIndices())).reshape(-1, 3)[:, ::-1]
        assert np.array_equal(turned, mesh.faces)


def test_usd_has_the_same_points_times_units_and_axis(run, tmp_path):
    usd = pytest.importorskip("pxr.Usd", reason="the extra [usd] is not installed")
    from pxr import UsdGeom

    path, meshes = tmp_path / "x.usdc", uneven(run)
    export.write(path, meshes)
    stage = usd.Stage.Open(str(path))
    assert UsdGeom.GetStageUpAxis(stage) == "Y" and UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert (stage.GetTimeCodesPerSecond(), stage.GetEndTimeCode()) == (30.0, 31.0)
    for name, mesh in meshes.items():
        prim = UsdGeom.Mesh.Get(stage, f"/roll_out/{name}")
        assert np.array_equal(np.array(prim.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3), mesh.faces)
        codes = prim.GetPointsAttr().GetTimeSamples()
        assert codes == pytest.approx(mesh.times * 30.0)
        for code, positions in zip(codes, mesh.positions):
            assert np.array(prim.GetPointsAttr().Get(code)) == pytest.approx(positions, abs=1e-7)


@pytest.mark.parametrize(
    ("change", "hint"),
    [
        (["--scene", "tshirt/run"], "no scene is called 'tshirt/run'; there are tshirt/walk, tshirt/jump"),
        (["--method", "snugg"], "no method in tshirt/walk is called 'snugg'; there are simulation, snug"),
        (["--seed", "7"], "no seed of snug in tshirt/walk is called '7'; there are 0, 1"),
        (["--method", "supervised"], "kept no such roll-out"),
        (["-o", "x.fbx"], "x.fbx: give a name that ends in .abc, .usdc or .pc2"),
        (["-o", "here"], "here: is there already"),
        (["-o", "here/mine.pc2"], "mine.obj, which is to lie beside it, is there already: name another"),
    ],
)
def test_what_cannot_be_written_is_one_line_and_status_2(run, tmp_path, monkeypatch, refused, change, hint):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "mine.obj").touch()
    assert refused(hint, written, run, "x.pc2", *change).startswith("reports.export: ")


@pytest.mark.parametrize(("ending", "extra"), [(".abc", "alembic"), (".usdc", "usd")])
def test_a_package_that_is_not_there_is_named_by_its_extra(run, tmp_path, monkeypatch, capsys, ending, extra):
    writer, _, extra_name = export.ARCHIVES[ending]
    monkeypatch.setitem(export.ARCHIVES, ending, (writer, "no_such_package", extra_name))
    assert written(run, tmp_path / f"x{ending}") == 2
    assert f"pip install 'neural-garment-benchmark[{extra}]'" in capsys.readouterr().err


def test_a_roll_out_that_fails_to_be_written_leaves_nothing(run, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("reference_sim.point_cache.write_obj", full)
    with pytest.raises(OSError, match="No space"):
        export.write(tmp_path / "frames", {"garment": truth(run)})
    assert list(tmp_path.iterdir()) == []
