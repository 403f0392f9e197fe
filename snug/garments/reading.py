"""From a mesh file to a garment: what is found on the way, and what cannot be used.

Each finding is said once, here: `python -m snug.check` lists all, whoever reads a garment is refused by the
first that cannot be used.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from reference_sim.cloth import Cloth, MeshError
from reference_sim.files.mesh_files import METRES, Surface, read_mesh, to_metres_y_up
from reference_sim.files.uv_chart import flattened, join_seams, rest_chart, stretches
from reference_sim.geometry.topology import corner_angles
from reference_sim.material import Material, MaterialError
from snug.body.parametric_body import Body
from snug.garments.fit import DressForm, body_as_in_file, find_placement, pose_in_file
from snug.garments.garment import Garment, GarmentError, smooth_weights
from snug.garments.openings import name_openings
from snug.garments.options import OPTION, GarmentFile
from snug.garments.weights import GarmentWeights, find_weights, read_authored_weights

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SHARP = 5.0  # [degrees] below which an angle slows the simulation down
SLIVERS = "slivers slow the simulation down: remesh"
LOOSE = "what is not sewn on falls off: merge the vertices along its seams"
NOTED = ("ok", "note")
UNPOSED_SMOOTHING = 20  # rounds over borrowed weights at 1000 vertices, as recipes have it
OUTWARD = 0.5  # share of the area that looks away from the skin, below which a garment is inside out


@dataclass(frozen=True)
class Finding:
    """What was found about one matter. level: "ok", "note" or "unusable"; a remedy where there is one."""

    matter: str
    says: str
    remedy: str = ""
    level: str = "ok"


@dataclass
class Examination:
    """What a file came to, as far as it could be read; garment: None where something cannot be used."""

    findings: list[Finding] = field(default_factory=list)
    surface: Surface | None = None
    distances: Array | None = None
    garment: Garment | None = None

    def find(self, matter: str, says: str, remedy: str = "", level: str = "ok") -> None:
        self.findings.append(Finding(matter, says, remedy, level))

    @property
    def unusable(self) -> list[Finding]:
        return [finding for finding in self.findings if finding.level == "unusable"]


def read_garment(file: GarmentFile, body: Body) -> Garment:
    """The garment of a file on the unposed body. Raises GarmentError: file, what is wrong, remedy."""
    reading = examine_file(file, DressForm(body), body)
    for finding in reading.unusable:
        raise GarmentError(f"{file.path}: {finding.says}" + f": {finding.remedy}" * bool(finding.remedy))
    assert reading.garment is not None
    return reading.garment


def examine_file(file: GarmentFile, wearer: DressForm, body: Body) -> Examination:
    """Everything that is to be said of a file. Raises GarmentError where it cannot be read at all."""
    try:
        raw = read_mesh(file.path)
        material = Material.from_file(file.material) if file.material else Material()
    except (MeshError, MaterialError) as error:
        raise GarmentError(str(error)) from None
    authored = read_authored_weights(file.path, raw.vertex_data, file.weights, len(raw.positions))
    positions = to_metres_y_up(raw.positions, units=file.units, up=file.up) + np.asarray(file.shift)
    surface, kept, _ = join_seams(replace(raw, positions=positions))
    reading = Examination(surface=surface)
    _of_size(reading, raw, surface, kept)
    fits = _of_place(reading, file, wearer, raw)
    chart = _of_rest(reading, file, surface)
    surface = _of_winding(reading, surface, wearer) if fits else surface
    if chart is not None and surface is not reading.surface:
        chart = chart[:, ::-1]
    reading.surface = surface
    sound = _of_mesh(reading, surface, chart)
    if sound and fits and not reading.unusable:
        own = None if authored is None else authored[kept]
        reading.garment = _dressed(reading, file, body, surface, chart, material, own)
    return reading


def _of_size(reading: Examination, raw: Surface, surface: Surface, kept: Index) -> None:
    quads = f", {raw.quads} quads cut in two" if raw.quads else ""
    reading.find("mesh", f"{len(surface.positions)} vertices, {len(surface.faces)} triangles{quads}")
    if doubled := len(raw.positions) - len(kept):
        reading.find("doubled vertices", f"{doubled} joined with another at the same place", level="note")


def _of_place(reading: Examination, file: GarmentFile, wearer: DressForm, raw: Surface) -> bool:
    """Whether the garment lies on the body."""
    assert reading.surface is not None
    positions = reading.surface.positions
    fit = wearer.fit(positions)
    problem = wearer.problem(positions, fit)
    reading.distances = fit.distances
    size = " x ".join(f"{length:.2f}" for length in np.ptp(positions, axis=0))
    if not problem:
        level = "note" if fit.depth > 0 else "ok"
        reading.find("size", f"{size} m with units {file.units}, up {file.up}")
        reading.find("place", f"{fit.below:.1%} of the vertices below the skin, the deepest by "
                     f"{1e3 * fit.depth:.1f} mm", level=level)  # fmt: skip
        return True
    mend = find_placement(wearer, raw.positions, file.units, file.up, np.asarray(file.shift))
    remedy = "move it onto the unposed body, facing +z with y up"
    if mend:
        shift = ",".join(f"{value:g}" for value in mend.shift)
        words = {"units": (mend.units, file.units), "up": (mend.up, file.up)}
        given = [f"{OPTION}{name} {found}" for name, (found, was) in words.items() if found != was]
        given += [f"{OPTION}shift={shift}"] if mend.shift != file.shift else []
        remedy = " ".join(given)
    reading.find("place", f"does not lie on the body ({size} m, {problem})", remedy, "unusable")
    return False


def _of_rest(reading: Examination, file: GarmentFile, surface: Surface) -> Array | None:
    """The chart (F,3,2) [m] where it is the rest shape."""
    asked = file.rest == "uv"
    if surface.uv is None and not asked:
        reading.find("rest", "the mesh itself; the file has no UV")
        return None
    try:
        scale = METRES[file.units] if file.uv_scale is None else file.uv_scale
        chart = rest_chart(surface, scale, prefix=OPTION)
    except MeshError as error:
        says, _, remedy = str(error).partition(": ")
        if asked:
            reading.find("rest", says, remedy, "unusable")
        else:
            reading.find("rest", f"the mesh itself; {says}")
        return None
    off = np.abs(stretches(surface.positions[surface.faces], chart) - 1).max(axis=1)
    most = f"99 % of it by less than {np.quantile(off, 0.99):.0%}"
    strain = f"stretched by {np.median(off):.1%} on the mesh (median; {most})"
    reading.find("rest", f"the UV chart, {strain}" if asked else f"the mesh itself; its UV chart is {strain}")
    return chart if asked else None


def _of_winding(reading: Examination, surface: Surface, wearer: DressForm) -> Surface:
    """The surface, turned where it is inside out."""
    corners = surface.positions[surface.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    planes = wearer.skin.planes(corners.mean(axis=1), 0)
    areas = np.linalg.norm(normals, axis=1)
    outward = float(areas[np.einsum("fi,fi->f", normals, planes.normals) > 0].sum() / areas.sum())
    if outward > OUTWARD:
        reading.find("winding", f"outward, {outward:.0%} of the area")
        return surface
    reading.find("winding", "inside out", "turned as it is read", "note")
    uv = None if surface.uv is None else surface.uv[:, ::-1]
    return replace(surface, faces=np.ascontiguousarray(surface.faces[:, ::-1]), uv=uv)


def _of_mesh(reading: Examination, surface: Surface, chart: Array | None) -> bool:
    """Whether the mesh can be simulated: one or several sheets, consistently wound."""
    same = np.sort(surface.faces, axis=1)
    _, first, count = np.unique(same, axis=0, return_index=True, return_counts=True)
    if (count > 1).any():
        pair = np.flatnonzero((same == same[first[np.argmax(count > 1)]]).all(axis=1))
        reading.find(
            "faces", f"triangles {pair[0]} and {pair[1]} are the same", "remove one of each", "unusable"
        )
        return False
    try:
        Cloth(surface.positions, surface.faces, rest_uv=chart)
    except MeshError as error:
        says, _, remedy = str(error).partition(": ")
        reading.find("faces", says, remedy, "unusable")
        return False
    angle = float(np.degrees(corner_angles(surface.positions, surface.faces).min()))
    sharp, pieces = angle < SHARP, _pieces(surface)
    reading.find("triangles", f"smallest angle {angle:.1f} degrees", SLIVERS * sharp, NOTED[sharp])
    reading.find("pieces", str(pieces), LOOSE * (pieces > 1), NOTED[pieces > 1])
    return True


def _pieces(surface: Surface) -> int:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    a, b = surface.faces[:, [0, 1]].T, surface.faces[:, [1, 2]].T
    ends = np.concatenate([a, b], axis=1)
    graph = coo_array((np.ones(ends.shape[1]), (ends[0], ends[1])), shape=(len(surface.positions),) * 2)
    return int(connected_components(graph, directed=False)[0])


def _dressed(
    reading: Examination,
    file: GarmentFile,
    body: Body,
    surface: Surface,
    chart: Array | None,
    material: Material,
    authored: Array | None,
) -> Garment | None:
    """The garment, its openings and what carries it; None where it has no opening.

    body: in T pose. The surface lies on it as its file has it: there openings and weights are found, and from
    there vertices are brought to the T pose by the inverse of their blended transforms. Its rest shape stays.
    """
    positions, faces, filed = surface.positions, surface.faces, body_as_in_file(body)
    try:
        loops = name_openings(filed, positions, faces)
    except ValueError as error:
        reading.find("openings", str(error), "separate them", "unusable")
        return None
    if not loops:
        reading.find(
            "openings", "none: the surface is closed", "cut where head and limbs come out", "unusable"
        )
        return None
    reading.find("openings", ", ".join(f"{name} ({len(loop)} vertices)" for name, loop in loops.items()))
    legs = "left_leg" in loops or "right_leg" in loops
    carried: GarmentWeights = find_weights(filed, positions, faces, legs=legs, authored=authored)
    how = "as they came with it" if carried.authored else "of the closest skin"
    reading.find("weights", f"{how}; encloses {', '.join(carried.followed)}")
    if body.arms_lowered is not None:
        chart = flattened(positions, faces) if chart is None else chart
        positions = _in_t_pose(body, positions, faces, carried)
        reading.find("pose", "made for lowered arms, brought to the T pose; its rest shape is as it was made")
    # What has no neck and no sleeves hangs from its waist, and contact without friction does not hold that.
    hangs = any(name in loops for name in ("neck", "left_sleeve", "right_sleeve"))
    pins = np.empty(0, dtype=np.int64) if hangs else np.sort(loops.get("waist", np.empty(0, dtype=np.int64)))
    if len(pins):
        reading.find("held", f"{len(pins)} vertices of the waist are carried by the body")
    return Garment(
        name=file.name, rest_positions=positions, faces=faces, body_vertices=carried.body_vertices,
        skinning_weights=carried.weights, loops=loops, pins=pins, material=material, rest_uv=chart,
        authored_weights=carried.authored,
    )  # fmt: skip


def _in_t_pose(body: Body, positions: Array, faces: Index, carried: GarmentWeights) -> Array:
    """Positions (V,3) [m], made for the body as its file has it, on the body in T pose."""
    weights = carried.weights
    if not carried.authored:
        weights = smooth_weights(weights, faces, round(UNPOSED_SMOOTHING * len(positions) / 1000))
    moved = body.transforms(pose_in_file(body)[None], np.zeros((1, 3)))[0]
    blended = np.einsum("vj,jab->vab", weights, moved)
    return np.linalg.solve(blended[..., :3], (positions - blended[..., 3])[..., None])[..., 0]
