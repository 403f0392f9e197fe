"""Readers of motion files: one module per format, one line in a visible table."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from snug.motion.acclaim_to_smpl import read_asf_amc
from snug.motion.bvh_to_smpl import read_bvh
from snug.motion.options import MotionFileOptions
from snug.motion.raw_motion import RawMotion
from snug.motion.smpl_arrays import read_npy, read_npz, read_pkl

# Extension of a motion file: its reader. Each gives the clip as recorded, in the axes of the file.
READERS: dict[str, Callable[[Path, MotionFileOptions], RawMotion]] = {
    ".amc": read_asf_amc,
    ".bvh": read_bvh,
    ".npz": read_npz,
    ".npy": read_npy,
    ".pkl": read_pkl,
}
