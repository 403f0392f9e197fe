"""Fabrics and their specimens: closed forms, properties, files of a user."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from benchmarks.fabrics.disc import DRAPE, PLATE, SPECIMEN, disc, ring, shadow
from benchmarks.fabrics.elastica import bending_length, exact_elastica
from benchmarks.fabrics.fabric import FABRICS, Fabric, isotropic
from benchmarks.fabrics.measured import FabricFileError, read_fabrics, spread_sample
from benchmarks.fabrics.strip import BENDING_LENGTH, cantilever
from benchmarks.validation.fabric.cases import percentiles
from reference_sim.geometry.topology import boundary_loops

BESIDE = Path(__file__).parents[4] / "shared/data/fabrics/measured_bending_618.csv"
MEASURED = Path(os.environ.get("MEASURED_FABRICS", BESIDE))
SNUG = next(fabric for fabric in FABRICS if fabric.name == "snug")


def shot(gamma: float) -> tuple[float, float]:
    """Width and height of the elastica by shooting: another method than the collocation of the code."""

    def at_end(curvature):
        def slope(s, y):
            return [y[1], -gamma * (1 - s) * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]

        return solve_ivp(slope, (0, 1), [0, curvature, 0, 0], rtol=1e-10, atol=1e-12).y[:, -1]

    curvature = brentq(lambda c: at_end(c)[1], 0.0, gamma / 2)
    return at_end(curvature)[2], at_end(curvature)[3]


@pytest.mark.parametrize("gamma", [0.5, 8.0, 40.0])
def test_the_elastica_is_that_of_shooting(gamma):
    assert exact_elastica(gamma, 0.0)[1][:, -1] == pytest.approx(shot(gamma), rel=1e-5)


@pytest.mark.parametrize("gamma", [0.05, 2.0, 8.0, 30.0, 700.0])
def test_the_bending_length_is_that_of_the_shape(gamma):
    x, drop = exact_elastica(gamma, 0.0)[1]
    length = bending_length(0.3, float(np.arctan2(drop[-1], x[-1])))
    assert length == pytest.approx(0.3 / gamma ** (1 / 3), rel=1e-3)


def test_the_strip_has_the_fabrics_stiffness_and_overhangs_by_twice_its_bending_length():
    strip = cantilever(SNUG, 16)
    assert strip.stiffness == pytest.approx(SNUG.rigidity, rel=1e-6)
    assert strip.length == pytest.approx(2 * SNUG.bending_length, rel=1e-6)
    assert 0 < strip.clamp < strip.cell / 2
    # On the elastica it reads off its own bending length.
    s, (x, drop) = exact_elastica(8.0, 0.0)
    bent = strip.cloth.rest_positions.copy()
    along = (bent[:, 0] - strip.clamp) / strip.length
    bent[:, 0] = strip.clamp + strip.length * np.interp(along, s, x)
    bent[:, 1] = -strip.length * np.interp(along, s, drop)
    assert strip.measure(bent)[BENDING_LENGTH] == pytest.approx(1e3 * SNUG.bending_length, rel=1e-3)
    assert strip.error(bent) < 0.1 < strip.error(strip.start)


def test_the_ring_is_closed_equilateral_and_looks_up():
    points, faces, pins = ring(5)
    corners = points[faces]
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    assert (edges.max(axis=1) / edges.min(axis=1)).max() < 1.12  # conformal: equilateral but for size
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 1] > 0).all()
    assert sorted(map(len, boundary_loops(faces))) == [len(pins) // 2] * 2
    radius = np.linalg.norm(points, axis=1)
    assert np.isclose(radius.max(), SPECIMEN) and np.isclose(
        np.prod(np.unique(radius[pins].round(9))), PLATE**2
    )


def test_a_flat_disc_has_a_drape_coefficient_of_100_and_one_that_hangs_of_0():
    specimen = disc(SNUG, 8)
    flat = specimen.cloth.rest_positions
    assert specimen.measure(flat)[DRAPE] == pytest.approx(100.0, abs=0.4)  # chords of the border
    hanging = flat.copy()
    radius = np.linalg.norm(flat, axis=1)
    hanging[:, 1] = -np.maximum(radius - PLATE, 0)
    hanging[:, [0, 2]] *= np.minimum(PLATE / radius, 1.0)[:, None]
    assert specimen.measure(hanging)[DRAPE] == pytest.approx(0.0, abs=0.4)
    assert specimen.error(flat) is None


def test_layers_of_a_shadow_count_once():
    square = np.array([[-0.12, 0, -0.12], [0.12, 0, -0.12], [0.12, 0, 0.12], [-0.12, 0, 0.12]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    twice = (
        np.concatenate([square, square + np.array([0, 0.01, 0])]),
        np.concatenate([faces, faces[:, ::-1] + 4]),
    )
    assert shadow(square, faces) == pytest.approx(0.24**2, rel=2e-3) == shadow(*twice)


def test_overall_rigidity_is_the_geometric_mean():
    fabric = Fabric("twill", 0.2, 4e-5, 1e-5)
    assert fabric.rigidity == pytest.approx(2e-5)
    assert isotropic("plain", 0.2, 0.02).bending_length == pytest.approx(0.02)


TABLE = (
    "name, density[g/m2], bending warp[uN.m], bending weft[uN.m]\nvoile, 62, 2.1, 1.4\ntwill 2/1, 250,30,12\n"
)


def test_a_file_is_read_in_si_and_by_its_heads(tmp_path):
    path = tmp_path / "fabrics.csv"
    path.write_text(TABLE)
    voile, twill = read_fabrics(path)
    assert voile == Fabric("voile", pytest.approx(0.062), pytest.approx(2.1e-6), pytest.approx(1.4e-6))
    assert twill.name == "twill_2_1"
    path.write_text("linear weft[SI*1e9], density[kg.m-2], linear warp[SI*1e9]\n1400, 0.062, 2100\n")
    (unnamed,) = read_fabrics(path)
    assert unnamed.name == "line_2" and unnamed.bending_length == pytest.approx(voile.bending_length)
    assert spread_sample((voile, twill)) == (voile, twill)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "line 1 has no column for density, warp, weft"),
        ("name,density[g/m2],bending warp[uN.m]\n", "no column for weft"),
        (TABLE.split("\n")[0], "holds no fabric"),
        (TABLE.replace("2.1", "soft"), "line 2: warp 'soft' is no number"),
        (TABLE.replace("62", "62000"), "line 2: density 62000 is 62 in SI units"),
        (TABLE.replace("2.1", "nan"), "line 2: warp nan"),
        ("density[g/m2],bending warp[uN.m],bending weft[uN.m],name\n62,2.1,1.4", "line 2: ends before"),
    ],
)
def test_a_bad_file_is_refused_with_its_line(tmp_path, text, complaint):
    path = tmp_path / "fabrics.csv"
    path.write_text(text)
    with pytest.raises(FabricFileError, match=f"--fabrics {path}.*{complaint}"):
        read_fabrics(path)


@pytest.mark.skipif(not MEASURED.is_file(), reason="the 618 measured fabrics are not part of the project")
def test_snug_lies_among_measured_fabrics():
    fabrics = read_fabrics(MEASURED)
    scaled, printed = (case.run().value for case in percentiles(fabrics))
    assert len(fabrics) == 618 and 30 < scaled < 45 and 70 < printed < 90
