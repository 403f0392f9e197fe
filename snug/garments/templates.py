"""Kinds of garments that are tailored by code, each to any body: their cuts, lengths and ranges."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from snug.body.parametric_body import Body
from snug.garments.assembly import assemble_garment
from snug.garments.cuts import SEAM_CUT, CutPlane, armhole_cut, level_cut, neck_cut
from snug.garments.garment import SKIRT_SMOOTHING, Garment, GarmentError
from snug.garments.implicit_surface import legs_part
from snug.garments.landmarks import SHIRT_BONES, joint_position

TSHIRT = "tshirt"  # the garment that a command takes where none is named

LONG_SLEEVE_BONES = (*SHIRT_BONES, "left_elbow", "right_elbow")
SKIRT_BONES = ("pelvis", "spine1", "left_hip", "right_hip")
TROUSER_BONES = (*SKIRT_BONES, "left_knee", "right_knee")
TROUSER_SMOOTHING = 10  # at the crotch, borrowed weights jump from leg to leg


def tailor_tshirt(
    body: Body,
    *,
    vertices: int = 1000,
    ease: float = 0.06,
    clearance: float = 0.015,
    sleeve: float = 0.55,
    length: float = 0.09,
) -> Garment:
    """Tailor a T-shirt to the unposed body, mirror-symmetric.

    Args:
        body: in T pose.
        vertices: number of vertices, met within 1 %.
        ease: girth [m] at waist and cuffs beyond a shirt that lies at `clearance` around chest, hips or arm.
        clearance: least distance [m] from the skin, over vertices, edge midpoints and centroids.
        sleeve: share of the upper arm that the sleeve covers.
        length: hem below the hip joints [m].

    Raises:
        GarmentError: a parameter out of range, or a body on which no sound mesh comes out.

    >>> shirt = tailor_tshirt(Body.load(), vertices=300)  # doctest: +SKIP
    >>> list(shirt.loops)  # takes 3 s  # doctest: +SKIP
    ['neck', 'left_sleeve', 'right_sleeve', 'hem']
    """
    cut = {"ease": ease, "clearance": clearance, "sleeve": sleeve, "length": length}
    return _shirt(TSHIRT, body, vertices, cut)


def tailor_tunic(
    body: Body,
    *,
    vertices: int = 1000,
    ease: float = 0.06,
    clearance: float = 0.015,
    sleeve: float = 0.55,
    length: float = 0.17,
    flare: float = 0.045,
) -> Garment:
    """Tailor a tunic: a longer T-shirt that widens from the waist on, so that its hem swings freely.

    flare: how much further [m] the hem stands off than the waist, all around. The rest: see tailor_tshirt.

    >>> garment = tailor_tunic(Body.load(), vertices=300)  # takes 3 s  # doctest: +SKIP
    """
    cut = {"ease": ease, "clearance": clearance, "sleeve": sleeve, "length": length, "flare": flare}
    return _shirt("tunic", body, vertices, cut)


def tailor_long_sleeves(
    body: Body,
    *,
    vertices: int = 1000,
    ease: float = 0.06,
    clearance: float = 0.015,
    sleeve: float = 0.9,
    length: float = 0.09,
) -> Garment:
    """Tailor a shirt with long sleeves.

    sleeve: share of the whole arm, shoulder to wrist. The rest: see tailor_tshirt.

    >>> garment = tailor_long_sleeves(Body.load(), vertices=300)  # takes 3 s  # doctest: +SKIP
    """
    cut = {"ease": ease, "clearance": clearance, "sleeve": sleeve, "length": length}
    return _shirt("long_sleeves", body, vertices, cut, end="left_wrist", bones=LONG_SLEEVE_BONES)


def tailor_tank_top(
    body: Body,
    *,
    vertices: int = 1000,
    ease: float = 0.06,
    clearance: float = 0.015,
    strap: float = 0.06,
    length: float = 0.09,
) -> Garment:
    """Tailor a shirt without sleeves. strap: width of its straps [m]. The rest: see tailor_tshirt.

    >>> garment = tailor_tank_top(Body.load(), vertices=300)  # takes 3 s  # doctest: +SKIP
    """
    cut = {"ease": ease, "clearance": clearance, "strap": strap, "length": length}
    return _sleeveless("tank_top", body, vertices, cut)


def tailor_dress(
    body: Body,
    *,
    vertices: int = 1000,
    ease: float = 0.06,
    clearance: float = 0.015,
    strap: float = 0.06,
    length: float = 0.32,
    flare: float = 0.1,
) -> Garment:
    """Tailor a dress without sleeves, to above the knee, whose lower part follows both thighs.

    flare: how much further [m] the hem stands off than the waist, all around. The rest: see tailor_tank_top.

    >>> garment = tailor_dress(Body.load(), vertices=300)  # takes 3 s  # doctest: +SKIP
    """
    cut = {"ease": ease, "clearance": clearance, "strap": strap, "length": length, "flare": flare}
    return _sleeveless("dress", body, vertices, cut, SKIRT_SMOOTHING)


def tailor_skirt(
    body: Body,
    *,
    vertices: int = 1000,
    ease: float = 0.04,
    clearance: float = 0.006,
    rise: float = 0.17,
    length: float = 0.3,
    flare: float = 0.1,
) -> Garment:
    """Tailor a flared skirt, mirror-symmetric, whose waistband the body carries.

    Args:
        body: in T pose.
        vertices: number of vertices, met within 1 %.
        ease: girth [m] at the hips beyond a skirt that lies at `clearance`.
        clearance: least distance [m] from the skin.
        rise: waistband above the hip joints [m].
        length: hem below them [m].
        flare: how much further [m] the hem stands off than the hips.

    Raises:
        GarmentError: see tailor_tshirt.

    >>> garment = tailor_skirt(Body.load(), vertices=300)  # takes 3 s  # doctest: +SKIP
    """
    cut = {"ease": ease, "clearance": clearance, "rise": rise, "length": length, "flare": flare}
    _check_ranges("skirt", {"vertices": vertices, **cut})
    hip = joint_position(body, "left_hip")[1]
    hem, top = hip - length, hip + rise
    cuts = [SEAM_CUT, level_cut("hem", hem, down=True), level_cut("waist", top)]
    surface = {"hem": hem, "top": top, "ease": ease, "flare": flare, "waistband": True}
    return assemble_garment("skirt", body, vertices, cut, surface, cuts, SKIRT_BONES, SKIRT_SMOOTHING)


def tailor_trousers(
    body: Body,
    *,
    vertices: int = 1000,
    ease: float = 0.04,
    clearance: float = 0.006,
    rise: float = 0.17,
    length: float = 0.9,
) -> Garment:
    """Tailor trousers, mirror-symmetric, whose waistband the body carries.

    Args:
        body: in T pose.
        vertices: number of vertices, met within 1 %.
        ease: girth [m] at hips and legs beyond trousers that lie at `clearance`.
        clearance: least distance [m] from the skin.
        rise: waistband above the hip joints [m].
        length: inseam, as a share of that from crotch to ankle.

    Raises:
        GarmentError: see tailor_tshirt.

    >>> garment = tailor_trousers(Body.load(), vertices=300)  # takes 3 s  # doctest: +SKIP
    """
    cut = {"ease": ease, "clearance": clearance, "rise": rise, "length": length}
    return _trousers("trousers", body, vertices, cut)


def tailor_shorts(
    body: Body,
    *,
    vertices: int = 1000,
    ease: float = 0.06,
    clearance: float = 0.006,
    rise: float = 0.17,
    length: float = 0.25,
) -> Garment:
    """Tailor shorts: trousers that end above the knee. See tailor_trousers.

    >>> garment = tailor_shorts(Body.load(), vertices=300)  # takes 3 s  # doctest: +SKIP
    """
    cut = {"ease": ease, "clearance": clearance, "rise": rise, "length": length}
    return _trousers("shorts", body, vertices, cut)


@dataclass(frozen=True)
class GarmentTemplate:
    """A kind of garment: name, description, and the function that tailors it for (body, vertices=...)."""

    name: str
    description: str
    tailor: Callable[..., Garment]


GARMENT_TEMPLATES = (
    GarmentTemplate(TSHIRT, "T-shirt", tailor_tshirt),
    GarmentTemplate("tunic", "flared tunic", tailor_tunic),
    GarmentTemplate("skirt", "flared skirt", tailor_skirt),
    GarmentTemplate("tank_top", "tank top", tailor_tank_top),
    GarmentTemplate("long_sleeves", "shirt with long sleeves", tailor_long_sleeves),
    GarmentTemplate("trousers", "trousers", tailor_trousers),
    GarmentTemplate("shorts", "shorts", tailor_shorts),
    GarmentTemplate("dress", "dress", tailor_dress),
)


def find_template(name: str) -> GarmentTemplate:
    """Return the template of that name.

    Raises:
        GarmentError: another name; the message lists the known ones.

    >>> find_template("dress").tailor.__name__
    'tailor_dress'
    """
    for template in GARMENT_TEMPLATES:
        if template.name == name:
            return template
    raise GarmentError(f"unknown garment {name!r}: use one of {', '.join(p.name for p in GARMENT_TEMPLATES)}")


# Parameter: least and largest value, unit.
RANGES = {
    "vertices": (100, 20_000, " vertices"),
    "ease": (0.0, 0.3, " m"),
    "clearance": (0.005, 0.05, " m"),
    "sleeve": (0.3, 0.9, " of the upper arm"),
    "rise": (0.14, 0.2, " m"),
    "length": (-0.05, 0.25, " m"),
    "skirt length": (0.1, 0.35, " m"),  # above, its hem would come to where its flare begins
    "dress length": (0.2, 0.6, " m"),
    "trousers length": (0.6, 0.95, " of the inner leg"),
    "shorts length": (0.15, 0.5, " of the inner leg"),
    "long_sleeves sleeve": (0.55, 0.95, " of the arm"),
    "strap": (0.04, 0.08, " m"),
    "flare": (0.0, 0.15, " m"),
}


def _check_ranges(name: str, parameters: Mapping[str, float]) -> None:
    """Raise GarmentError for a parameter that is out of range."""
    for parameter, value in parameters.items():
        low, high, unit = RANGES.get(f"{name} {parameter}") or RANGES[parameter]
        if not (np.isfinite(value) and low <= value <= high):
            raise GarmentError(
                f"{parameter}={value}: a {name} can be tailored from {low:g} to {high:g}{unit}"
            )


def _shirt(
    name: str, body: Body, vertices: int, cut: Mapping[str, float], *, end: str = "left_elbow",
    bones: Sequence[str] = SHIRT_BONES,
) -> Garment:  # fmt: skip
    """Make a garment with two sleeves, a neck and a hem; its sleeves end from the shoulder towards `end`."""
    _check_ranges(name, {"vertices": vertices, **cut})
    shoulder, far = joint_position(body, "left_shoulder"), joint_position(body, end)
    hem = joint_position(body, "left_hip")[1] - cut["length"]
    cuff = shoulder[0] + cut["sleeve"] * (far[0] - shoulder[0])
    neck = neck_cut(body, cut["clearance"])
    sleeve = CutPlane("left_sleeve", (1.0, 0.0, 0.0), (cuff, 0.0, 0.0), twin="right_sleeve")
    cuts = [SEAM_CUT, level_cut("hem", hem, down=True), sleeve, neck]
    surface = {"hem": hem, "cuff": cuff, "top": neck.point[1] + 0.04, "ease": cut["ease"],
               "flare": cut.get("flare", 0.0)}  # fmt: skip
    return assemble_garment(name, body, vertices, cut, surface, cuts, bones)


def _sleeveless(
    name: str, body: Body, vertices: int, cut: Mapping[str, float], smoothing: int = 0
) -> Garment:
    """Make a garment with two armholes, a neck and a hem."""
    _check_ranges(name, {"vertices": vertices, **cut})
    hem = joint_position(body, "left_hip")[1] - cut["length"]
    neck = neck_cut(body, cut["clearance"])
    fit = {"ease": cut["ease"], "flare": cut.get("flare", 0.0), "hem": hem}
    armhole = armhole_cut(body, neck, strap=cut["strap"], clearance=cut["clearance"], **fit)
    cuts = [SEAM_CUT, level_cut("hem", hem, down=True), armhole, neck]
    surface = {**fit, "top": neck.point[1] + 0.04}
    return assemble_garment(name, body, vertices, cut, surface, cuts, SHIRT_BONES, smoothing)


def _trousers(name: str, body: Body, vertices: int, cut: Mapping[str, float]) -> Garment:
    """Make a garment with a waist and two legs."""
    _check_ranges(name, {"vertices": vertices, **cut})
    crotch = legs_part(body, cut["clearance"] + cut["ease"] / (2 * np.pi))
    hem = crotch - cut["length"] * (crotch - joint_position(body, "left_ankle")[1])
    top = joint_position(body, "left_hip")[1] + cut["rise"]
    leg = replace(level_cut("left_leg", hem, down=True), twin="right_leg")
    surface = {"hem": hem, "top": top, "ease": cut["ease"], "waistband": True, "legs": True}
    cuts = [SEAM_CUT, leg, level_cut("waist", top)]
    return assemble_garment(name, body, vertices, cut, surface, cuts, TROUSER_BONES, TROUSER_SMOOTHING)
