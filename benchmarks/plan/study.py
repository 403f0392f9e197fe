"""Study: everything that is asked of a run, read from a TOML file and from options.

Every field is an attribute of a dataclass, whose type says what it takes.
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from types import UnionType
from typing import Any, Literal, NoReturn, TypeVar, get_args, get_origin, get_type_hints

from benchmarks.assets import FEWEST_FRAMES, LIBRARY
from benchmarks.external.roll_out_files import RollOutOption
from benchmarks.presets import Preset, find_preset
from snug.file_options import GarmentFile, MotionFileOptions
from snug.trained import FOLDER

PARTS = ("garments", "speed", "validation", "extremes", "shapes")  # that reports know


class StudyError(ValueError):
    """A field of a study that cannot be meant; the message names its place and what there is instead."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """Scenes that meet methods, and known answers; its name is the column `suite` of its rows.

    A pattern has `*`, `?` or `[..]`; one that begins with `!` takes names out. In scenes, {garment} stands
    for the first garment, {motion} for each measured motion of a scene's garment, {motion 1} for the first
    of them, {swinging 1} for the first of a garment that swings.

    Attributes:
        question: what it answers, one line.
        scenes: names, patterns and files of scenes.
        optional_scenes: those that take part only where field `scenes` of the study names them.
        methods: names, patterns and files of methods.
        cases: names, patterns and files of known answers; {smoke} for those marked so, {short} for all but
            long.
    """

    question: str = ""
    scenes: tuple[str, ...] = ()
    optional_scenes: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()
    cases: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Show:
    """Pictures and films of a published run that the documents show, besides its rows, tables and PDF.

    Attributes:
        pictures: names of figures of the report.
        films: file -> options of reports.film.
    """

    pictures: tuple[str, ...] = ()
    films: Mapping[str, str] = field(default_factory=dict)

    @property
    def files(self) -> tuple[str, ...]:
        """Names of all these files in the folder `figures` of a report."""
        return (*(f"{name}.png" for name in self.pictures), *self.films)


@dataclass(frozen=True, kw_only=True)
class Study:
    """Question, and all that is run to answer it. Each attribute is a field of the file.

    written: the fields as they were read, for run.json.

    Attributes:
        question: what it answers, one line.
        parts: name -> scenes that meet methods.
        sizes: smoke, quick or paper; or a table of changes to one of them, which `base` names.
        scenes: only these: names, patterns, files (mine.py) of scenes; without any all of the parts.
        methods: these in every part, in place of its own: names, patterns, files (mine.py) of methods.
        metrics: files of your own metrics, measured besides all others.
        seeds: seeds of training.
        motions: motion files (.npz, .bvh, .amc with .asf), folders, or the word library (default).
        motion_files: what motion files do not state: up, fps.
        test_motions: names of the motions that test; by default those of the library.
        validation_motions: names of the motions that validate; neither these nor those that test train.
        split: which motions are measured: test, or validation, to choose recipes by.
        body: your own body of SMPL's family, .npz or .pkl; garments are made for it.
        garment: your own garment (OBJ, PLY), made for the body, in place of the T-shirt; or a table:
            path, units, up, shift, rest, uv_scale, material.
        self_contact: whether the cloth of simulations is kept from crossing itself (needs ipctk).
        trained: networks of the package (true), or of the run in a folder, in place of training; methods
            whose network is not there are skipped, those of your own files trained.
        rollouts: name -> file of another program's roll-out, as a method; or a table: path, units, up, fps,
            other_mesh, ms. The path may have {scene}, the scene's name with hyphens for slashes.
        device: where networks train, cpu or cuda.
        show: pictures and films that the documents show; a study that has it is published.
    """

    question: str = ""
    parts: Mapping[str, Part] = field(default_factory=dict)
    sizes: Preset = field(default_factory=lambda: find_preset("quick"))
    scenes: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()
    metrics: tuple[str, ...] = ()
    seeds: tuple[int, ...] = (0,)
    motions: tuple[str, ...] = ()
    motion_files: MotionFileOptions = field(default_factory=MotionFileOptions)
    test_motions: tuple[str, ...] = ()
    validation_motions: tuple[str, ...] = ()
    split: Literal["test", "validation"] = "test"
    body: Path | None = None
    garment: GarmentFile | None = None
    self_contact: bool = False
    trained: Path | None = None
    rollouts: Mapping[str, RollOutOption] = field(default_factory=dict)
    device: Literal["cpu", "cuda"] = "cpu"
    show: Show | None = None
    written: Mapping[str, Any] = field(default_factory=dict, repr=False, compare=False)
    origin: Callable[[tuple[str, ...]], str] = field(default=".".join, repr=False, compare=False)

    def place(self, *field: str) -> str:
        """Return where a field was said: a file and the field, or an option."""
        return self.origin(field)

    def refuse(self, message: str, *field: str) -> NoReturn:
        """Raise StudyError with the place of the field."""
        raise StudyError(f"{self.place(*field)}: {message}")

    def check(self) -> None:
        """Raise StudyError for numbers and names that no type refuses."""
        if not self.seeds or min(self.seeds) < 0 or max(self.seeds) >= 1 << 63:
            given = ",".join(map(str, self.seeds))[:40]
            wanted = "at least one whole number, none below 0 or beyond 63 bits"
            self.refuse(f"'{given}': give {wanted}", "seeds")
        if self.sizes.frames < FEWEST_FRAMES:
            self.refuse(f"{self.sizes.frames}: give {FEWEST_FRAMES} or more", "sizes", "frames")
        for name in self.parts:
            if name not in PARTS and not self.parts[name].question:
                known = f"no part is called so; choose from {', '.join(PARTS)}, or give it a question"
                self.refuse(known, "parts", name)


def nearest(word: str, names: Sequence[str], otherwise: str = "see --list") -> str:
    """Return the names that a wrong word may have meant, as the end of a message."""
    near = difflib.get_close_matches(word, names, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(near)}?" if near else otherwise


FILE = "study.toml"  # of a study that is a folder
PACKAGED = Path(__file__).parents[1] / "studies"
FOLDERS = (Path("studies"), Path(__file__).parents[2] / "studies")  # of studies that bring code
HIDDEN = {  # attributes that no file gives
    Study: ("written", "origin"), Preset: ("name", "description"), RollOutOption: ("role",),
}  # fmt: skip
WORDS_FOR_TABLES = {"garment": "path", "sizes": "base"}  # table -> the field that a word in its place means
KINDS = {str: "text", int: "a whole number", float: "a number", bool: "true or false"}
Field = tuple[str, ...]
Record = TypeVar("Record")


@dataclass(frozen=True)
class Layer:
    """Fields of one place: a file, or an option. The first that has a field decides.

    folder: of the file, to which its paths are relative; None of an option.
    """

    label: str
    table: dict[str, Any]
    folder: Path | None = None

    def has(self, field: Field) -> bool:
        """Return whether the field stands here."""
        table: Any = self.table
        for name in field:
            if not isinstance(table, Mapping) or name not in table:
                return False
            table = table[name]
        return True


def read_study(word: str = "default", options: Sequence[Layer] = ()) -> Study:
    """Return the study of that name or path, with fields from options in place of its own.

    Args:
        word: name of a study of the package, or path of a file or folder; behind a colon the names of parts,
            as in full:garments,speed, for these alone.
        options: later ones hold before earlier ones.

    Raises:
        StudyError: no such study, or a field that cannot be meant: its place, and what is near it.

    >>> read_study("full:speed", [option("--seeds", "seeds", [1, 2])]).seeds
    (1, 2)
    """
    name, _, chosen = word.partition(":")
    layers = [*reversed(options), *_layers(find_study(name))]
    merged: dict[str, Any] = {}
    for layer in reversed(layers):
        merged = _merged(merged, layer.table)
    merged.pop("like", None)
    if chosen:
        parts, names = merged.get("parts", {}), [part for part in chosen.split(",") if part]
        for part in names:
            if part not in parts:
                raise StudyError(f"study {name}: no part '{part}'; it has {', '.join(parts)}")
        merged["parts"] = {part: parts[part] for part in parts if part in names}
    reader = _Reader(layers)
    study: Study = reader.dataclass_of(Study, merged, ())
    study = replace(study, written={"name": word, **merged}, origin=reader.place)
    study.check()
    return study


def read_fields(kind: type[Record], path: Path) -> Record:
    """Return an object of a dataclass from a TOML file. Raises StudyError with file and field."""
    layer = replace(next(_layers(path)), folder=Path())
    record: Record = _Reader([layer]).dataclass_of(kind, layer.table, ())
    return record


def find_study(name: str) -> Path:
    """Return the file of a study. Raises StudyError."""
    path = Path(name)
    places = [PACKAGED / f"{name}.toml", path, path / FILE, *(folder / name / FILE for folder in FOLDERS)]
    for place in places:
        if place.is_file():
            return place
    raise StudyError(
        f"no study '{name}': name one, or a file or folder with {FILE}; {nearest(name, study_names())}; "
        "those that bring code are in the folder studies of a checkout"
    )


def study_names() -> list[str]:
    """Return the names of the package's studies, and of those with code that lie beside it."""
    with_code = {path.parent.name: None for folder in FOLDERS for path in sorted(folder.glob(f"*/{FILE}"))}
    return [*(path.stem for path in sorted(PACKAGED.glob("*.toml"))), *with_code]


