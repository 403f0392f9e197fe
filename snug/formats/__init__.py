"""Readers of other people's files: one file per format, one line in a visible table."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from snug.formats.amass import read_amass
from snug.formats.retarget import read_asf_amc
from snug.motion import Motion

# Extension of a motion file: its reader. Each gives the clip as recorded, in Body's convention.
READERS: dict[str, Callable[[Path], Motion]] = {".amc": read_asf_amc, ".npz": read_amass}
