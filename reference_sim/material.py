"""Material of a cloth: SI inputs, and the membrane constants that follow from them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from reference_sim.given_files import read_toml

GRAVITY = 9.81  # [m/s^2], downwards along -y


@dataclass(frozen=True)
class Material:
    """Isotropic fabric. Defaults are the cotton of the SNUG paper.

    The paper prints lambda = 20.9 and mu = 11.1 and multiplies them by a volume; the printed numbers are
    only consistent with E = 70 kPa, nu = 0.485 if they are membrane constants in N/m, thickness included.

    Raises ValueError for a value that is not finite or outside its physical range.

    Example:
        >>> from reference_sim import Material
        >>> cotton = Material()
        >>> round(cotton.lame_lambda, 1), round(cotton.lame_mu, 1)  # [N/m]
        (20.9, 11.1)
        >>> Material(thickness=0.0)
        Traceback (most recent call last):
        ValueError: Material.thickness = 0.0: must be a finite number above 0 (SI units)
    """

    young_modulus: float = 70e3  # E [Pa]
    poisson_ratio: float = 0.485  # nu [1], in (-1, 0.5]
    thickness: float = 0.47e-3  # t [m]
    density: float = 426.0  # rho [kg/m^3]
    bending_stiffness: float = 3.96e-5  # k of the hinges [J], see BendHinge

    def __post_init__(self) -> None:
        for name in ("young_modulus", "thickness", "density"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(
                    f"Material.{name} = {value!r}: must be a finite number above 0 (SI units)"
                )
        if not -1 < self.poisson_ratio <= 0.5:
            raise ValueError(f"Material.poisson_ratio = {self.poisson_ratio!r}: must lie in (-1, 0.5]")
        if not (math.isfinite(self.bending_stiffness) and self.bending_stiffness >= 0):
            raise ValueError(
                f"Material.bending_stiffness = {self.bending_stiffness!r}: must be finite, at least 0 [J]"
            )

    @classmethod
    def from_file(cls, path: str | Path) -> Material:
        """Read the material of a .toml file: fields of this class, others keep their defaults.

        Raises ValueError that names the file.
        """
        try:
            table = read_toml(path)
            if flags := [name for name, value in table.items() if isinstance(value, bool)]:
                raise ValueError(f"{flags[0]} is true or false, and no number")
            return cls(**table)
        except FileNotFoundError:
            raise ValueError(f"{path}: no such file") from None
        except (OSError, ValueError, TypeError) as error:  # also of text that is none
            reason = " ".join(str(error).split())
            raise ValueError(f"{path}: {reason}; give fields of Material in SI units") from None

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
