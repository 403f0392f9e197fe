"""Options of commands that read a study: short forms of its fields, former ones, the text of --list.

Light, so that --help answers at once.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from benchmarks.declarations import attributes_of
from benchmarks.external.roll_out_files import parse_roll_out
from benchmarks.methods import METHODS
from benchmarks.plan.choose_cells import expanded, matching
from benchmarks.plan.motions import split_motions
from benchmarks.plan.study import Layer, Study, option, parse_setting, read_study, study_names
from benchmarks.presets import PRESETS
from benchmarks.scenes import FURTHER_SCENES, GARMENT_SCENES, SCENES
from benchmarks.scenes.variations import shapes, there_and_back
from benchmarks.validation.registry import CASES
from reference_sim.command_line import Parser
from snug.file_options import split_words

PROGRAM = "benchmarks.run"
EXAMPLES = """examples:
  python -m benchmarks.run                                    study default: garments, and a part of others
  python -m benchmarks.run --trained                          the same without training
  python -m benchmarks.run smoke                              everything once, tiny, about 2 minutes
  python -m benchmarks.run full:garments -o reports/runs/mine       one part of a study
  python -m benchmarks.run ./mine.toml --set sizes.frames=60        a study of your own (docs/run.md)
  python -m benchmarks.run full:speed --scenes hanging_sheet --methods simulation,newton-4
  python -m benchmarks.run --scenes 'tshirt/*' --methods snug,skinning,simulation --seeds 0,1,2
  python -m benchmarks.run --methods ./mine.py,snug,simulation --set metrics=./my_metric.py
  python -m benchmarks.run --motions clips/ --test-motions 01_01
  python -m benchmarks.run -o reports/runs/mine --dry-run     what is finished there, what would be run
  python -m benchmarks.run --motions mocap.bvh,up=z,repair
  python -m benchmarks.run --scenes tshirt/kick --methods simulation,skinning --rollout mine=out.npz,ms=2.2
  python -m benchmarks.run --seeds 0,1,2 --scheduler tcp://10.0.0.1:8786
  python -m benchmarks.run full:garments --garment shirt.obj,units=cm --body mine.npz

a folder that holds a run is gone on with: what is finished there for the same inputs and code is taken
  as it is, the rest is done. A run that was killed is so taken up again. --only failed does again what
  failed, --fresh everything.

exit status: 0 when every cell ended as ok or as an explained skip (in extremes a failure reported with
  its reason is an accepted outcome); 1 when a cell, a training or a simulation failed: a line says why
  and the rest went on; 2 when the study cannot be run, also where another run is going on in the
  folder: one line says why and nothing is left behind; 130 when it was interrupted: what had ended is
  in the folder, whole, and the same command goes on from there."""

SHORT = {  # field -> its placeholder in help; those of a scene first
    "motions": "PATH", "test_motions": "NAME,...", "body": "FILE", "garment": "FILE",
    "scenes": "NAME,...", "methods": "NAME,...", "seeds": "N,...", "rollouts": "NAME=FILE", "trained": "DIR",
}  # fmt: skip
OF_SCENES = tuple(SHORT)[:4]
SINGLE = ("body", "garment", "trained")  # given once
REPLACED = {  # former option -> field of a study
    "--preset": "name a study (smoke, paper), or --set sizes=NAME",
    "--suite": "name parts of a study: python -m benchmarks.run full:NAME",
    "--metrics": "--set metrics=FILE",
    "--split": "--set split=validation",
    "--frames": "--set sizes.frames=N",
    "--device": "--set device=cuda",
    "--self-contact": "--set self_contact=true",
    "--validation-motions": "--set validation_motions=NAME,...",
    "--motion-up": "--motions PATH,up=z",
    "--motion-fps": "--motions PATH,fps=N",
    "--joint-map": "--motions PATH,joint_map=FILE",
    "--repair": "--motions PATH,repair",
    "--units": "ROLLOUT,units=cm",
    "--up": "ROLLOUT,up=z",
    "--fps": "ROLLOUT,fps=N",
    "--match-vertices": "ROLLOUT,match-vertices",
    "--other-mesh": "ROLLOUT,other-mesh",
    "--declared-ms": "ROLLOUT,ms=N",
    "--name": "NAME=ROLLOUT",
    **{f"--garment-{word}": f"--garment FILE,{word.replace('-', '_')}=..."
       for word in ("units", "up", "shift", "rest", "uv-scale", "material")},
}  # fmt: skip


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of benchmarks.run."""
    parser = Parser(
        replaced=REPLACED,
        prog=f"python -m {PROGRAM}",
        description="Run a study: dress a body, simulate the ground truth, train the networks, compare all "
        "methods and write tables, figures and a PDF.",
        epilog=EXAMPLES,
    )
    add = parser.add_argument
    add("study", nargs="?", default="default", metavar="STUDY",
        help="name of a study, or path of your own; :PART,... behind it for some parts (default: default)"
    )  # fmt: skip
    add_study_options(parser, tuple(SHORT))
    add("-o", "--out", metavar="DIR", help="folder of the run (default: a new one under reports/runs/)")
    add("--only", action="append", default=[], metavar="STATE,...",
        help="tasks of the folder that are repeated: failed, stale or missing (default stale,missing); the "
        "others are reused")  # fmt: skip
    add("--fresh", action="store_true", help="reuse nothing from the folder")
    add("--workers", type=int, metavar="N",
        help="parallel processes for work that is not timed (default 2, or the number of cores if less); "
        "timed methods run alone")  # fmt: skip
    add("--scheduler", metavar="ADDRESS",
        help="a cluster of dask.distributed, as tcp://HOST:8786, for work that is not timed; timed methods "
        "run here (docs/scale.md)")  # fmt: skip
    add("--list", action="store_true", help="list studies, scenes, methods and motions; run nothing")
    add("--dry-run", action="store_true", help="say what would be run and what is cached; write nothing")
    return parser


