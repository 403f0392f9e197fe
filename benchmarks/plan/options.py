"""Options of commands that read a study: short forms of its fields, the text of --list.

Light, so --help answers at once.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from re import split
from textwrap import fill, indent, shorten
from typing import Any

from benchmarks.assets import LIBRARY
from benchmarks.declarations import attributes_of
from benchmarks.external.roll_out_files import parse_roll_out
from benchmarks.plan.choose_cells import matching, scenes_of_parts
from benchmarks.plan.plan import read_files
from benchmarks.plan.study import (
    Study,
    StudyError,
    Table,
    nearest,
    option,
    parse_setting,
    read_study,
    study_names,
)
from benchmarks.presets import PRESETS
from reference_sim.command_line import Parser
from snug.file_options import split_words

PROGRAM = "benchmarks.run"
EXAMPLES = """examples:
  python -m benchmarks.run            study default: all of it, small
  python -m benchmarks.run full       more motions, trainings, solvers and scenes
  python -m benchmarks.run smoke      everything once, tiny, about 2 minutes
  python -m benchmarks.run full:garments -o reports/runs/mine    one part of a study
  python -m benchmarks.run ./mine.toml --set sizes.frames=60     a study of your own (docs/run.md)
  python -m benchmarks.run --scenes 'tshirt/*' --methods ./mine.py,snug,simulation --seeds 0,1,2
  python -m benchmarks.run --motions mocap.bvh,up=z --garment shirt.obj,units=cm --body mine.npz

a folder that holds a run, also one that was killed, is gone on with: what is finished there for the same
  inputs and code is taken as it is. --retry does again what failed, --fresh everything.

exit status: 0 every task ended well or was skipped with a reason; 1 one failed, a line says why, and the rest
  went on; 2 the study cannot be run, one line says why; 130 interrupted, the same command goes on."""

SHORT = {  # field -> its placeholder in help; those of a scene first
    "motions": "PATH", "test_motions": "NAME,...", "body": "FILE", "garment": "FILE",
    "scenes": "NAME,...", "methods": "NAME,...", "seeds": "N,...", "rollouts": "NAME=FILE", "trained": "DIR",
}  # fmt: skip
OF_SCENES = tuple(SHORT)[:4]
SINGLE = ("body", "garment", "trained")  # given once
LONG, COLUMNS = 18, 110  # an overview has at most so many names of a section


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of benchmarks.run."""
    parser = Parser(
        prog=f"python -m {PROGRAM}",
        description="Run a study: dress a body, simulate the ground truth, train the networks, compare all "
        "methods and write tables, figures and a PDF.",
        epilog=EXAMPLES,
    )
    add = parser.add_argument
    add("study", nargs="?", default="default", metavar="STUDY",
        help="name of a study, or path of your own; :PART,... behind it for some parts (default: default)"
    )  # fmt: skip
    add_options(parser, tuple(SHORT))
    add("-o", "--out", metavar="DIR", help="folder of the run (default: a new one under reports/runs/)")
    add("--retry", action="store_true", help="repeat what failed in the folder, too")
    add("--fresh", action="store_true", help="reuse nothing from the folder")
    add("--workers", type=int, metavar="N",
        help="parallel processes for work that is not timed (default 2, or the number of cores if less); "
        "timed methods run alone")  # fmt: skip
    add("--list", nargs="?", const="", metavar="WORD",
        help="list studies, scenes, methods and motions with this word in their names; without a word, an "
        "overview; run nothing")  # fmt: skip
    add("--dry-run", action="store_true", help="say what would be run and what is cached; write nothing")
    return parser


def add_options(parser: argparse.ArgumentParser, short: Sequence[str] = OF_SCENES) -> None:
    """Add --set and short forms of these fields; every command has those of a scene."""
    texts = attributes_of(Study)
    parser.add_argument("--set", action="append", default=[], metavar="FIELD=VALUE", dest="settings",
        help="another value of a field of the study, as split=validation or sizes.frames=60; repeatable"
    )  # fmt: skip
    for field in short:
        kwargs: dict[str, Any] = {} if field in SINGLE else {"action": "append", "default": []}
        kwargs |= {"nargs": "?", "const": True} if field == "trained" else {}
        kwargs |= {"metavar": SHORT[field], "help": f"field {field}: {texts[field]}"}
        name = "rollout" if field == "rollouts" else field.replace("_", "-")
        parser.add_argument(f"--{name}", dest=field, **kwargs)


