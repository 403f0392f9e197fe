"""The membrane constants against numbers worked out by hand, and what a material refuses."""

from __future__ import annotations

import pytest

from reference_sim import Material


def test_the_default_cotton_is_that_of_later_methods():
    """They give 44,400 and 23,600 Pa with three digits, and 0.20022 kg/m^2."""
    cotton = Material()
    assert cotton.lame_lambda / cotton.thickness == pytest.approx(44_400, abs=50)
    assert cotton.lame_mu / cotton.thickness == pytest.approx(23_600, abs=50)
    assert cotton.areal_density == pytest.approx(0.20022, rel=1e-14)


def test_a_file_gives_its_fields_and_the_defaults_of_the_others(tmp_path):
    path = tmp_path / "silk.toml"
    path.write_text("young_modulus = 5e4  # Pa\ndensity = 300\n", encoding="utf-8-sig")  # as Notepad does
    assert Material.from_file(path) == Material(young_modulus=5e4, density=300)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "no such file"),
        ("# lost", "holds no field"),
        ("density = true", "density is true or false"),
        ("youngs_modulus = 7e4", "unexpected keyword argument 'youngs_modulus'"),
        ("density = '426'", "give fields of Material"),
        ("thickness = nan", "Material.thickness = nan: must be"),
        ("poisson_ratio = 0.51", "Material.poisson_ratio = 0.51: must lie"),
        ("bending_stiffness = -1e-9", "Material.bending_stiffness = -1e-09: must be"),
    ],
)
def test_a_bad_file_is_named(tmp_path, text, message):
    path = tmp_path / "a.toml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        Material.from_file(path)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)
