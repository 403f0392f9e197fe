"""Which motions train, which validate and which test: docs/protocol.md says what that means."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Sequence

from benchmarks.plan.plan import Motions, PlanError
from benchmarks.presets import Preset


def split_motions(
    files: Collection[str],
    test_names: Sequence[str],
    preset: Preset,
    *,
    library: bool = False,
    validation_names: Sequence[str] = (),
    split: str = "test",
) -> Motions:
    """Return which motions train, validate and test.

    Args:
        files: names of the motions of a user's files.
        test_names: motions that test; without any, those of the library do, and of files alone the first in
            the order of names.
        preset: how many motions of the library each role has.
        library: whether the embedded library is named; without files it takes part unnamed.
        validation_names: motions that validate; without any, those of the library do.
        split: the role whose motions are measured, "test" or "validation".

    Validation and test motions of the library never train, and its test motions never validate: where a part
    of a recorded clip is measured, no other part of that clip trains. Where nothing is left to train on, the
    library trains.

    Raises:
        PlanError: a name that no motion has, or a split without motions.
    """
    from snug.motion.library import DYNAMIC_TEST, DYNAMIC_VALIDATION, LIBRARY, TEST, TRAIN, VALIDATION
    from snug.motion.recorded.table import clip_of

    with_library = library or not files
    learned = dict.fromkeys((*sorted(files), *(TRAIN if with_library else ())))
    names = list(dict.fromkeys((*learned, *(LIBRARY if with_library else ()))))
    for option, chosen in (("--test-motions", test_names), ("--validation-motions", validation_names)):
        for name in chosen:
            if name not in names:
                raise PlanError(f"{option}: unknown motion '{name}'; {nearest(name, names)}")
    tested = {clip_of(name) for name in (*test_names, *(TEST if with_library else ()))}
    for name in validation_names:
        if clip_of(name) in tested:
            raise PlanError(f"--validation-motions: '{name}' is a test motion; choose others")
    # Whoever names motions means all of them, whatever the size of the preset.
    named = test_names if split == "test" else validation_names
    test = tuple(name for name in names if name in test_names)
    if not test:
        test = TEST if with_library else tuple(n for n in learned if n not in validation_names)[:1]
    validation = tuple(name for name in names if name in validation_names)
    if with_library and not validation:
        validation = tuple(name for name in VALIDATION if clip_of(name) not in tested)
    of_library = (*VALIDATION, *TEST) if with_library else ()
    held_out = {clip_of(name) for name in (*test, *validation, *of_library)}
    train = tuple(name for name in learned if clip_of(name) not in held_out)
    train = train or tuple(name for name in TRAIN if name not in held_out)
    motions = Motions(
        train=train[: preset.train_motions],
        test=test,
        files=tuple(files),
        dynamic_test=DYNAMIC_TEST,
        validation=validation,
        dynamic_validation=DYNAMIC_VALIDATION,
        split=split,
        few=None if named else preset.test_motions,
    )
    if not motions.measured:
        raise PlanError(f"--split {split}: no motion has this role; name some by --{split}-motions")
    return motions


def nearest(word: str, names: Sequence[str]) -> str:
    """Return the names that a wrong word may have meant, as the end of a message."""
    near = difflib.get_close_matches(word, names, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(near)}?" if near else "see --list"