def option(label: str, field: str, value: Any) -> Layer:
    """Return the layer of an option that gives one field, dotted where it is one of a table."""
    table = value
    for name in reversed(field.split(".")):
        table = {name: table}
    return Layer(label, _with_tables(table))


def parse_setting(text: str) -> Layer:
    """Return the layer of --set field=value. Raises StudyError.

    >>> parse_setting("sizes.frames=60").table, parse_setting("seeds=0,1").table
    ({'sizes': {'frames': 60}}, {'seeds': [0, 1]})
    """
    field, equals, value = text.partition("=")
    if not (field.strip() and equals and value.strip()):
        raise StudyError(f"--set {text}: give field=value, as in seeds=0,1,2 or sizes.frames=60")
    return option(f"--set {text}", field, _value(value.strip()))


def _value(text: str) -> Any:
    """Return a value of TOML, a list where there are commas, else the text."""
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except tomllib.TOMLDecodeError:
        return [_value(word.strip()) for word in text.split(",") if word.strip()] if "," in text else text


def _layers(path: Path) -> Iterator[Layer]:
    """Yield the fields of a file, then those of the study that it is like, and so on."""
    seen: list[Path] = []
    while path not in seen:
        seen.append(path)
        try:
            table = tomllib.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise StudyError(f"{path}: not readable as TOML ({' '.join(str(error).split())})") from None
        yield Layer(str(path), _with_tables(table), Path() if path.parent == PACKAGED else path.parent)
        if "like" not in table:
            return
        like = str(table["like"])
        beside = path.parent / like
        path = beside if beside.is_file() else find_study(str(beside) if beside.is_dir() else like)
    raise StudyError(f"{path}: like = '{like}': is like itself")


