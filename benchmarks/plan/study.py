"""Study: all that is asked of a run, read from a TOML file and from options.

Every field is an attribute of a dataclass, whose type says what it takes.
"""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from types import UnionType
from typing import Any, Literal, NoReturn, get_args, get_origin, get_type_hints

from benchmarks.assets import FEWEST_FRAMES, LIBRARY
from benchmarks.external.roll_out_files import RollOutOption
from benchmarks.presets import Preset, find_preset
from reference_sim.given_files import check_values, parse_toml, read_toml
from snug.file_options import GarmentFile, MotionFileOptions
from snug.trained import FOLDER

PARTS = ("garments", "speed", "validation", "extremes", "shapes")  # that reports know
# Least values of sizes where they are not 1.
LEAST = {"frames": FEWEST_FRAMES, "warm_up_frames": 0, "simulated_mixed": 0}


class StudyError(ValueError):
    """A field of a study that cannot be meant; the message has its place and a remedy."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """Scenes that meet methods, and known answers; its name is the column `suite` of its rows.

    A pattern has `*`, `?` or `[..]`; one that begins with `!` takes names out. In scenes, {garment}
    stands for the first garment, {motion} behind a garment's whole name for each motion measured in it,
    {motion 1} for the first of them, {swinging 1} for the first of a garment that swings.

    Attributes:
        question: what it answers, one line.
        scenes: names, patterns and files of scenes.
        optional_scenes: those that take part only where field `scenes` of the study names them.
        methods: names, patterns and files of methods.
        cases: names, patterns and files of known answers; {smoke}: those marked so, {short}: not long.
    """

    question: str = ""
    scenes: tuple[str, ...] = ()
    optional_scenes: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()
    cases: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Show:
    """Content published of a run besides its rows, tables and PDF.

    Attributes:
        networks: names of networks whose seed 0 is kept, in half precision.
        pictures: names of figures of the report that the documents show.
        films: file -> options of reports.film.
        seeds: of the published run, by which one seed is judged; by default those of the study.
    """

    networks: tuple[str, ...] = ()
    pictures: tuple[str, ...] = ()
    films: Mapping[str, str] = field(default_factory=dict)
    seeds: tuple[int, ...] = ()

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the pictures and films in the folder `figures` of a report."""
        return (*(f"{name}.png" for name in self.pictures), *self.films)