def add_study_options(parser: argparse.ArgumentParser, fields: Sequence[str] = OF_SCENES) -> None:
    """Add --set and the short forms of these fields; those of a scene are the same in every command."""
    texts = attributes_of(Study)
    parser.add_argument("--set", action="append", default=[], metavar="FIELD=VALUE", dest="settings",
        help="another value of a field of the study, as split=validation or sizes.frames=60; repeatable"
    )  # fmt: skip
    for field in fields:
        more: dict[str, Any] = {} if field in SINGLE else {"action": "append", "default": []}
        more |= {"nargs": "?", "const": True} if field == "trained" else {}
        name = "--rollout" if field == "rollouts" else f"--{field.replace('_', '-')}"
        parser.add_argument(
            name, dest=field, metavar=SHORT[field], help=f"field {field}: {texts[field]}", **more
        )


def study_of(options: argparse.Namespace, name: str = "default") -> Study:
    """Return the study of that name with the options of `add_study_options`. Raises ValueError."""
    return read_study(name, [*_layers(options), *map(parse_setting, options.settings)])


def _layers(options: argparse.Namespace) -> Iterator[Layer]:
    for field in SHORT:
        if not (given := getattr(options, field, None)):
            continue
        label = f"--{field.replace('_', '-')}"
        value: Any = given if field in (*SINGLE, "motions") else split(given)
        if field == "seeds":
            value = [_whole_number(word) for word in value]
        if field == "garment":
            path, words = split_words(given)
            value = {"path": path, **words}
        if field == "motions":
            value, words = zip(*map(split_words, given))
            if any(words):
                yield option(label, "motion_files", {n: v for one in words for n, v in one.items()})
        if field == "rollouts":
            label, value = "--rollout", dict(map(parse_roll_out, given))
        yield option(label, field, list(value) if isinstance(value, tuple) else value)


def _whole_number(word: str) -> int | str:
    return int(word) if word.removeprefix("-").isdecimal() else word


def split(values: Sequence[str]) -> tuple[str, ...]:
    """Return repeated and comma-separated values one by one.

    >>> split(["snug,pbns", "skinning"])
    ('snug', 'pbns', 'skinning')
    """
    return tuple(word.strip() for value in values for word in value.split(",") if word.strip())


def list_names(study: Study) -> str:
    """Return studies, scenes, methods, motions, sizes and cases, one line each.

    Every scene and method can be named in every study. Those that take part without being named are those of
    the given study.
    """
    from snug.motion.library import CLIPS, CONTROL, DYNAMIC_TEST, DYNAMIC_VALIDATION, TEST, TRAIN, VALIDATION

    swinging = dict.fromkeys(DYNAMIC_TEST, "test") | dict.fromkeys(DYNAMIC_VALIDATION, "validation")
    roles = dict.fromkeys(TEST, "test") | dict.fromkeys(VALIDATION, "validation") | swinging
    dressed = [
        (scene.name, f"{scene.description} ({role})")
        for scenes in GARMENT_SCENES
        for motion, role in (swinging if scenes.dynamic else roles).items()
        for scene in (scenes.scene(motion),)
    ]
    plain = (*SCENES, there_and_back(TEST[0]), *shapes(TEST[0]), *FURTHER_SCENES)
    motions = split_motions(study)
    found = [
        *dict.fromkeys((*(s.name for s in plain), *(n + clip for n, _ in dressed for clip in ("", "@clip"))))
    ]
    taken = {name: matching(found, expanded(part.scenes, motions)) for name, part in study.parts.items()}
    parts = (
        ("studies", ((name, read_study(name).question) for name in study_names())),
        ("parts of this study", ((name, part.question) for name, part in study.parts.items())),
        ("scenes of each part where none is named", ((n, ", ".join(s)) for n, s in taken.items() if s)),
        (
            f"scenes; of a dressed body, in a test or validation motion, also its liveliest part, as "
            f"{dressed[0][0]}@clip",
            [*((s.name, s.description) for s in plain), *dressed],
        ),
        (
            "methods, and the parts in which they take part without being named",
            ((m.name, f"{m.description} [{_parts_of(m.name, study) or 'when named'}]") for m in METHODS),
        ),
        (
            "training motions",
            ((name, f"{CLIPS[name].content}, {CLIPS[name].frames} frames") for name in TRAIN),
        ),
        ("motions without a role", ((name, "") for name in CONTROL)),
        ("sizes", ((p.name, p.description) for p in PRESETS)),
        *((f"cases of part {name}", _cases(name)) for name in dict.fromkeys(c.suite for c in CASES)),
    )
    return "\n\n".join(_section(title, rows) for title, rows in parts)


def _parts_of(method: str, study: Study) -> str:
    return ", ".join(name for name, part in study.parts.items() if matching([method], part.methods))


def _cases(suite: str) -> list[tuple[str, str]]:
    """Return the cases of a suite; those that share a scene in one line."""
    by_scene: dict[str, list[str]] = {}
    for case in (case for case in CASES if case.suite == suite):
        by_scene.setdefault(f"{case.scene}/*" if case.scene else case.name, []).append(case.description)
    return [(name, f"{len(d)} points, {d[0]} the first" if d[1:] else d[0]) for name, d in by_scene.items()]


def _section(title: str, rows: Iterable[tuple[str, str]]) -> str:
    rows = list(rows)
    if not any(description for _, description in rows):
        return f"{title}\n  {', '.join(name for name, _ in rows)}"
    width = max(len(name) for name, _ in rows)
    return "\n".join([title, *(f"  {name:<{width}}  {description}".rstrip() for name, description in rows)])
