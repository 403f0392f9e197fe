"""Which motions train, which validate and which test: docs/protocol.md says what that means."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from benchmarks.plan.study import Study, StudyError, nearest
from benchmarks.scenes import GARMENT_SCENES, GarmentScenes, of_garment


@dataclass(frozen=True)
class Motions:
    """Names of the motions of a run by their roles.

    files: those that came from a user's files. dynamic_*: those measured of garments that swing. worn: the
    garments of the run; the first is that of a run where none is named. split: the role whose motions stand
    in the suites' scenes, "test" or "validation". few: so many of them, the first, stand there; None: all.
    """

    train: tuple[str, ...] = ()
    test: tuple[str, ...] = ()
    files: Collection[str] = ()
    dynamic_test: tuple[str, ...] = ()
    worn: tuple[GarmentScenes, ...] = GARMENT_SCENES
    validation: tuple[str, ...] = ()
    dynamic_validation: tuple[str, ...] = ()
    split: str = "test"
    few: int | None = None

    @property
    def measured(self) -> tuple[str, ...]:
        """Those of the split."""
        return (self.test if self.split == "test" else self.validation)[: self.few]

    @property
    def dynamic_measured(self) -> tuple[str, ...]:
        """The same for garments that swing."""
        return (self.dynamic_test if self.split == "test" else self.dynamic_validation)[: self.few]

    def role_of(self, motion: str) -> str:
        """Return its role: "training", "validation", "test", or empty where it has none in this run."""
        roles = {
            "test": (*self.test, *self.dynamic_test),
            "validation": (*self.validation, *self.dynamic_validation),
            "training": self.train,
        }
        return next((role for role, names in roles.items() if motion in names), "")

    @property
    def first_garment(self) -> str:
        """The name of the first one."""
        return self.worn[0].garment

    def by_role(self, garment: str) -> dict[str, tuple[str, ...]]:
        """Return role -> names of a garment's motions."""
        if of_garment(garment, self.worn).dynamic:
            return {"train": self.train, "validation": self.dynamic_validation, "test": self.dynamic_test}
        return {"train": self.train, "validation": self.validation, "test": self.test}

    def measured_of(self, garment: str) -> tuple[str, ...]:
        """Return the names of a garment's motions of the split."""
        return self.by_role(garment)[self.split][: self.few]


def split_motions(study: Study, files: Collection[str] = ()) -> Motions:
    """Return which motions train, validate and test.

    Args:
        study: names of those that test and validate; without any, those of the library do, and of files alone
            the first in the order of names tests. The library takes part where it is named among the motions,
            or where no file is. Its sizes say how many motions of the library each role has.
        files: names of the motions of a user's files.

    Validation and test motions of the library never train, and its test motions never validate: where a part
    of a recorded clip is measured, no other part of that clip trains. Where nothing is left to train on, the
    library trains.

    Raises:
        StudyError: a name that no motion has, or a split without motions.
    """
    from snug.motion.library import (
        DYNAMIC_TEST,
        DYNAMIC_VALIDATION,
        LIBRARY,
        TEST,
        TRAIN,
        VALIDATION,
        clip_of,
    )

    test_names, validation_names = study.test_motions, study.validation_motions
    with_library = "library" in study.motions or not files
    learned = dict.fromkeys((*sorted(files), *(TRAIN if with_library else ())))
    names = list(dict.fromkeys((*learned, *(LIBRARY if with_library else ()))))
    for field, chosen in (("test_motions", test_names), ("validation_motions", validation_names)):
        for name in chosen:
            if name not in names:
                raise StudyError(f"{study.place(field)}: unknown motion '{name}'; {nearest(name, names)}")
    tested = {clip_of(name) for name in (*test_names, *(TEST if with_library else ()))}
    for name in validation_names:
        if clip_of(name) in tested:
            place = study.place("validation_motions")
            raise StudyError(f"{place}: '{name}' is a test motion; choose others")
    # Whoever names motions means all of them, whatever the sizes.
    named = test_names if study.split == "test" else validation_names
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
        train=train[: study.sizes.train_motions],
        test=test,
        files=tuple(files),
        dynamic_test=DYNAMIC_TEST,
        validation=validation,
        dynamic_validation=DYNAMIC_VALIDATION,
        split=study.split,
        few=None if named else study.sizes.test_motions,
    )
    if not motions.measured:
        raise StudyError(
            f"{study.place('split')}: no motion has this role; name some by {study.split}_motions"
        )
    return motions
