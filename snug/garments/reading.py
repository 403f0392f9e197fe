"""Read a garment from a mesh file: every finding on the way, and the garment itself.

`python -m snug.check` lists all findings, `read_garment` raises the first that makes the file unusable.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference_sim.cloth import Cloth, MeshError
from reference_sim.files.array_file import ArrayFileError, read_arrays
from reference_sim.files.mesh_files import METRES, Surface, read_mesh, to_metres_y_up
from reference_sim.files.uv_chart import join_seams, rest_chart, stretches
from reference_sim.geometry.topology import corner_angles
from reference_sim.material import Material, MaterialError
from snug.body.parametric_body import Body
from snug.file_options import GarmentFile
from snug.garments.fit import DressForm, find_placement
from snug.garments.garment import (
    Garment,
    GarmentError,
    find_weights,
    name_openings,
    open_seam,
    piece_of_faces,
)

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SHARP = 5.0  # [degrees] below which an angle slows the simulation down
OUTWARD = 0.5  # share of the area that looks away from the skin, below which a piece is inside out
SLIVERS = "slivers slow the simulation down: remesh"
LOOSE = "a piece that is not sewn on falls off: merge the vertices along its seams"
OK, NOTE, UNUSABLE = "ok", "note", "unusable"  # levels of a finding
AREAL_DENSITIES = 0.005, 5.0  # [kg/m^2], lightest and heaviest cloth: beyond them a unit is mistaken


class Finding(NamedTuple):
    """A fact about one matter of a file. level: OK, NOTE or UNUSABLE; a remedy where there is one."""

    matter: str
    text: str
    remedy: str = ""
    level: str = OK


@dataclass
class Examination:
    """Findings about a file, and its garment as far as it could be read.

    findings: in the order of reading. garment: None where something cannot be used.
    """

    findings: list[Finding] = field(default_factory=list)
    garment: Garment | None = None

    def add(self, matter: str, text: str, remedy: str = "", level: str = OK) -> None:
        """Add a finding."""
        self.findings.append(Finding(matter, text, remedy, level))

    @property
    def unusable(self) -> list[Finding]:
        """Findings that make the file unusable."""
        return [finding for finding in self.findings if finding.level == UNUSABLE]


def read_garment(file: GarmentFile | str | Path, body: Body) -> Garment:
    r"""Read and check a garment that was made for the unposed body.

    Args:
        file: a mesh file, or such a file with its units, axis, rest shape and material.
        body: in T pose, for which the garment was made.

    Raises:
        GarmentError: file, problem, remedy.

    >>> import tempfile, numpy as np
    >>> angle = 2 * np.pi * np.arange(40) / 40
    >>> ring = [f"{0.2 * np.sin(a):.4f} {{}} {0.16 * np.cos(a) + 0.01:.4f}" for a in angle]
    >>> belt = ["v " + point.format(height) for height in (0.93, 0.97) for point in ring]
    >>> belt += [f"f {k + 1} {(k + 1) % 40 + 1} {(k + 1) % 40 + 41} {k + 41}" for k in range(40)]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "belt.obj").write_text("\n".join(belt))
    ...     garment = read_garment(Path(folder, "belt.obj"), Body.load())
    >>> garment.name, garment.rest_positions.shape, list(garment.loops)
    ('belt', (80, 3), ['waist', 'hem'])
    """
    file = file if isinstance(file, GarmentFile) else GarmentFile(path=Path(file))
    examination = examine_file(file, DressForm(body))
    for finding in examination.unusable:
        raise GarmentError(f"{file.path}: {finding.text}" + f": {finding.remedy}" * bool(finding.remedy))
    assert examination.garment is not None
    return examination.garment


def examine_file(file: GarmentFile, form: DressForm) -> Examination:
    """Return all findings about a file on a body. Raises GarmentError where it cannot be read at all."""
    try:
        raw = read_mesh(file.path)
        material = Material.from_file(file.material) if file.material else Material()
    except (MeshError, MaterialError) as error:
        raise GarmentError(str(error)) from None
    authored = read_weights(file.weights, len(raw.positions)) if file.weights.is_file() else None
    positions = to_metres_y_up(raw.positions, units=file.units, up=file.up) + np.asarray(file.shift)
    surface, kept = join_seams(replace(raw, positions=positions))
    examination = Examination()
    quads = f", {raw.quads} quads cut in two" if raw.quads else ""
    examination.add("mesh", f"{len(surface.positions)} vertices, {len(surface.faces)} triangles{quads}")
    if doubled := len(raw.positions) - len(kept):
        examination.add("doubled vertices", f"{doubled} joined with another at the same place", level=NOTE)
    fits = _check_place(examination, file, form, raw, surface.positions)
    chart = _find_rest_shape(examination, file, surface)
    if fits:
        surface, chart = _wind_outward(examination, surface, chart, form)
    if file.material:
        _check_material(examination, material)
    sound = _check_mesh(examination, surface, chart)
    if sound and fits and not examination.unusable:
        authored = None if authored is None else authored[kept]
        examination.garment = _make_garment(examination, file, form, surface, chart, material, authored)
    return examination


def read_weights(path: Path, count: int) -> Array:
    """Return the authored skinning weights (count, 24) of a file, a row for each vertex of the mesh file.

    Raises:
        GarmentError: no array "weights", another shape, negative, or rows that do not sum to one.
    """
    try:
        weights = read_arrays(path, ("weights",)).get("weights", np.empty(0))
    except ArrayFileError as error:
        raise GarmentError(str(error)) from None
    joints = len(Body.joint_names)
    if weights.shape != (count, joints) or weights.dtype.kind not in "fiu":
        raise GarmentError(
            f"{path}: array 'weights' is {weights.dtype} {weights.shape}: expected numbers "
            f"({count}, {joints}), a row for each vertex of the mesh file"
        )
    weights = weights.astype(np.float64)
    sums = weights.sum(axis=1)
    good = np.isfinite(sums) & (weights.min(axis=1) >= -1e-6) & (np.abs(sums - 1) < 1e-3)
    for row in np.flatnonzero(~good)[:1]:
        raise GarmentError(
            f"{path}: weights of vertex {row} are negative or sum to {sums[row]:.4g} instead of 1"
        )
    return np.maximum(weights, 0.0) / np.maximum(weights, 0.0).sum(axis=1, keepdims=True)


def _check_place(
    examination: Examination, file: GarmentFile, form: DressForm, raw: Surface, positions: Array
) -> bool:
    """Return whether the garment (V,3) [m] lies on the body; where not, the finding says what mends it."""
    fit = form.fit(positions)
    problem = form.problem(positions, fit)
    size = " x ".join(f"{length:.2f}" for length in np.ptp(positions, axis=0))
    if not problem:
        depth = f"{fit.below:.1%} of the vertices below the skin, the deepest by {1e3 * fit.depth:.1f} mm"
        examination.add("size", f"{size} m with units {file.units}, up {file.up}")
        examination.add("place", depth, level=NOTE if fit.depth > 0 else OK)
        return True
    remedy = "move it onto the unposed body, facing +z with y up"
    if placement := find_placement(form, raw.positions, file.units, file.up, np.asarray(file.shift)):
        units, up, shift = placement
        changes = [f"units={units}"] * (units != file.units)
        changes += [f"up={up}"] * (up != file.up)
        numbers = " ".join(f"{value + 0.0:g}" for value in shift)
        changes += [f"shift={numbers}"] * (tuple(shift) != file.shift)
        remedy = f"give '{','.join([file.path.name, *changes])}'"
    examination.add("place", f"does not lie on the body ({size} m, {problem})", remedy, UNUSABLE)
    return False


def _find_rest_shape(examination: Examination, file: GarmentFile, surface: Surface) -> Array | None:
    """Return the chart (F,3,2) [m] where it is the rest shape."""
    asked = file.rest == "uv"
    if surface.uv is None and not asked:
        examination.add("rest", "the mesh itself; the file has no UV")
        return None
    try:
        scale = METRES[file.units] if file.uv_scale is None else file.uv_scale
        chart = rest_chart(surface, scale)
    except MeshError as error:
        problem, _, remedy = str(error).partition(": ")
        if asked:
            examination.add("rest", problem, remedy, UNUSABLE)
        else:
            examination.add("rest", f"the mesh itself; {problem}")
        return None
    off = np.abs(stretches(surface.positions[surface.faces], chart) - 1).max(axis=1)
    most = f"99 % of it by less than {np.quantile(off, 0.99):.0%}"
    strain = f"stretched by {np.median(off):.1%} on the mesh (median; {most})"
    shape = "the UV chart," if asked else "the mesh itself; its UV chart is"
    examination.add("rest", f"{shape} {strain}")
    return chart if asked else None


def _wind_outward(
    examination: Examination, surface: Surface, chart: Array | None, form: DressForm
) -> tuple[Surface, Array | None]:
    """Return surface and chart, with each piece turned that is inside out."""
    faces, corners = surface.faces, surface.positions[surface.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = np.einsum("fi,fi->f", normals, form.skin.planes(corners.mean(axis=1), 0).normals) > 0
    areas, pieces = np.linalg.norm(normals, axis=1), piece_of_faces(faces)
    turned = (np.bincount(pieces, areas * outward) <= OUTWARD * np.bincount(pieces, areas))[pieces]
    if not turned.any():
        examination.add("winding", f"outward, {areas[outward].sum() / areas.sum():.0%} of the area")
        return surface, chart
    some = f"{len(np.unique(pieces[turned]))} of {pieces.max() + 1} pieces " * (not turned.all())
    examination.add("winding", f"{some}inside out", "turned as it is read", NOTE)
    faces = np.ascontiguousarray(np.where(turned[:, None], faces[:, ::-1], faces))
    uv, chart = (
        corners if corners is None else np.where(turned[:, None, None], corners[:, ::-1], corners)
        for corners in (surface.uv, chart)
    )
    return replace(surface, faces=faces, uv=uv), chart


def _check_mesh(examination: Examination, surface: Surface, chart: Array | None) -> bool:
    """Return whether the mesh can be simulated: one or several sheets, consistently wound."""
    try:
        Cloth(surface.positions, surface.faces, rest_uv=chart)
    except MeshError as error:
        problem, _, remedy = str(error).partition(": ")
        examination.add("faces", problem, remedy, UNUSABLE)
        return False
    angle = float(np.degrees(corner_angles(surface.positions, surface.faces).min()))
    sharp, pieces = angle < SHARP, int(piece_of_faces(surface.faces).max()) + 1
    examination.add(
        "triangles", f"smallest angle {angle:.1f} degrees", SLIVERS * sharp, NOTE if sharp else OK
    )
    examination.add("pieces", str(pieces), LOOSE * (pieces > 1), NOTE if pieces > 1 else OK)
    seam, gap = open_seam(surface.positions, surface.faces)
    if len(seam):
        place = ", ".join(f"{x:.3f}" for x in surface.positions[seam[0]])
        text = f"{len(seam)} vertices of a seam lie up to {1e3 * gap:.2g} mm apart, one at ({place}) m"
        remedy = f"merge vertices closer than {1.1e3 * gap:.2g} mm; where a slit is meant, open it wider"
        examination.add("seams", text, remedy, UNUSABLE)
    return True


def _check_material(examination: Examination, material: Material) -> None:
    """Add what a material file says; a mass per area that no cloth has makes it unusable."""
    lightest, heaviest = AREAL_DENSITIES
    text = f"{material.areal_density:.3g} kg/m^2, {1e3 * material.thickness:.3g} mm thick"
    if lightest <= material.areal_density <= heaviest:
        examination.add("material", f"{text}, stiffness {material.membrane_modulus:.3g} N/m")
        return
    remedy = f"give thickness in m and density in kg/m^3; cloth has {lightest:g} to {heaviest:g} kg/m^2"
    examination.add("material", f"its material is {text}", remedy, UNUSABLE)


def _make_garment(
    examination: Examination,
    file: GarmentFile,
    form: DressForm,
    surface: Surface,
    chart: Array | None,
    material: Material,
    authored: Array | None,
) -> Garment | None:
    """Return the garment, its openings and its weights; None where it has no opening."""
    positions, faces = surface.positions, surface.faces
    try:
        loops = name_openings(form.body, positions, faces)
    except ValueError as error:
        examination.add("openings", str(error), "separate them", UNUSABLE)
        return None
    if not loops:
        remedy = "cut where head and limbs come out"
        examination.add("openings", "none: the surface is closed", remedy, UNUSABLE)
        return None
    examination.add("openings", ", ".join(f"{name} ({len(loop)} vertices)" for name, loop in loops.items()))
    legs = "left_leg" in loops or "right_leg" in loops
    weights, nearest, followed = find_weights(form.body, positions, faces, legs=legs, authored=authored)
    source = "of the closest skin" if authored is None else "as they came with it"
    examination.add("weights", f"{source}; encloses {', '.join(followed)}")
    # A garment without neck and sleeves hangs from its waist, and contact without friction does not hold it.
    hangs = any(name in loops for name in ("neck", "left_sleeve", "right_sleeve"))
    pins = np.empty(0, dtype=np.int64) if hangs else np.sort(loops.get("waist", np.empty(0, dtype=np.int64)))
    if len(pins):
        examination.add("held", f"{len(pins)} vertices of the waist are carried by the body")
    return Garment(
        name=file.name,
        rest_positions=positions,
        faces=faces,
        body_vertices=nearest,
        skinning_weights=weights,
        loops=loops,
        pins=pins,
        material=material,
        rest_uv=chart,
        authored_weights=authored is not None,
    )