def _with_tables(table: dict[str, Any]) -> dict[str, Any]:
    """Return the fields with a table for each word that may stand in place of one."""
    meant = {name: WORDS_FOR_TABLES[name] for name in WORDS_FOR_TABLES if isinstance(table.get(name), str)}
    table = table | {name: {field: table[name]} for name, field in meant.items()}
    if isinstance(files := table.get("rollouts"), Mapping):
        table["rollouts"] = {n: {"path": v} if isinstance(v, str) else v for n, v in files.items()}
    return table


def _merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of both; tables are joined, all else is that of `above`."""
    merged = {**below, **above}
    for name, value in above.items():
        if isinstance(value, Mapping) and isinstance(below.get(name), Mapping):
            merged[name] = _merged(below[name], value)
    return merged


class _Reader:
    """Values of fields by the types of dataclasses."""

    def __init__(self, layers: Sequence[Layer]) -> None:
        self.layers = layers

    def layer(self, field: Field) -> Layer:
        """Return the layer that decides a field; of one that is absent, that of the file."""
        return next((layer for layer in self.layers if layer.has(field)), self.layers[-1])

    def place(self, field: Field) -> str:
        """Return where a field was said."""
        layer = self.layer(field)
        words = [] if layer.folder is None else [".".join(field)]
        return ": ".join(filter(None, [layer.label, *words]))

    def path(self, field: Field, name: str) -> Path:
        """Return a path; those of a file are relative to its folder."""
        return (self.layer(field).folder or Path()) / name

    def refuse(self, field: Field, message: str) -> NoReturn:
        """Raise StudyError with the place."""
        raise StudyError(f"{self.place(field)}: {message}")

    def dataclass_of(self, kind: Any, table: Any, field: Field) -> Any:
        """Return an object of a dataclass from the table of its fields; what it refuses gets its place."""
        table = self.table(table, field)
        if kind is RollOutOption:
            table |= {"name": field[-1], "path": str(self.path(field, str(table.get("path", ""))))}
        base = table.pop("base", "quick") if kind is Preset else ""
        declared = [f.name for f in fields(kind) if f.name not in HIDDEN.get(kind, ())]
        for name in table:
            if name not in declared:
                near = nearest(name, declared, otherwise=f"there are {', '.join(declared)}")
                self.refuse((*field, name), f"no field is called '{name}'; {near}")
        hints = get_type_hints(kind)
        try:
            table = _merged(asdict(find_preset(base)), table) if base else table
            return kind(**{name: self.value(hints[name], table[name], (*field, name)) for name in table})
        except StudyError:
            raise
        except (TypeError, ValueError) as error:
            self.refuse(field, str(error))

    def table(self, value: Any, field: Field) -> dict[str, Any]:
        """Return a copy of a table."""
        if not isinstance(value, Mapping):
            self.refuse(field, f"{value!r}: give a table")
        return dict(value)

    def value(self, hint: Any, value: Any, field: Field) -> Any:
        """Return the value of a field as its type asks for it."""
        origin, types = get_origin(hint), get_args(hint)
        if origin is UnionType:  # of a type and None
            return None if value is None else self.value(types[0], value, field)
        if field == ("trained",) and isinstance(value, bool):
            return FOLDER if value else None
        if origin is Literal:
            if value not in types:
                self.refuse(field, f"{value!r}: choose from {', '.join(types)}")
            return value
        if origin is tuple:
            values = value if isinstance(value, list | tuple) else [value]
            return tuple(self.value(types[0], v, field) for v in values)
        if origin in (dict, Mapping):
            table = self.table(value, field)
            return {name: self.value(types[1], v, (*field, name)) for name, v in table.items()}
        if is_dataclass(hint):
            return self.dataclass_of(hint, value, field)
        if hint is float and type(value) is int:
            return float(value)
        if type(value) is not (str if hint is Path else hint) or (hint is Path and not value):
            self.refuse(field, f"{value!r}: give {KINDS.get(hint, 'a path')}")
        if hint is Path:
            return self.path(field, value)
        file = hint is str and (value.endswith(".py") or (field == ("motions",) and value != LIBRARY))
        return str(self.path(field, value)) if file else value
