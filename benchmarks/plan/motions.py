"""Which motions train, which validate and which test: docs/protocol.md says what that means."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

from benchmarks.plan.study import Study, StudyError, nearest
from benchmarks.scenes import GARMENT_SCENES, GarmentScenes, find_garment
from snug.motion.library import (
    DYNAMIC_TEST,
    DYNAMIC_VALIDATION,
    LIBRARY,
    TEST,
    TRAIN,
    VALIDATION,
    clip_of,
)


@dataclass(frozen=True)
class Motions:
    """Names of the motions of a run by their roles.

    files: those that came from a user's files. garments: those of the run; the first is that of a run
    where none is named. split: role whose motions stand in the suites' scenes, "test" or "validation".
    few: so many of them, the first, stand there; None: all.
    dynamic: of garments that swing, those that validate, and test.
    """

    train: tuple[str, ...] = ()
    test: tuple[str, ...] = ()
    validation: tuple[str, ...] = ()
    files: Collection[str] = ()
    garments: tuple[GarmentScenes, ...] = GARMENT_SCENES
    split: str = "test"
    few: int | None = None
    dynamic: tuple[tuple[str, ...], ...] = (DYNAMIC_VALIDATION, DYNAMIC_TEST)

    def roles(self, *, dynamic: bool = False) -> dict[str, tuple[str, ...]]:
        """Return role -> names of the motions, or of those of garments that swing."""
        validation, test = self.dynamic if dynamic else (self.validation, self.test)
        return {"train": self.train, "validation": validation, "test": test}

    @property
    def measured(self) -> tuple[str, ...]:
        """Those of the split."""
        return self.roles()[self.split][: self.few]

    def role_of(self, motion: str) -> str:
        """Return its role: "training", "validation", "test", or empty."""
        for role in ("test", "validation", "train"):
            if motion in (*self.roles()[role], *self.roles(dynamic=True)[role]):
                return "training" if role == "train" else role
        return ""

    def by_role(self, garment: str) -> dict[str, tuple[str, ...]]:
        """Return role -> names of a garment's motions."""
        return self.roles(dynamic=find_garment(garment, self.garments).dynamic)

    def pick_motions(self, garment: str) -> tuple[str, ...]:
        """Return the names of a garment's motions of the split."""
        return self.by_role(garment)[self.split][: self.few]


def split_motions(study: Study, files: Collection[str] = ()) -> Motions:
    """Return which motions train, validate and test; `files` are those of a user's files.

    Where the study names none, those of the library test and validate, and of files alone the first in
    the order of names tests. The library takes part where motions name it, or no file.

    Validation and test motions of the library never train, and its test motions never validate: where a
    part of a recorded clip is measured, no other part of it trains. Where nothing is left, the library
    trains. Test clips of a published split test, unless the study names others, and never train.

    Raises:
        StudyError: a name that no motion has, or a split without motions.
    """
    published = study.motion_files.clips("test")
    if published and not study.test_motions:
        study = replace(study, test_motions=tuple(name for name in published if name in files))
        if not study.test_motions:
            raise StudyError(f"motion_files.split: no test clip can be read: {', '.join(published)}")
    library = "library" in study.motions or not files
    of_library = (*VALIDATION, *TEST) if library else ()
    learned = dict.fromkeys((*sorted(files), *(TRAIN if library else ())))
    names = list(dict.fromkeys((*learned, *(LIBRARY if library else ()))))
    tested = {clip_of(name) for name in (*study.test_motions, *(TEST if library else ()))}
    roles: dict[str, tuple[str, ...]] = {}
    for role, chosen in (("test", study.test_motions), ("validation", study.validation_motions)):
        for name in chosen:
            if name not in names:
                raise StudyError(f"{role}_motions: unknown motion '{name}'; {nearest(name, names)}")
            if role == "validation" and clip_of(name) in tested:
                raise StudyError(f"{role}_motions: '{name}' is a test motion; choose others")
        roles[role] = tuple(name for name in names if name in chosen)
    test, validation = roles["test"], roles["validation"]
    dynamic = (validation or DYNAMIC_VALIDATION, test or DYNAMIC_TEST)
    if library:
        test = test or TEST
        validation = validation or tuple(name for name in VALIDATION if clip_of(name) not in tested)
    test = test or tuple(name for name in learned if name not in validation)[:1]
    held_out = {clip_of(name) for name in (*test, *validation, *of_library, *published)}
    train = tuple(name for name in learned if clip_of(name) not in held_out)
    train = train or tuple(name for name in TRAIN if name not in held_out)
    split, sizes = study.split, study.sizes
    # Whoever names motions means all of them, whatever the sizes.
    limit = None if getattr(study, f"{split}_motions") else sizes.test_motions
    train = train[: sizes.train_motions]
    motions = Motions(train, test, validation, tuple(files), split=split, few=limit, dynamic=dynamic)
    if not motions.measured:
        raise StudyError(f"split: no motion has this role; name some by {split}_motions")
    return motions
