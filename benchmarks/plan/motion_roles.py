"""Which motions train, which validate and which test: docs/protocol.md says what that means."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from typing import TYPE_CHECKING

from benchmarks.plan.plan import Motions, PlanError
from benchmarks.presets import Preset

if TYPE_CHECKING:
    from snug.motion.motion import Motion
    from snug.motion.options import MotionFileOptions

FEWEST = 3  # frames of a motion: inertia needs two before the one that is judged


def choose_motions(
    paths: Sequence[str],
    test_names: Sequence[str],
    preset: Preset,
    reading: MotionFileOptions | None = None,
    *,
    validation_names: Sequence[str] = (),
    split: str = "test",
) -> Motions:
    """Which motions train, validate and test. Raises PlanError (or the reader's own error) for a bad request.

    Without paths: the embedded library with its own division. With paths: the files alone, plus the library
    where "library" is among the paths. test_names, validation_names: motions that are given these roles;
    without them those of the library have them, and of files alone the first in order of names tests. Where
    nothing is left to train on, the library trains. The validation and test motions of the library never
    train, and its test motions never validate. reading: what the files do not say.
    """
    from snug.motion import library
    from snug.motion.library import LIBRARY, TEST, TRAIN, VALIDATION

    files: dict[str, Motion] = {}
    for path in paths:
        for motion in _motions_in(path, reading) if path != "library" else ():
            if motion.name in files or motion.name in LIBRARY:
                raise PlanError(f"--motions {path}: the name '{motion.name}' is taken; rename the file")
            if motion.frames < FEWEST:
                raise PlanError(f"--motions {path}: {motion.frames} frames; at least {FEWEST} are needed")
            files[motion.name] = motion
    with_library = not paths or "library" in paths
    names = [*sorted(files), *((*TRAIN, *VALIDATION, *TEST) if with_library else ())]
    for option, chosen in (("--test-motions", test_names), ("--validation-motions", validation_names)):
        for name in chosen:
            if name not in names:
                raise PlanError(f"{option}: unknown motion '{name}'; {nearest(name, names)}")
    for name in validation_names:
        if name in (*test_names, *TEST):
            raise PlanError(f"--validation-motions: '{name}' is a test motion; choose others")
    # Whoever names motions means all of them, whatever the size of the preset.
    few, fewer = preset.train_motions, preset.test_motions
    test = tuple(name for name in names if name in test_names)
    if not test:
        test = TEST[:fewer] if with_library else tuple(n for n in names if n not in validation_names)[:1]
    validation = tuple(name for name in names if name in validation_names)
    if with_library and not validation:
        validation = tuple(name for name in VALIDATION if name not in test)[:fewer]
    held_out = (*test, *validation, *VALIDATION, *TEST)
    train = tuple(name for name in names if name not in held_out)
    train = train or tuple(name for name in TRAIN if name not in held_out)
    motions = Motions(
        train[:few], test, files, library.DYNAMIC_TRAIN[:few], library.DYNAMIC_TEST[:fewer],
        validation=validation, dynamic_validation=library.DYNAMIC_VALIDATION[:fewer], split=split,
        chosen=bool(paths or (test_names if split == "test" else validation_names)),
    )  # fmt: skip
    if not motions.measured:
        raise PlanError(f"--split {split}: no motion has this role; name some by --{split}-motions")
    return motions


def _motions_in(path: str, reading: MotionFileOptions | None) -> list[Motion]:
    from snug.motion.files import load_motions  # its readers are slow to load

    return load_motions(path, options=reading)


def nearest(word: str, names: Sequence[str]) -> str:
    """What a wrong word may have meant, as the end of a message."""
    near = difflib.get_close_matches(word, names, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(near)}?" if near else "see --list"
