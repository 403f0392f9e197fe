"""Kinds of garments that are tailored by code, each to any body: their cuts, measures and ranges."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from snug.body.parametric_body import Body
from snug.garments.cuts import SEAM_CUT, CutPlane, armhole_cut, level_cut, neck_cut
from snug.garments.garment import SKIRT_SMOOTHING, Garment, GarmentError, name_openings, smooth_weights
from snug.garments.implicit_surface import SHIRT_BONES, build_surface, joint_position, legs_part
from snug.garments.meshing import mesh_garment, nearest_body_vertices

TSHIRT = "tshirt"  # the garment that a command takes where none is named

LONG_SLEEVE_BONES = (*SHIRT_BONES, "left_elbow", "right_elbow")
SKIRT_BONES = ("pelvis", "spine1", "left_hip", "right_hip")
TROUSER_BONES = (*SKIRT_BONES, "left_knee", "right_knee")
SMOOTHED_OVER = 0.1  # [m] about the hip joints: from borrowed weights to smoothed ones
TROUSER_SMOOTHING = 10  # at the crotch, borrowed weights jump from leg to leg
# Least and largest value, and unit, of what has the same range in all kinds.
RANGES = {
    "vertices": (100, 20_000, " vertices"),
    "ease": (0.0, 0.3, " m"),
    "clearance": (0.005, 0.05, " m"),
    "sleeve": (0.3, 0.9, " of the upper arm"),
    "rise": (0.14, 0.2, " m"),
    "length": (-0.05, 0.25, " m"),
    "strap": (0.04, 0.08, " m"),
    "flare": (0.0, 0.15, " m"),
}

Measures = Mapping[str, float]
Outline = tuple[dict[str, Any], list[CutPlane]]  # arguments of build_surface, and where the surface ends


@dataclass(frozen=True, eq=False, kw_only=True)
class GarmentTemplate:
    """A kind of garment, which `tailor` makes for a body.

    Attributes:
        name: as commands take it.
        measures: each measure of its cut and the default, see `tailor`.
        outline: function of body and measures that returns the arguments of build_surface, and the cuts.
        bones: whose skin it borrows weights from.
        smoothing: rounds over these weights at 1000 vertices, below the hip joints or, with a waistband,
            everywhere.
        ranges: least and largest value and unit of a measure, where they are not those of RANGES.

    >>> find_template("shorts").measures["length"]
    0.25
    """

    name: str
    measures: Measures
    outline: Callable[[Body, Measures], Outline]
    bones: Sequence[str] = SHIRT_BONES
    smoothing: int = 0
    ranges: Mapping[str, tuple[float, float, str]] = field(default_factory=dict)

    def tailor(self, body: Body, *, vertices: int = 1000, **measures: float) -> Garment:
        """Tailor this kind of garment to the unposed body in T pose, mirror-symmetric.

        A waistband, of skirt, trousers and shorts, is carried by the body.

        Args:
            body: that wears it.
            vertices: number of vertices, met within 1 %.
            measures: in place of defaults, of those that the kind has:
                ease: girth [m] beyond a garment that lies at `clearance`: of a shirt or dress at the
                waist and cuffs, of a skirt at the hips, of trousers and shorts at hips and legs;
                clearance: least distance [m] from the skin, over vertices, edge midpoints and centroids;
                sleeve: covered share of the upper arm, or of the whole arm for long sleeves;
                strap: width of the straps [m]; rise: waistband above the hip joints [m];
                length: hem below the hip joints [m]; of trousers and shorts the inseam, as a share of
                that from crotch to ankle;
                flare: how much further [m] the hem stands off than the waist, or a skirt's than the hips.

        Raises:
            GarmentError: a measure that the kind has not or that is out of range, or a body on which no
                sound mesh comes out.
        """
        if unknown := measures.keys() - self.measures.keys():
            names = ", ".join(["vertices", *self.measures])
            raise GarmentError(f"{min(unknown)}: no measure of a {self.name}: use {names}")
        cut = {**self.measures, **measures}
        for name, value in {"vertices": vertices, **cut}.items():
            low, high, unit = self.ranges.get(name) or RANGES[name]
            if not (np.isfinite(value) and low <= value <= high):
                raise GarmentError(
                    f"{name}={value}: a {self.name} can be tailored from {low:g} to {high:g}{unit}"
                )
        surface, cuts = self.outline(body, cut)
        try:
            sheet = build_surface(body, **surface, clearance=cut["clearance"])
            positions, faces = mesh_garment(body, sheet, cuts, vertices, cut["clearance"])
        except ValueError as error:
            raise GarmentError(f"{self.name}: {error}") from error
        loops = name_openings(body, positions, faces)
        nearest = nearest_body_vertices(body, positions, self.bones)
        weights = borrowed = body.skinning_weights[nearest]
        if self.smoothing:
            weights = smooth_weights(borrowed, faces, round(self.smoothing * vertices / 1000))
        if self.smoothing and "waist" not in loops:
            height = positions[:, 1] - joint_position(body, "left_hip")[1]
            share = np.clip(height / SMOOTHED_OVER + 0.5, 0.0, 1.0)[:, None]
            weights = share * borrowed + (1 - share) * weights
        pins = np.sort(loops.get("waist", np.empty(0, dtype=np.int64)))
        return Garment(self.name, positions, faces, nearest, weights, loops, pins)


def _sleeves(body: Body, cut: Measures, end: str = "left_elbow") -> Outline:
    """Outline a garment with two sleeves, a neck and a hem. Sleeves go from the shoulder towards `end`."""
    shoulder, tip = joint_position(body, "left_shoulder"), joint_position(body, end)
    hem = joint_position(body, "left_hip")[1] - cut["length"]
    cuff = shoulder[0] + cut["sleeve"] * (tip[0] - shoulder[0])
    neck = neck_cut(body, cut["clearance"])
    sleeve = CutPlane("left_sleeve", (1.0, 0.0, 0.0), (cuff, 0.0, 0.0))
    surface = {"hem": hem, "cuff": cuff, "top": neck.point[1] + 0.04, "ease": cut["ease"],
               "flare": cut.get("flare", 0.0)}  # fmt: skip
    return surface, [SEAM_CUT, level_cut("hem", hem, down=True), sleeve, neck]


def _armholes(body: Body, cut: Measures) -> Outline:
    """Outline a garment with two armholes, a neck and a hem."""
    hem = joint_position(body, "left_hip")[1] - cut["length"]
    neck = neck_cut(body, cut["clearance"])
    fit = {"ease": cut["ease"], "flare": cut.get("flare", 0.0), "hem": hem}
    armhole = armhole_cut(body, neck, strap=cut["strap"], clearance=cut["clearance"], **fit)
    surface = {**fit, "top": neck.point[1] + 0.04}
    return surface, [SEAM_CUT, level_cut("hem", hem, down=True), armhole, neck]


def _skirt(body: Body, cut: Measures) -> Outline:
    """Outline a garment with a waist and a hem."""
    hip = joint_position(body, "left_hip")[1]
    hem, top = hip - cut["length"], hip + cut["rise"]
    surface = {"hem": hem, "top": top, "ease": cut["ease"], "flare": cut["flare"], "waistband": True}
    return surface, [SEAM_CUT, level_cut("hem", hem, down=True), level_cut("waist", top)]


def _legs(body: Body, cut: Measures) -> Outline:
    """Outline a garment with a waist and two legs."""
    crotch = legs_part(body, cut["clearance"] + cut["ease"] / (2 * np.pi))
    hem = crotch - cut["length"] * (crotch - joint_position(body, "left_ankle")[1])
    top = joint_position(body, "left_hip")[1] + cut["rise"]
    surface = {"hem": hem, "top": top, "ease": cut["ease"], "waistband": True, "legs": True}
    return surface, [SEAM_CUT, level_cut("left_leg", hem, down=True), level_cut("waist", top)]


GARMENT_TEMPLATES = (
    GarmentTemplate(
        name=TSHIRT, outline=_sleeves,
        measures={"ease": 0.06, "clearance": 0.015, "sleeve": 0.55, "length": 0.09},
    ),
    GarmentTemplate(  # its hem swings freely
        name="tunic", outline=_sleeves,
        measures={"ease": 0.06, "clearance": 0.015, "sleeve": 0.55, "length": 0.17, "flare": 0.045},
    ),
    GarmentTemplate(
        name="skirt", outline=_skirt,
        measures={"ease": 0.04, "clearance": 0.006, "rise": 0.17, "length": 0.3, "flare": 0.1},
        bones=SKIRT_BONES, smoothing=SKIRT_SMOOTHING,
        ranges={"length": (0.1, 0.35, " m")},  # above, its hem would come to where its flare begins
    ),
    GarmentTemplate(
        name="tank_top", outline=_armholes,
        measures={"ease": 0.06, "clearance": 0.015, "strap": 0.06, "length": 0.09},
    ),
    GarmentTemplate(
        name="long_sleeves",
        outline=partial(_sleeves, end="left_wrist"),
        measures={"ease": 0.06, "clearance": 0.015, "sleeve": 0.9, "length": 0.09},
        bones=LONG_SLEEVE_BONES, ranges={"sleeve": (0.55, 0.95, " of the arm")},
    ),
    GarmentTemplate(
        name="trousers", outline=_legs,
        measures={"ease": 0.04, "clearance": 0.006, "rise": 0.17, "length": 0.9},
        bones=TROUSER_BONES, smoothing=TROUSER_SMOOTHING,
        ranges={"length": (0.6, 0.95, " of the inner leg")},
    ),
    GarmentTemplate(
        name="shorts", outline=_legs,
        measures={"ease": 0.06, "clearance": 0.006, "rise": 0.17, "length": 0.25},
        bones=TROUSER_BONES, smoothing=TROUSER_SMOOTHING,
        ranges={"length": (0.15, 0.5, " of the inner leg")},
    ),
    GarmentTemplate(  # to above the knee; its lower part follows both thighs
        name="dress", outline=_armholes,
        measures={"ease": 0.06, "clearance": 0.015, "strap": 0.06, "length": 0.32, "flare": 0.1},
        smoothing=SKIRT_SMOOTHING, ranges={"length": (0.2, 0.6, " m")},
    ),
)  # fmt: skip


def find_template(name: str) -> GarmentTemplate:
    """Return the template of that name.

    Raises:
        GarmentError: another name; the message lists the known ones.

    >>> find_template("tank_top").measures["strap"]  # [m]
    0.06
    """
    for template in GARMENT_TEMPLATES:
        if template.name == name:
            return template
    raise GarmentError(
        f"unknown garment {name!r}: use one of {', '.join(p.name for p in GARMENT_TEMPLATES)}"
    )
