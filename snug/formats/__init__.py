"""Readers of other people's files: one file per format, one line in a visible table."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from snug.formats.bvh_motion import read_bvh
from snug.formats.retarget import read_asf_amc
from snug.formats.smpl_motion import read_npy, read_npz, read_pkl
from snug.motion_options import Reading
from snug.recording import Recording

# Extension of a motion file: its reader. Each gives the clip as recorded, in the axes of the file.
READERS: dict[str, Callable[[Path, Reading], Recording]] = {
    ".amc": read_asf_amc,
    ".bvh": read_bvh,
    ".npz": read_npz,
    ".npy": read_npy,
    ".pkl": read_pkl,
}
