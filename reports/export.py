"""python -m reports.export RUN: write a roll-out of a run and its body for programs that animate and render.

To simulate a whole scene elsewhere, see python -m benchmarks.export.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.results.run_folder import RunFolder
from reference_sim.command_line import Parser, command

if TYPE_CHECKING:
    from reference_sim.trajectory import Trajectory

EXAMPLES = """examples:
  python -m reports.export reports/runs/NAME --scene tshirt/kick --method snug -o kick.usdc
  python -m reports.export reports/runs/NAME --scene tshirt/kick --method simulation -o kick.abc
  python -m reports.export reports/runs/NAME --scene tshirt/kick --method snug --seed 2 -o kick.pc2
  python -m reports.export reports/runs/NAME --scene flag --method newton-4 -o flag_frames/
  python -m benchmarks.export tshirt/kick -o kick      another command: the scene, to simulate it elsewhere

  .abc    Alembic: meshes "garment" and "body"      needs pip install 'neural-garment-benchmark[alembic]'
  .usdc   USD: meshes /roll_out/garment and /body   needs pip install 'neural-garment-benchmark[usd]'
  .pc2    point caches NAME.pc2 and NAME_body.pc2, each with its .obj
  DIR/    garment_0000.obj, body_0000.obj, and so on, a file for each frame

Metres, y up, float32; time 0 is frame 0. Vertices and faces are those of the run in each frame and format.
exit status: 0 written; 2 the run has no such roll-out, or the file cannot be written: one line says why."""
ORDER = (
    "Blender: import each .obj with Split By Object and Split By Group off, so that its vertices keep their "
    "order, and add a Mesh Cache modifier with the .pc2 of the same name."
)
Meshes = dict[str, "Trajectory"]


def write_alembic(path: Path, meshes: Meshes) -> None:
    """Write a polygon mesh for each name, faces turned round: Alembic's wind clockwise seen from outside."""
    import imath
    import numpy as np
    from alembic3d.Abc import OArchive
    from alembic3d.AbcCoreAbstract import AcyclicFlag, TimeSampling, TimeSamplingType, TimeVector
    from alembic3d.AbcGeom import OPolyMesh, OPolyMeshSchemaSample

    archive = OArchive(str(path))
    for name, mesh in meshes.items():
        times = TimeVector()
        times.extend(mesh.times.tolist())  # any: of a long roll-out not all frames are kept
        sampling = TimeSampling(TimeSamplingType(AcyclicFlag.kAcyclic), times)
        schema = OPolyMesh(archive.getTop(), name).getSchema()
        schema.setTimeSampling(archive.addTimeSampling(sampling))
        turned = np.ascontiguousarray(mesh.faces[:, ::-1], dtype=np.int32)
        indices = imath.IntArrayFromBuffer(turned.ravel())
        counts = imath.IntArrayFromBuffer(np.full(len(turned), 3, dtype=np.int32))
        for points in mesh.positions.astype(np.float32):
            schema.set(OPolyMeshSchemaSample(imath.V3fArrayFromBuffer(points), indices, counts))


def write_usd(path: Path, meshes: Meshes) -> None:
    """Write a stage of metres with y up: a mesh for each name, its points at each frame."""
    import numpy as np
    from pxr import Usd, UsdGeom, Vt

    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/roll_out").GetPrim())
    rates = [1.0 / mesh.dt for mesh in meshes.values() if mesh.frames > 1]
    rate = round(rates[0], 6) if rates else 1.0
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(rate)
    stage.SetStartTimeCode(0.0)
    stage.SetEndTimeCode(max(round(rate * float(mesh.times[-1]), 6) for mesh in meshes.values()))
    for name, mesh in meshes.items():
        prim = UsdGeom.Mesh.Define(stage, f"/roll_out/{name}")
        prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(mesh.faces), 3, dtype=np.int32)))
        prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(mesh.faces.ravel().astype(np.int32)))
        points, extent = prim.CreatePointsAttr(), prim.CreateExtentAttr()
        for time, frame in zip(mesh.times * rate, mesh.positions.astype(np.float32)):
            code = Usd.TimeCode(round(float(time), 6))
            points.Set(Vt.Vec3fArray.FromNumpy(frame), code)
            extent.Set(Vt.Vec3fArray.FromNumpy(np.stack([frame.min(axis=0), frame.max(axis=0)])), code)
    stage.GetRootLayer().Save()