@dataclass(frozen=True, kw_only=True)
class Study:
    """Question, and all that is run to answer it. Each attribute is a field of the file.

    written: the fields as they were read, for run.json.

    Attributes:
        question: what it answers, one line.
        parts: name -> scenes that meet methods.
        sizes: smoke, small, quick or paper; or a table of changes to one of them, which `base` names.
        scenes: only these: names, patterns, files (mine.py) of scenes; without any all of the parts.
        methods: these in every part, in place of its own: names, patterns, files (mine.py) of methods.
        metrics: files of your own metrics, measured besides all others.
        seeds: seeds of training.
        one_seed: patterns of methods trained with the first seed alone.
        motions: motion files (.npz, .bvh, .amc with .asf), folders, or the word library (default).
        motion_files: what motion files do not state: up, fps; split: snug or hood, that paper's clips alone.
        test_motions: names of the motions that test; by default those of the library.
        validation_motions: names of the motions that validate; neither these nor those that test train.
        split: which motions are measured: test, or validation, to choose recipes by.
        body: your own body of SMPL's family, .npz or .pkl; garments are made for it.
        garment: your own garment (OBJ, PLY), made for the body, in place of the T-shirt; or a table:
            path, units, up, shift, rest, uv_scale, material, weld.
        self_contact: whether the cloth of simulations is kept from crossing itself (needs ipctk).
        trained: networks of the package (true), or of the run in a folder, in place of training; methods
            whose network is not there are skipped, those of your own files trained.
        rollouts: name -> file of another program's roll-out, as a method; or a table: path, units, up,
            fps, other_mesh, ms. The path may have {scene}, the scene's name with hyphens for slashes.
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
    one_seed: tuple[str, ...] = ()
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

    def __post_init__(self) -> None:
        if not self.seeds or min(self.seeds) < 0 or max(self.seeds) >= 1 << 63:
            seeds = ",".join(map(str, self.seeds))[:40]
            remedy = "at least one whole number, none below 0 or beyond 63 bits"
            raise StudyError(f"seeds: '{seeds}': give {remedy}")
        if len(set(self.seeds)) < len(self.seeds):
            raise StudyError(f"seeds: {self.seeds}: give each once")
        sizes = vars(self.sizes) | {f"steps.{name}": n for name, n in self.sizes.steps.items()}
        sizes |= {f"dependence.{name}": size for name, size in vars(self.sizes.dependence).items()}
        for name, size in sizes.items():
            number = min(size, default=1) if isinstance(size, tuple) else size
            least = LEAST.get(name, 1)
            if isinstance(number, int) and number < least:
                raise StudyError(f"sizes.{name}: {number}: give {least} or more")
            if isinstance(number, float) and not 0.0 < number < math.inf:
                raise StudyError(f"sizes.{name}: {number}: give a number above 0")
        for name in self.parts:
            if name not in PARTS and not self.parts[name].question:
                remedy = f"choose from {', '.join(PARTS)}, or give it a question"
                raise StudyError(f"parts.{name}: no part is called so; {remedy}")


def nearest(word: str, names: Sequence[str], otherwise: str = "see benchmarks.run --list") -> str:
    """Return the names that a wrong word may have meant, as a message's end."""
    matches = difflib.get_close_matches(word, names, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(matches)}?" if matches else otherwise


FILE = "study.toml"  # of a study that is a folder
PACKAGED = Path(__file__).parents[1] / "studies"
FOLDERS = (Path("studies"), Path(__file__).parents[2] / "studies")  # of studies that bring code
# No file has them.
HIDDEN = {Study: ("written",), Preset: ("name", "description"), RollOutOption: ("role",)}
# Table -> the field that a word in its place means.
WORDS_FOR_TABLES = {"garment": "path", "sizes": "base"}
PATHS = ("body", "trained", "motions", "path", "material")  # fields that hold paths
OF_CODE = ("scenes", "optional_scenes", "methods", "metrics", "cases")  # and those that may name files
KINDS = {str: "text", int: "a whole number", float: "a number", bool: "true or false"}
Table = Mapping[str, Any]


def read_study(word: str = "full", options: Sequence[Table] = ()) -> Study:
    """Return the study of that name or path, with fields from options in place of its own.

    Args:
        word: name of a study of the package, or path of a file or folder; behind a colon the names of
            parts, as in full:garments,speed, for these alone.
        options: see `option`; later ones hold before earlier ones.

    Raises:
        StudyError: no such study, or a field that cannot be meant.

    >>> read_study("full:speed", [option("seeds", [1, 2])]).seeds
    (1, 2)
    """
    name, _, chosen = word.partition(":")
    table = _fields_of(find_study(name))
    for entry in options:
        table = _merge(table, _with_tables(entry))
    if chosen:
        parts, names = table.get("parts", {}), [part for part in chosen.split(",") if part]
        for part in names:
            if part not in parts:
                raise StudyError(f"study {name}: no part '{part}'; it has {', '.join(parts)}")
        table = {**table, "parts": {part: parts[part] for part in parts if part in names}}
    study: Study = _dataclass_of(Study, table)
    return replace(study, written={"name": word, **table})


def read_fields(kind: type, path: Path) -> Any:
    """Return a dataclass from a TOML file. Raises StudyError with file, line and field."""
    table = _read_table(path)
    try:
        return _dataclass_of(kind, table)
    except StudyError as error:
        raise StudyError(f"{path}: {_line_of(path, str(error).partition(':')[0])}{error}") from None


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


