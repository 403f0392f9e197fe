"""The membrane constants against numbers worked out by hand, and what a material refuses."""

from __future__ import annotations

import pytest

from reference_sim import Material


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


def test_a_file_gives_its_fields_and_the_defaults_of_the_others(tmp_path):
    path = tmp_path / "silk.toml"
    path.write_text("young_modulus = 5e4  # Pa\ndensity = 300\n")
    assert Material.from_file(path) == Material(young_modulus=5e4, density=300)
    lame = {"lame_lambda_pa": 44_400.0, "lame_mu_pa": 23_600.0, "thickness": 0.47e-3}
    lame |= {"areal_density": 0.20022, "bending_stiffness": 3.96e-5}
    path.write_text("".join(f"{name} = {value!r}\n" for name, value in lame.items()))
    assert Material.from_file(path) == Material.from_lame(**lame)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "no such file"),
        ("youngs_modulus = 7e4", "unexpected keyword argument 'youngs_modulus'"),
        ("density = '426'", "give fields of Material"),
        ("thickness = nan", "Material.thickness = nan: must be"),
        ("poisson_ratio = 0.51", "Material.poisson_ratio = 0.51: must lie"),
        ("bending_stiffness = -1e-9", "Material.bending_stiffness = -1e-09: must be"),
        ("lame_mu_pa = 23600.0", "missing .* 'lame_lambda_pa', 'thickness'"),
    ],
)
def test_a_bad_file_is_named(tmp_path, text, message):
    path = tmp_path / "a.toml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        Material.from_file(path)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)
