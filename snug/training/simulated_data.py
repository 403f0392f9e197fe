"""Simulated motions in one file, which training reads a few frames at a time.

The file is HDF5: attribute `settings` says of what body and garment the simulations are (`settings_of`); a
group for each motion, called by its place, has attributes `name`, `fps` and `digest` of its vertices, and
poses (T,24,3) [rad], translations (T,3) [m] and vertices (T,V,3) [m] from the pelvis, float32.
`python -m benchmarks.export GARMENT/training-motions` writes such a file.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from reference_sim.files.atomic_files import replacing
from snug.motion.motion import Motion

if TYPE_CHECKING:
    from snug.body.parametric_body import Body
    from snug.garments.garment import Garment
    from snug.training.losses.vertex_targets import StoredVertices

DATA_SET_FORMAT = 2
MICROMETRES = 6  # decimals of positions [m] that count: another processor may tailor the last bits otherwise


class DataSetError(ValueError):
    """A file that holds no simulated motions, or not the ones that are wanted; the message names it."""


@dataclass(frozen=True)
class DataSet:
    """Simulated motions and the file that holds their vertices.

    Attributes:
        path: the file.
        settings: common to all simulations, see `settings_of`.
        motions: that were simulated.
        targets: name -> vertices of each motion, which stay in the file.
    """

    path: Path
    settings: Mapping[str, Any]
    motions: list[Motion]
    targets: dict[str, StoredVertices]

    @classmethod
    def read(cls, file: str | Path) -> DataSet:
        """Read everything but the vertices. Raises DataSetError."""
        from snug.training.losses.vertex_targets import StoredVertices

        path, motions, targets = Path(file), list[Motion](), dict[str, StoredVertices]()
        if not path.is_file():
            raise DataSetError(f"{path}: no such file; python -m benchmarks.export writes one")
        try:
            with h5py.File(path) as data:
                if (number := int(data.attrs["format"])) != DATA_SET_FORMAT:
                    raise DataSetError(f"{path}: format {number}; this version reads {DATA_SET_FORMAT}")
                settings = dict(json.loads(data.attrs["settings"]))
                for place in map(str, range(len(data))):
                    group = data[place]
                    name, fps = str(group.attrs["name"]), float(group.attrs["fps"])
                    poses, translations = group["poses"][:], group["translations"][:]
                    motions.append(Motion(name, poses, translations, fps, "simulated"))
                    shape = (len(poses), int(settings["vertices"]), 3)
                    targets[name] = StoredVertices(
                        path, shape, str(group.attrs["digest"]), f"{place}/vertices"
                    )
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RuntimeError) as error:
            if isinstance(error, DataSetError):
                raise
            reason = " ".join(f"{type(error).__name__} {error}".split())[:200]
            raise DataSetError(f"{path}: no file of simulated motions ({reason})") from None
        return cls(path, settings, motions, targets)

    def check(self, settings: Mapping[str, Any]) -> None:
        """Raise DataSetError unless the simulations have these settings."""
        for name, value in settings.items():
            if (stored := self.settings.get(name)) != value:
                values = f": {stored} there, {value} here" if isinstance(value, str | int | float) else ""
                raise DataSetError(f"{self.path}: simulations of another {name}{values}")


def write_data_set(
    path: Path, body: Body, garment: Garment, simulations: Iterable[tuple[Motion, np.ndarray]]
) -> None:
    """Write simulated motions to a file, whole or not at all.

    Args:
        path: the file.
        body: wears the garment.
        garment: that was simulated.
        simulations: motions of T frames and world positions (T, V, 3) [m].
    """
    joint = body.joints()[0]
    with replacing(path) as temporary, h5py.File(temporary, "w") as data:
        data.attrs["format"] = DATA_SET_FORMAT
        data.attrs["settings"] = json.dumps(settings_of(body, garment))
        for place, (motion, positions) in enumerate(simulations):
            pelvis = joint + motion.translations
            vertices = (positions - pelvis[:, None]).astype(np.float32)
            group = data.create_group(str(place))
            group.attrs.update(name=motion.name, fps=motion.fps, digest=_digest([vertices]))
            group["poses"], group["translations"] = motion.poses, motion.translations
            group["vertices"] = vertices


def settings_of(body: Body, garment: Garment) -> dict[str, Any]:
    """Return the facts that must be equal for simulations of a garment on a body to be of the same cloth."""
    weights = np.round(garment.skinning_weights[garment.pins], MICROMETRES)
    rest = [np.round(garment.rest_positions, MICROMETRES), garment.faces, garment.pins, weights]
    if garment.rest_uv is not None:
        rest.append(np.round(garment.rest_uv, MICROMETRES))
    skin = [body.template, body.skinning_weights, body.joint_template]
    if body.pose_directions is not None:
        skin.append(body.pose_directions)
    return {
        "garment": garment.name,
        "vertices": len(garment.rest_positions),
        "mesh": _digest(rest),
        "material": asdict(garment.material),
        "body": _digest([*(np.round(array, MICROMETRES) for array in skin), body.faces]),
    }


def _digest(arrays: Sequence[np.ndarray]) -> str:
    """Return a digest of shapes and values; a zero has no sign."""
    digest = hashlib.sha256()
    for array in arrays:
        plain = np.asarray(array, np.float64) + 0.0
        digest.update(repr(plain.shape).encode() + plain.tobytes())
    return digest.hexdigest()[:16]
