"""Packed arrays, as the page carries them: integers, predicted from frame to frame, deflated, in base64.

The browser undoes it (data.js). Positions are 16-bit steps of one length per trajectory, so they are off by
half a step at most; values per vertex are 8 bits on the scale of square roots, fine where they are small.
"""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np

STEPS = 2**16 - 1
FINEST = 1e-4  # [m] of a step: nothing finer is seen, and noise does not deflate
LEVELS = 255  # of values that are never negative
HALF_LEVELS = 127  # on either side of 0, of those that may be


@dataclass
class Pack:
    """Arrays one behind the other; entries: by name, where each lies and how it is read."""

    entries: dict[str, dict[str, Any]] = field(default_factory=dict)
    parts: list[bytes] = field(default_factory=list)

    def _add(self, name: str, array: np.ndarray, **how: Any) -> None:
        start = sum(map(len, self.parts))
        self.parts.append(array.tobytes())
        self.entries[name] = {"at": start, "shape": list(array.shape), **how}

    def positions(self, name: str, positions: np.ndarray) -> None:
        """Add finite positions (T,V,3) [m]: low bytes, then high ones, of differences from linear motion."""
        low = positions.reshape(-1, 3).min(axis=0)
        step = max(float((positions - low).max()) / STEPS, FINEST)
        steps = np.rint((positions - low) / step).astype(np.uint16)
        surprise = residuals(steps)
        planes = np.stack([surprise & 255, surprise >> 8]).astype(np.uint8)
        self._add(name, planes, kind="positions", low=[float(x) for x in low], step=step)
        self.entries[name]["shape"] = list(positions.shape)

    def values(self, name: str, values: np.ndarray, *, signed: bool = False) -> None:
        """Add numbers of vertices (T,V), each byte less that of the frame before.

        A number that is not finite is 0; frames without a finite number are named, and not coloured.
        """
        unknown = np.flatnonzero(~np.isfinite(values).any(axis=1))
        values = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
        full = max(float(np.abs(values).max(initial=0.0)), 1e-12)
        root = np.sqrt(np.abs(values) / full)
        levels = 128 + np.rint(np.sign(values) * HALF_LEVELS * root) if signed else np.rint(LEVELS * root)
        levels = levels.astype(np.uint8)
        changes = np.diff(levels, axis=0, prepend=np.zeros_like(levels[:1]))
        self._add(name, changes, kind="values", full=full, signed=signed, unknown=unknown.tolist())

    def numbers(self, name: str, numbers: np.ndarray) -> None:
        """Add one number per frame (T,), to single precision."""
        self._add(name, numbers.astype("<f4"), kind="numbers")

    def indices(self, name: str, indices: np.ndarray) -> None:
        """Add corners of triangles (F,3)."""
        self._add(name, indices.astype("<u4"), kind="indices")

    def text(self) -> str:
        """Return all arrays, in letters that mean nothing to a browser."""
        return deflated(b"".join(self.parts))


def residuals(steps: np.ndarray) -> np.ndarray:
    """Return differences of (T,...) uint16 from linear motion through the two frames before.

    Small differences of either sign are small numbers: 0, -1, 1, -2, ... as 0, 1, 2, 3, ...
    """
    moved = np.diff(steps, axis=0, prepend=np.zeros_like(steps[:1]))
    left = moved.copy()
    left[2:] = moved[2:] - moved[1:-1]
    signed = left.view(np.int16)
    return ((signed << 1) ^ (signed >> 15)).view(np.uint16)


def deflated(data: bytes) -> str:
    """Return data in zlib's format, in base64."""
    return base64.b64encode(zlib.compress(data, 6)).decode("ascii")
