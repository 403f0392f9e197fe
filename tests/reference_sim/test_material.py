"""The membrane constants against numbers worked out by hand, and what a material refuses."""

from __future__ import annotations

import math

import pytest

from reference_sim import Material
from reference_sim.material import MaterialError


def test_the_numbers_of_later_methods_are_the_default_cotton():
    given = {"lame_lambda_pa": 44_400.0, "lame_mu_pa": 23_600.0, "areal_density": 0.20022}
    field = Material.from_lame(**given, thickness=0.47e-3, bending_stiffness=3.96e-5)
    cotton = Material()
    # Given with three digits; the density with all.
    assert field.lame_lambda == pytest.approx(44_400 * 0.47e-3, rel=1e-14)
    assert field.lame_mu == pytest.approx(23_600 * 0.47e-3, rel=1e-14)
    assert cotton.lame_lambda / cotton.thickness == pytest.approx(44_400, abs=50)
    assert cotton.lame_mu / cotton.thickness == pytest.approx(23_600, abs=50)
    assert field.areal_density == pytest.approx(cotton.areal_density, rel=1e-14)
    assert (field.thickness, field.bending_stiffness) == (cotton.thickness, cotton.bending_stiffness)


def test_constants_of_a_material_with_round_numbers():
    # mu = 2 * 9 / (2 * 1.5) = 6, lambda = 2 * 9 * 0.5 / 0.75 = 12, E2 = E t = 18.
    m = Material(young_modulus=9.0, poisson_ratio=0.5, thickness=2.0, density=3.0, bending_stiffness=0.0)
    assert m.lame_mu == pytest.approx(6.0, rel=1e-15)
    assert m.lame_lambda == pytest.approx(12.0, rel=1e-15)
    assert m.membrane_modulus == pytest.approx(18.0, rel=1e-15)
    assert m.areal_density == 6.0


@pytest.mark.parametrize("nu", [-0.9, -0.3, 0.0, 0.3, 0.5])
def test_plane_stress_in_two_dimensions_is_the_same_sheet(nu):
    """The membrane's own modulus and Poisson ratio are E t and nu: lambda is that of plane stress."""
    m = Material(young_modulus=5e4, poisson_ratio=nu, thickness=1e-3)
    assert m.membrane_modulus == pytest.approx(50.0, rel=1e-13)  # round-off
    assert m.lame_lambda / (m.lame_lambda + 2 * m.lame_mu) == pytest.approx(nu, abs=1e-15)


@pytest.mark.parametrize(
    "wrong",
    [
        *(
            {name: value}
            for name in ("young_modulus", "thickness", "density")
            for value in (0.0, -1.0, math.nan, math.inf)
        ),
        {"poisson_ratio": -1.0},
        {"poisson_ratio": 0.51},
        {"poisson_ratio": math.nan},
        {"bending_stiffness": -1e-9},
        {"bending_stiffness": math.inf},
    ],
)
def test_impossible_values_are_refused_by_name(wrong):
    with pytest.raises(ValueError, match=rf"Material\.{next(iter(wrong))} = "):
        Material(**wrong)


def test_a_file_gives_its_fields_and_the_defaults_of_the_others(tmp_path):
    toml, json = tmp_path / "silk.toml", tmp_path / "silk.json"
    toml.write_text("young_modulus = 5e4  # Pa\ndensity = 300\n")
    json.write_text('{"young_modulus": 5e4, "density": 300}')
    for path in (toml, json):
        assert Material.from_file(path) == Material(young_modulus=5e4, density=300)
    lame = {
        "lame_lambda_pa": 44_400.0,
        "lame_mu_pa": 23_600.0,
        "thickness": 0.47e-3,
        "areal_density": 0.20022,
        "bending_stiffness": 3.96e-5,
    }
    toml.write_text("".join(f"{name} = {value!r}\n" for name, value in lame.items()))
    assert Material.from_file(toml) == Material.from_lame(**lame)
    for wrong in ({"thickness": 0.0}, {"lame_lambda_pa": -47_200.0}):
        with pytest.raises(ValueError, match=r"= 0\.0: must be above 0"):
            Material.from_lame(**lame | wrong)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.toml", None, "no such file"),
        ("a.yaml", "x: 1", "a material is a .toml or a .json"),
        ("a.toml", "young_modulus = ", "not understood"),
        ("a.json", "[1, 2]", "expected names and numbers"),
        ("a.json", "[" * 100_000, "not understood"),
        ("a.toml", "youngs_modulus = 7e4", "unknown field 'youngs_modulus': use young_modulus"),
        ("a.toml", "density = true", "density = True is no number"),
        ("a.json", '{"density": 1' + 400 * "0" + "}", "int too large"),
        ("a.toml", "density = -1.0", "Material.density = -1.0: must be"),
        ("a.toml", "lame_mu_pa = 23600.0", "also need lame_lambda_pa, thickness"),
        ("a.toml", "lame_mu = 11.1", "unknown field 'lame_mu': use .*; or all of lame_lambda_pa, lame_mu_pa"),
        ("a.toml", "#" * (2 << 20), "too large for a material"),
    ],
)
def test_a_bad_file_is_named_with_its_field(tmp_path, name, text, message):
    path = tmp_path / name
    if text is not None:
        path.write_text(text)
    with pytest.raises(MaterialError, match=message) as caught:
        Material.from_file(path)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)
