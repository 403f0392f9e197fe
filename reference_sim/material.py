"""Material of a cloth: SI inputs, and the membrane constants that follow from them."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from pathlib import Path

GRAVITY = 9.81  # [m/s^2], downwards along -y


@dataclass(frozen=True)
class Material:
    """Isotropic fabric. Defaults are the cotton of the SNUG paper.

    Args:
        young_modulus: E [Pa].
        poisson_ratio: nu [1], in (-1, 0.5].
        thickness: t [m].
        density: rho [kg/m^3].
        bending_stiffness: k of the hinges [J], see BendHinge.

    The paper prints lambda = 20.9 and mu = 11.1 and multiplies them by a volume; the printed numbers are
    only consistent with E = 70 kPa, nu = 0.485 if they are membrane constants in N/m, thickness included.

    Raises:
        ValueError: a value is not finite or outside its physical range.

    Example:
        >>> from reference_sim import Material
        >>> cotton = Material()
        >>> round(cotton.lame_lambda, 1), round(cotton.lame_mu, 1)  # [N/m]
        (20.9, 11.1)
        >>> Material(thickness=0.0)
        Traceback (most recent call last):
        ValueError: Material.thickness = 0.0: must be a finite number above 0 (SI units)
    """

    young_modulus: float = 70e3
    poisson_ratio: float = 0.485
    thickness: float = 0.47e-3
    density: float = 426.0
    bending_stiffness: float = 3.96e-5

    def __post_init__(self) -> None:
        for name in ("young_modulus", "thickness", "density"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"Material.{name} = {value!r}: must be a finite number above 0 (SI units)")
        if not -1 < self.poisson_ratio <= 0.5:
            raise ValueError(f"Material.poisson_ratio = {self.poisson_ratio!r}: must lie in (-1, 0.5]")
        if not (math.isfinite(self.bending_stiffness) and self.bending_stiffness >= 0):
            raise ValueError(
                f"Material.bending_stiffness = {self.bending_stiffness!r}: must be finite, at least 0 [J]"
            )

    @classmethod
    def from_file(cls, path: str | Path) -> Material:
        """Read the material of a .toml file: fields of this class, or all arguments of `from_lame`.

        Fields that are left out keep their defaults.

        Raises:
            ValueError: no such file, not understood, an unknown or missing field, or a value out of its
                range; the message names the file.
        """
        try:
            values = tomllib.loads(Path(path).read_text(encoding="utf-8"))
            make = cls.from_lame if "lame_mu_pa" in values else cls
            return make(**values)
        except FileNotFoundError:
            raise ValueError(f"{path}: no such file") from None
        except (ValueError, TypeError, OverflowError, RecursionError) as error:  # also of text that is none
            reason = " ".join(str(error).split())
            raise ValueError(f"{path}: {reason}; give fields of Material in SI units") from None

    @classmethod
    def from_lame(
        cls,
        *,
        lame_lambda_pa: float,
        lame_mu_pa: float,
        thickness: float,
        areal_density: float,
        bending_stiffness: float,
    ) -> Material:
        """Return the material from the numbers that SNUG's code and the methods after it give.

        They are moduli in Pa; `lame_lambda` and `lame_mu` of a material are membrane constants in N/m, the
        same times the thickness.

        nu = lambda / (lambda + 2 mu), E = 2 mu (1 + nu).

        Args:
            lame_lambda_pa: of plane stress, not yet times the thickness [Pa]: 44,400 there.
            lame_mu_pa: likewise [Pa], 23,600 there.
            thickness: [m], 0.47e-3 there.
            areal_density: [kg/m^2], 0.20022 there.
            bending_stiffness: k of scaled hinges [J], 3.96e-5 there.

        Raises:
            ValueError: a value is not finite or outside its physical range.
        """
        if not (thickness > 0 and lame_lambda_pa + 2 * lame_mu_pa > 0):
            raise ValueError("thickness and lambda + 2 mu must be above 0")
        poisson_ratio = lame_lambda_pa / (lame_lambda_pa + 2 * lame_mu_pa)
        return cls(
            young_modulus=2 * lame_mu_pa * (1 + poisson_ratio),
            poisson_ratio=poisson_ratio,
            thickness=thickness,
            density=areal_density / thickness,
            bending_stiffness=bending_stiffness,
        )

    @property
    def lame_mu(self) -> float:
        """Membrane shear modulus mu = t E / (2 (1 + nu)) [N/m]."""
        return self.thickness * self.young_modulus / (2 * (1 + self.poisson_ratio))

    @property
    def lame_lambda(self) -> float:
        """Membrane lambda of plane stress, t E nu / (1 - nu^2) [N/m]."""
        return self.thickness * self.young_modulus * self.poisson_ratio / (1 - self.poisson_ratio**2)

    @property
    def membrane_modulus(self) -> float:
        """Force per width in uniaxial stress, E2 = 4 mu (lambda + mu) / (lambda + 2 mu) [N/m]."""
        mu, lam = self.lame_mu, self.lame_lambda
        return 4 * mu * (lam + mu) / (lam + 2 * mu)

    @property
    def areal_density(self) -> float:
        """Mass per area rho t [kg/m^2]."""
        return self.density * self.thickness