def study_of(options: argparse.Namespace, name: str = "full") -> Study:
    """Return the study of that name with the options of `add_options`. Raises ValueError."""
    return read_study(name, [*_tables(options), *map(parse_setting, options.settings)])


def _tables(options: argparse.Namespace) -> Iterator[Table]:
    """Yield the fields of short forms; words behind a path of motions are motion_files."""
    for field in SHORT:
        value: Any = getattr(options, field, None)
        if not value:
            continue
        if field == "garment":
            path, fields = split_words(value)
            value = {"path": path, **fields}
        elif field == "motions":
            paths = list(map(split_words, value))
            value = [path for path, _ in paths]
            tables = [table for path, table in paths if path != LIBRARY] or [{}]
            if any(table != tables[0] for table in tables):
                raise StudyError("motions: words behind a path hold for all files: give each the same")
            if tables[0]:
                yield option("motion_files", tables[0])
        elif field == "rollouts":
            pairs = list(map(parse_roll_out, value))
            if len(value := dict(pairs)) < len(pairs):
                raise StudyError(f"--rollout: {', '.join(n for n, _ in pairs)}: give each its own name")
        elif field not in SINGLE:
            parts = (part.strip() for text in value for part in text.split(","))
            value = list(filter(None, parts))
        if field == "seeds":
            value = [int(word) if word.removeprefix("-").isdecimal() else word for word in value]
        yield option(field, value)


def list_names(study: Study, word: str = "") -> str:
    """Return what can be named, a line each: all with `word` in their names, else an overview.

    Every scene and method can be named in every study. Those that take part without being named are those
    of the given study. A word may be a pattern. Raises StudyError where no name has it.
    """
    lines, sections = [], _sections(study)
    for title, rows in sections.items():
        named = {name: text for name, text in rows.items() if fnmatchcase(name, f"*{word}*")}
        width = max(map(len, named), default=0)
        lines += [title] if named else []
        if word or (len(named) < LONG and any(named.values())):
            room = 1000 if word else COLUMNS
            for name, text in named.items():
                lines.append(f"  {name:<{width}}  {shorten(text, room, placeholder=' ...')}".rstrip())
        else:
            families = Counter(split("[-+/_]", name)[0] for name in named).most_common()
            texts = [f"{name}* ({count})" for name, count in families[:LONG]]
            texts += [f"{len(families) - LONG} more"] * (len(families) > LONG)
            lines.append(indent(fill(", ".join(texts), COLUMNS), "  "))
    if not lines:
        names = [name for rows in sections.values() for name in rows]
        raise StudyError(f"--list {word}: {nearest(word, names, 'no name has it; see --list')}")
    return "\n".join(lines if word else [*lines, "Each by its name: --list WORD"])


def _sections(study: Study) -> dict[str, dict[str, str]]:
    """Return title -> name -> text of what can be named."""
    scope = read_files(study)
    motions, parts = scope.motions, study.parts
    clip = f"{motions.garments[0].garment}/{motions.measured[0]}@clip"
    scenes = {
        scene.name: scene.description + (f" ({motions.role_of(scene.motion)})" if scene.dressed else "")
        for scene in scope.scenes.values()
        if not scene.name.endswith("@clip")
    }
    methods = {}
    for name, entry in scope.methods.items():
        homes = ", ".join(part for part in parts if matching([name], parts[part].methods))
        methods[name] = f"{entry.description} [{homes or 'when named'}]"
    listed = {part: ", ".join(names) for part, names in scenes_of_parts(scope).items() if names}
    return {
        "studies": {name: read_study(name).question for name in study_names()},
        "parts of this study": {name: part.question for name, part in parts.items()},
        "scenes of each part where none is named": listed,
        f"scenes; of a dressed body, in a measured motion, also its liveliest part, as in {clip}": scenes,
        "methods, and the parts in which they take part without being named": methods,
        "training motions": dict.fromkeys(motions.train, ""),
        "sizes": {preset.name: preset.description for preset in PRESETS},
        "known answers": {case.name: f"{case.description} [{case.suite}]" for case in scope.cases},
    }
