"""Garment on a body: triangles, named openings, and per vertex the body vertex and skinning weights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import igl
import numpy as np
from numpy.typing import ArrayLike

from reference_sim.cloth import Cloth
from reference_sim.geometry.closest_point import FaceSearch
from reference_sim.geometry.topology import Array, Index, boundary_loops
from reference_sim.material import Material
from snug.body.parametric_body import Body
from snug.body.skeleton import JOINT_NAMES
from snug.garments.implicit_surface import joint_position, skin_following

SHAPE_SMOOTHING = 10  # rounds over a shape's displacement, which jumps from leg to leg
# Rounds over the weights at 1000 vertices of cloth between the thighs: there it follows neither.
SKIRT_SMOOTHING = 60


class GarmentError(ValueError):
    """A garment that cannot be made or read as asked; the message names the cause and the remedy."""


@dataclass(frozen=True, eq=False)
class Garment:
    """A garment on the unposed body. Arrays are not to be written to.

    Attributes:
        name: of the template or file.
        rest_positions: (V,3) [m].
        faces: (F,3), outward.
        body_vertices: (V,), the nearest body vertex among those it may follow.
        skinning_weights: (V,24), those of that vertex, smoothed where cloth hangs between the legs; rows
            sum to one.
        loops: name ("neck", "left_sleeve", "right_sleeve", "left_armhole", "right_armhole", "hem",
            "waist", "left_leg", "right_leg") -> boundary vertices in order along the faces' winding,
            front-most first.
        pins: (P,), ascending: vertices that the body carries, of a waistband, since contact without
            friction does not hold it.
        material: of the cloth.
        rest_uv: (F,3,2) [m] of the faces' corners, the flat rest state of a garment that has one; else
            rest_positions is its rest shape too. Areas, masses and hinges all come from one of the two.
    """

    name: str
    rest_positions: Array
    faces: Index
    body_vertices: Index
    skinning_weights: Array
    loops: Mapping[str, Index] = field(default_factory=dict)
    pins: Index = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    material: Material = field(default_factory=Material)
    rest_uv: Array | None = None

    def __post_init__(self) -> None:
        """Raise GarmentError for weights that skin nothing or too much."""
        weights, count = self.skinning_weights, len(self.rest_positions)
        if weights.shape != (count, 24) or not np.allclose(weights.sum(axis=1), 1.0, atol=1e-4):
            raise GarmentError(f"{self.name}: skinning_weights: give ({count}, 24), rows that sum to one")

    def cloth(self, material: Material | None = None) -> Cloth:
        """Return the rest state of simulator, loss and metrics, with the garment's own material or another.

        Raises MeshError for a mesh that cannot be simulated.
        """
        return Cloth(
            self.rest_positions,
            self.faces,
            material or self.material,
            pins=self.pins,
            rest_uv=self.rest_uv,
        )

    @property
    def hem(self) -> Index:
        """Vertices (n,) of the hem, in order; of trousers those of both legs; else all that are free."""
        if "hem" in self.loops or not self.loops.keys() >= LEGS:
            free = np.setdiff1d(np.arange(len(self.rest_positions)), self.pins)
            return self.loops.get("hem", free)
        return np.concatenate([self.loops["left_leg"], self.loops["right_leg"]])

    def pin_positions(
        self, body: Body, poses: Array, translations: Array, betas: ArrayLike | None = None
    ) -> Array:
        """Return the positions (T,P,3) [m] of the pins on the posed body, see `Body.vertices`."""
        if not len(self.pins):
            return np.empty((len(poses), 0, 3))
        transforms = body.transforms(poses, translations, betas)
        blended = np.einsum("pj,tjab->tpab", self.skinning_weights[self.pins], transforms)
        rest = self.rest_for(body, betas)[self.pins]
        return np.einsum("tpab,pb->tpa", blended[..., :3], rest) + blended[..., 3]

    def rest_for(self, body: Body, betas: ArrayLike | None) -> Array:
        """Return rest positions (V,3) [m] on the body of shape `betas`: vertices move as the skin below them.

        The displacement of the nearest body vertex, smoothed over the garment.
        """
        if betas is None:
            return self.rest_positions.copy()
        displacement = (body.rest_vertices(betas) - body.template)[self.body_vertices]
        return self.rest_positions + smooth_weights(displacement, self.faces, SHAPE_SMOOTHING)


def smooth_weights(values: ArrayLike, faces: Index, iterations: int) -> Array:
    """Average values (V,K), as skinning weights, `iterations` times, each vertex with its neighbours' mean.

    Half the vertex, half the mean (uniform Laplacian): rows keep their sum and stay non-negative.

    >>> smooth_weights([[1.0], [0.0], [0.0]], np.array([[0, 1, 2]]), 1).ravel().tolist()
    [0.5, 0.25, 0.25]
    """
    smooth = np.asarray(values, dtype=np.float64)
    neighbours = igl.adjacency_matrix(faces).astype(np.float64).tocsr()
    degree = np.asarray(neighbours.sum(axis=1))
    for _ in range(iterations):
        smooth = 0.5 * smooth + 0.5 * (neighbours @ smooth) / degree
    return smooth


NEVER = ("head", "left_wrist", "right_wrist", "left_hand", "right_hand", "left_foot", "right_foot")
INSIDE = 0.5  # winding number of the garment around what it encloses
# Share of a limb's skin within a garment, from which the garment follows that limb.
COVERED = 0.05
# Depth below the hip joints from where one tube around both legs follows neither.
BELOW_HIPS = 0.1  # [m]


def find_weights(body: Body, positions: Array, faces: Index) -> tuple[Array, Index]:
    """Return skinning weights (V,24) of a garment on the unposed body, and its nearest vertices (V,).

    They are blended from the three corners of the closest face of the skin, among the limbs that the
    garment encloses. One tube around both legs is smoothed below the hips as a skirt is.
    """
    followed = skin_following(body, enclosed_limbs(body, positions, faces))
    skin = body.faces[followed[body.faces].all(axis=1)]
    search = FaceSearch(skin, body.template[skin].mean(axis=1))
    search.refit(body.template)
    closest = search.nearest(positions)
    corners = skin[closest.faces]
    nearest = corners[np.arange(len(corners)), closest.barycentric.argmax(axis=1)]
    weights = np.einsum("va,vaj->vj", closest.barycentric, body.skinning_weights[corners])
    hip, middle = joint_position(body, "left_hip")[1], joint_position(body, "pelvis")[0]
    drop = hip - positions[:, 1]
    lowest = faces[(drop[faces] > 0.5 * drop.max()).all(axis=1)]
    is_left = positions[lowest, 0] > middle
    if drop.max() > BELOW_HIPS and (is_left.any(axis=1) & ~is_left.all(axis=1)).any():
        # As far as a template's skirt, whatever the size of the triangles.
        smooth = smooth_weights(weights, faces, round(SKIRT_SMOOTHING * len(positions) / 1000))
        share = np.clip(drop / BELOW_HIPS, 0.0, 1.0)[:, None]
        weights = (1 - share) * weights + share * smooth
    return weights, nearest


def enclosed_limbs(body: Body, positions: Array, faces: Index) -> tuple[str, ...]:
    """Return the joints whose skin lies within the garment in part; never those of head, hands and feet.

    Within is where the generalised winding number of the open mesh is above a half. For a garment that
    encloses nothing, as a cape: all of them.
    """
    winding = igl.fast_winding_number(
        np.asfortranarray(positions), np.asfortranarray(faces), np.asfortranarray(body.template)
    )
    inside = np.abs(winding).ravel() > INSIDE
    limbs = {name: skin_following(body, (name,)) for name in JOINT_NAMES if name not in NEVER}
    limbs = {name: skin for name, skin in limbs.items() if skin.any()}
    return tuple(name for name, skin in limbs.items() if inside[skin].mean() > COVERED) or tuple(limbs)


ARMHOLE = 0.2  # share of the upper arm, beyond which an opening is a sleeve
# share of a hip joint's distance from the middle, beyond which an opening is a sleeve or a leg
MIDDLE = 0.5
LEGS = {"left_leg", "right_leg"}
ORDER = ("neck", "waist", "left_sleeve", "right_sleeve", "left_armhole", "right_armhole", "left_leg",
         "right_leg", "hem")  # fmt: skip


def name_openings(body: Body, positions: Array, faces: Index) -> dict[str, Index]:
    """Return the boundary vertices of each opening by its name, along the winding, front-most first.

    The garment (V,3) [m], (F,3) lies on the unposed body. An opening beside the middle is a leg below the
    hips and a sleeve above; a sleeve that ends near the shoulder's joint is an armhole. In the
    middle the highest is the neck, above half the way from pelvis to neck, or else the waist, and the
    lowest the hem; one that is alone there is the hem, unless there are legs or it is all above the
    garment's mean height. The lowest of all is called hem too where no other is, but for two legs, waist
    and neck. Others are opening_1 and so on.

    Raises:
        ValueError: loops touch.
    """
    loops = [np.roll(loop, -int(np.argmax(positions[loop, 2]))) for loop in boundary_loops(faces)]
    if not loops:
        return {}
    centres = [positions[loop].mean(axis=0) for loop in loops]
    heights = [centre[1] for centre in centres]
    openings: dict[str, int] = {}
    middle = []
    # The longest loop comes first: of two with one claim it has the name, a slit or a buttonhole has not.
    for number, centre in enumerate(centres):
        if side := _name_beside(body, centre):
            openings.setdefault(side, number)
        else:
            middle.append(number)
    if middle:
        middle.sort(key=lambda number: -heights[number])
        half_way = 0.5 * (joint_position(body, "pelvis")[1] + joint_position(body, "neck")[1])
        top = "neck" if heights[middle[0]] > half_way else "waist"
        above = positions[loops[middle[0]], 1].min() > positions[faces, 1].mean()
        if len(middle) > 1:
            openings |= {top: middle[0], "hem": middle[-1]}
        else:
            openings[top if above or openings.keys() & LEGS else "hem"] = middle[0]
    lowest = int(np.argmin(heights))
    if not openings.keys() >= LEGS and lowest not in (openings.get("waist"), openings.get("neck")):
        openings.setdefault("hem", lowest)
    rest = (number for number in range(len(loops)) if number not in openings.values())
    named = {name: loops[openings[name]] for name in ORDER if name in openings}
    return named | {f"opening_{count}": loops[number] for count, number in enumerate(rest, start=1)}


def waist_pins(body: Body, positions: Array, faces: Index) -> Index:
    """Return the pins (P,) of a garment (V,3) [m], (F,3): waists of pieces without neck and sleeves.

    Contact without friction does not hold these. Raises GarmentError where nothing does.
    """
    pins = [np.empty(0, dtype=np.int64)]
    pieces = piece_of_faces(faces)
    for piece in (faces[pieces == number] for number in range(pieces.max() + 1)):
        loops = name_openings(body, positions, piece)
        if loops.keys() & {"neck", "left_sleeve", "right_sleeve"}:
            continue
        pins.append(loops.get("waist", pins[0]))
        above = positions[piece, 1].max() >= joint_position(body, "left_shoulder")[1]
        if not (len(pins[-1]) or above or loops.keys() & {"left_armhole", "right_armhole"}):
            place = ", ".join(f"{x:.2f}" for x in positions[piece].mean(axis=(0, 1)))
            raise GarmentError(
                f"nothing holds its piece at ({place}) m: it ends below the shoulders, with no waist among "
                f"its openings ({', '.join(loops)}): join it, or cut it open where the body comes out above"
            )
    return np.sort(np.concatenate(pins))


def _name_beside(body: Body, centre: Array) -> str:
    """Return the name of the sleeve or leg that ends there, or empty in the middle."""
    hip, shoulder = joint_position(body, "left_hip"), joint_position(body, "left_shoulder")
    middle = joint_position(body, "pelvis")[0]
    out = abs(centre[0] - middle)
    if out < MIDDLE * (hip[0] - middle):
        return ""
    arm = np.linalg.norm(joint_position(body, "left_elbow") - shoulder)
    beyond = out > shoulder[0] - middle + ARMHOLE * arm
    limb = "leg" if centre[1] <= hip[1] else "sleeve" if beyond else "armhole"
    return f"{'left' if centre[0] > middle else 'right'}_{limb}"


def piece_of_faces(faces: Index) -> Index:
    """Return the number (F,) of the piece that each face (F,3) is of, from 0; pieces share no vertex.

    >>> piece_of_faces(np.array([[0, 1, 2], [5, 6, 7], [2, 1, 3]])).tolist()
    [0, 1, 0]
    """
    return np.unique(igl.vertex_components(faces)[faces[:, 0]], return_inverse=True)[1]