# Ending -> what writes it, the package that it takes, and the extra that brings it.
ARCHIVES: dict[str, tuple[Callable[[Path, Meshes], None], str, str]] = {
    ".abc": (write_alembic, "alembic3d", "alembic"),
    ".usdc": (write_usd, "pxr", "usd"),
}


def demand_writable(path: Path) -> None:
    """Raise ValueError for a name or an installation that cannot be written, before anything is read."""
    from importlib.util import find_spec

    from reference_sim.files.atomic_files import demand_new, demand_writable_folder

    if path.suffix in ARCHIVES:
        _, package, extra = ARCHIVES[path.suffix]
        if find_spec(package) is None:
            raise ValueError(f"{path}: needs pip install 'neural-garment-benchmark[{extra}]'")
    elif path.suffix not in (".pc2", ""):
        raise ValueError(f"{path}: give a name that ends in .abc, .usdc or .pc2, or a folder for .obj files")
    mesh = path.with_suffix(".obj")
    if path.suffix == ".pc2" and mesh.exists() and not path.exists():
        raise ValueError(f"{path}: {mesh.name}, which is to lie beside it, is there already: name another")
    if path.suffix != "" and path.is_dir():
        raise ValueError(f"{path}: is a folder; name a file")
    if path.suffix == "":
        demand_new(path)
    demand_writable_folder(path.parent)


def write(path: Path, meshes: Meshes) -> None:
    """Write the meshes, each whole or not at all. Raises OSError."""
    from reference_sim.files.atomic_files import new_folder, replacing
    from reference_sim.point_cache import write_obj, write_point_cache

    if path.suffix in ARCHIVES:
        with replacing(path) as temporary:
            ARCHIVES[path.suffix][0](temporary, meshes)
    elif path.suffix == ".pc2":
        for name, mesh in meshes.items():
            write_point_cache(path if name == "garment" else path.with_stem(f"{path.stem}_{name}"), mesh)
    else:
        with new_folder(path) as part:
            for name, mesh in meshes.items():
                for frame, positions in enumerate(mesh.positions):
                    write_obj(part / f"{name}_{frame:04d}.obj", positions, mesh.faces)


@command("reports.export")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    parser = Parser(
        prog="python -m reports.export",
        description="Write a roll-out of a run, and the body, as Alembic, USD, PC2 or OBJ files.",
        epilog=EXAMPLES,
    )
    parser.add_argument("run_dir", metavar="RUN", help="folder of a run that has kept its trajectories")
    parser.add_argument("--scene", required=True, help="as in results.csv, say tshirt/kick")
    parser.add_argument("--method", required=True, help="as in results.csv, say snug")
    parser.add_argument("--seed", type=int, help="of a trained method (default: the first)")
    parser.add_argument(
        "-o", "--out", required=True, metavar="FILE", help="x.abc, x.usdc, x.pc2 or a new folder"
    )
    options = parser.parse_args(arguments)
    path = Path(options.out)
    demand_writable(path)
    from reports.run.selected_roll_outs import select_roll_outs  # heavy: not needed for --help

    selected = select_roll_outs(RunFolder(options.run_dir), options.scene, [options.method], options.seed)
    cloth = selected.cloths[options.method]
    meshes = {"garment": cloth} | ({"body": selected.body.first(cloth.frames)} if selected.body else {})
    write(path, meshes)
    sizes = ", ".join(f"{name} of {mesh.positions.shape[1]} vertices" for name, mesh in meshes.items())
    print(f"{path}: {cloth.frames} frames, {sizes}")
    if path.suffix == ".pc2":
        print(ORDER)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
