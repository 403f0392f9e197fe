"""Garments, motions and files that the command line of snug.train names."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from reference_sim.files.atomic_files import demand_writable_folder
from snug.body.parametric_body import Body
from snug.garments.garment import Garment
from snug.garments.options import demand_garment_file, is_garment_file, make_garment_file
from snug.garments.templates import TSHIRT, find_template
from snug.motion.files import load_motions
from snug.motion.library import CONTROL, DYNAMIC_VALIDATION, TRAIN, VALIDATION, make_motion
from snug.motion.motion import Motion
from snug.motion.options import parse_motion_options
from snug.training.simulated_data import DataSet


@dataclass(frozen=True)
class ChosenGarment:
    """A garment that a network is trained for.

    Attributes:
        name: of the template or file.
        description: in words.
        make: function of (body, vertices=...) that returns it; one that is read has the vertices of its file.
    """

    name: str
    description: str
    make: Callable[..., Garment]


def choose_garments(options: argparse.Namespace) -> list[ChosenGarment]:
    """Return the garments to train for, each once; the T-shirt if none is named. Raises ValueError."""
    if not any(map(is_garment_file, options.garment)):
        demand_garment_file(options)
    return [
        _garment_of_file(word, options) if is_garment_file(word) else _tailored_garment(word)
        for word in dict.fromkeys(options.garment or [TSHIRT])
    ]


def _tailored_garment(name: str) -> ChosenGarment:
    template = find_template(name)
    return ChosenGarment(template.name, template.description, template.tailor)


def _garment_of_file(path: str, options: argparse.Namespace) -> ChosenGarment:
    from snug.garments.reading import read_garment  # a tailored garment needs no reader of meshes

    file = make_garment_file(path, options)

    def read(body: Body, *, vertices: int) -> Garment:
        return read_garment(file, body)

    return ChosenGarment(file.name, f"garment of {path}", read)


def output_files(out: Path, garments: Sequence[ChosenGarment]) -> list[Path]:
    """Return the model file of each garment.

    Raises ValueError for one that cannot be written: now rather than after the training.
    """
    files = [out]
    if len(garments) > 1:
        files = [out.with_name(f"{out.stem}-{garment.name}{out.suffix}") for garment in garments]
    if duplicate := next((path for path in files if files.count(path) > 1), None):
        raise ValueError(f"--garment: two of them would be {duplicate}: rename a file")
    for path in files:
        if path.is_dir():
            raise ValueError(f"--out {path}: is a folder; name a file")
        try:
            demand_writable_folder(path.parent)
        except ValueError as error:
            raise ValueError(f"--out {path}: {error}") from None
    return files


def choose_motions(options: argparse.Namespace, data: DataSet | None) -> tuple[list[Motion], list[Motion]]:
    """Return the motions to train on and those to validate with. Raises ValueError for an unknown name."""
    reading = parse_motion_options(options)
    motions = data.motions if data else [make_motion(name) for name in TRAIN]
    if options.motions:
        motions = load_motions(options.motions, options=reading)
    names = [motion.name for motion in motions]
    others = [
        name for name in (*VALIDATION, *DYNAMIC_VALIDATION, *CONTROL) if name not in names
    ]  # of the library: they never train
    for option, known in (("hold_out", names), ("validation", [*names, *others])):
        for name in getattr(options, option):
            if name not in known:
                raise ValueError(
                    f"--{option.replace('_', '-')} {name}: no such motion among {', '.join(known)}"
                )
    left_out = {*options.hold_out, *options.validation}
    training = [motion for motion in motions if motion.name not in left_out]
    validating = [motion for motion in motions if motion.name in options.validation]
    validating += [make_motion(name) for name in others if name in options.validation]
    return training, validating