def locate(message: str, study: str, options: Sequence[str]) -> str:
    """Return the message of a faulty field behind the file and line that give it.

    A field that the words of the command line give has none.
    """
    heads = (word.removeprefix("--set=").partition("=")[0] for word in options)
    names = {head.lstrip("-").replace("-", "_") for head in heads}
    field = message.partition(":")[0]
    if field in names or not re.fullmatch(r"[\w.]+", field):
        return message
    path = find_study(study.partition(":")[0])
    place = _line_of(path, field)
    return f"{path}: {place}{message}" if place else message


def _line_of(path: Path, field: str) -> str:
    """Return where a file gives a field, as "line 3: "; empty where it does not.

    A field within a table on one line has that line.
    """
    lines, header = dict[str, int](), ""
    for number, line in enumerate(path.read_text("utf-8", errors="replace").splitlines(), 1):
        name = re.split("[=#]", line)[0].replace('"', "").strip()
        if name.startswith("["):
            name = header = name.strip("[] ")
        elif name and header:
            name = f"{header}.{name}"
        lines.setdefault(name, number)
    numbers = (lines[name] for name in (field, field.rpartition(".")[0]) if name and name in lines)
    return next((f"line {number}: " for number in numbers), "")


def study_names() -> list[str]:
    """Return the names of the package's studies, and of those with code."""
    folders = [path.parent.name for folder in FOLDERS for path in sorted(folder.glob(f"*/{FILE}"))]
    return [*(path.stem for path in sorted(PACKAGED.glob("*.toml"))), *dict.fromkeys(folders)]


def option(field: str, value: Any) -> Table:
    """Return the table of one field, dotted where it is one of a table.

    >>> option("sizes.frames", 60)
    {'sizes': {'frames': 60}}
    """
    for name in reversed(field.split(".")):
        value = {name: value}
    table: Table = value
    return table


def parse_setting(text: str) -> Table:
    """Return the table of --set field=value. Raises StudyError.

    >>> parse_setting("sizes.frames=60"), parse_setting("seeds=0,1")
    ({'sizes': {'frames': 60}}, {'seeds': [0, 1]})
    """
    field, equals, value = text.partition("=")
    if not (field.strip() and equals and value.strip()):
        raise StudyError(f"--set {text}: give field=value, as in seeds=0,1,2 or sizes.frames=60")
    try:
        table = option(field.strip(), _value(value.strip()))
        check_values(table)
    except ValueError as error:
        raise StudyError(f"--set {text[:40]}: {error}") from None
    return table


def _value(text: str) -> Any:
    """Return a value of TOML, a list where there are commas, else the text."""
    try:
        return parse_toml(f"x = {text}")["x"]
    except tomllib.TOMLDecodeError:
        return [_value(word.strip()) for word in text.split(",") if word.strip()] if "," in text else text


def _read_table(path: Path) -> dict[str, Any]:
    try:
        return read_toml(path)
    except (OSError, ValueError) as error:
        raise StudyError(f"{path}: not readable as TOML ({' '.join(str(error).split())})") from None


def _fields_of(path: Path, chain: tuple[Path, ...] = ()) -> Table:
    """Return the fields of a file and, below them, of the study that it is like."""
    if path.resolve() in chain:
        raise StudyError(f"{path}: is like itself")
    table = _with_tables(_read_table(path))
    if path.parent != PACKAGED:
        table = _resolve(path.parent, "", table)
    if "like" not in table:
        return table
    like = str(table.pop("like"))
    sibling = path.parent / like
    base = sibling if sibling.is_file() else find_study(str(sibling) if sibling.is_dir() else like)
    return _merge(_fields_of(base, (*chain, path.resolve())), table)


def _resolve(folder: Path, name: str, value: Any) -> Any:
    """Return the value of a field with its paths relative to where `folder` is."""
    if isinstance(value, Mapping):
        return {name: _resolve(folder, name, item) for name, item in value.items()}
    if isinstance(value, list):
        return [_resolve(folder, name, item) for item in value]
    if not isinstance(value, str) or value == LIBRARY:
        return value
    is_code = name in OF_CODE and value.endswith(".py") and not value.startswith("!")
    return str(folder / value) if is_code or name in PATHS else value


def _with_tables(table: Table) -> dict[str, Any]:
    """Return the fields with a table for each word that may stand in place of one."""
    tables = {n: {key: table[n]} for n, key in WORDS_FOR_TABLES.items() if isinstance(table.get(n), str)}
    table = {**table, **tables}
    if isinstance(files := table.get("rollouts"), Mapping):
        table["rollouts"] = {n: {"path": v} if isinstance(v, str) else v for n, v in files.items()}
    return table


def _merge(below: Table, above: Table) -> dict[str, Any]:
    """Join tables; where `above` has a field, or a table with a file or base, it counts alone."""
    merged = {**below, **above}
    for name, value in above.items():
        tables = isinstance(value, Mapping) and isinstance(below.get(name), Mapping)
        if tables and not any(isinstance(value.get(key), str) for key in WORDS_FOR_TABLES.values()):
            merged[name] = _merge(below[name], value)
    return merged


def _refuse(field: Sequence[str], message: object) -> NoReturn:
    raise StudyError(f"{'.'.join(field)}{': ' * bool(field)}{message}")


def _dataclass_of(kind: Any, table: Any, field: tuple[str, ...] = ()) -> Any:
    """Return a dataclass from the table of its fields; what it refuses gets its place."""
    table = _table(table, field)
    if kind is RollOutOption:
        table["name"] = field[-1]
    base = table.pop("base", "quick") if kind is Preset else ""
    declared = [f.name for f in fields(kind) if f.name not in HIDDEN.get(kind, ())]
    for name in table:
        if name not in declared:
            hint = nearest(name, declared, otherwise=f"there are {', '.join(declared)}")
            _refuse((*field, name), f"no field is called '{name}'; {hint}")
    for f in fields(kind):
        if f.default is MISSING and f.default_factory is MISSING and f.name not in table and not base:
            _refuse(field, f"{f.name} is absent: give it")
    hints = get_type_hints(kind)
    try:
        table = _merge(asdict(find_preset(base)), table) if base else table
        return kind(**{name: _value_of(hints[name], table[name], (*field, name)) for name in table})
    except StudyError:
        raise
    except (TypeError, ValueError) as error:
        _refuse(field, error)


def _table(value: Any, field: tuple[str, ...]) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        _refuse(field, f"{value!r}: give a table")
    return dict(value)


def _value_of(hint: Any, value: Any, field: tuple[str, ...]) -> Any:
    """Return the value of a field as its type asks for it."""
    origin, types = get_origin(hint), get_args(hint)
    if origin is UnionType:  # of a type and None
        return None if value is None else _value_of(types[0], value, field)
    if field == ("trained",) and isinstance(value, bool):
        return FOLDER if value else None
    if origin is Literal:
        if value not in types:
            _refuse(field, f"{value!r}: choose from {', '.join(types)}")
        return value
    if origin is tuple:
        values = value if isinstance(value, list | tuple) else [value]
        return tuple(_value_of(types[0], item, field) for item in values)
    if origin in (dict, Mapping):
        table = _table(value, field)
        return {name: _value_of(types[1], table[name], (*field, name)) for name in table}
    if is_dataclass(hint):
        return _dataclass_of(hint, value, field)
    if hint is float and type(value) is int:
        return float(value)
    if type(value) is not (str if hint is Path else hint):
        _refuse(field, f"{value!r}: give {KINDS.get(hint, 'a path')}")
    return Path(value) if hint is Path else value
