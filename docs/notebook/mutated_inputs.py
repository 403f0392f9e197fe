# ruff: noqa: E501
"""Mutated inputs with their ends fixed beforehand: PYTHONPATH=. python docs/notebook/mutated_inputs.py [COUNT [SEED]].

Each kind of file has mutations that change nothing ("same") and mutations that leave no meaning
("refused"). An input has up to two of the first and, in two of three cases, one of the second. A reader
must give the very answer of the unmutated file, or end in one line that names the file, with exit status
2. Counted: tracebacks, more than LIMIT seconds, other answers, lines without the name.
"""

from __future__ import annotations

import contextlib
import io
import os
import pickle
import random
import re
import shutil
import signal
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshio
import numpy as np

from benchmarks.external.roll_out_files import read_roll_out
from benchmarks.plan.study import read_study
from benchmarks.submit import read_entry
from reference_sim.command_line import command
from reference_sim.files.mesh_files import read_sequence
from reference_sim.material import Material
from reference_sim.obstacle import Obstacle
from reference_sim.trajectory import Trajectory, write_obj, write_point_cache
from snug.body.parametric_body import Body
from snug.body.skeleton import joint_positions
from snug.garments.reading import read_garment
from snug.garments.templates import find_template
from snug.motion.files import load_motions
from snug.motion.library import make_motion
from studies.fabric.fabrics import read_fabrics
from tests.reference_sim.meshes import sphere
from tests.snug.motion.motion_forms import amc_frame, bvh, cmu_like

LIMIT = 20.0  # [s]
Mutation = Callable[[str, random.Random], str]
Arrays = dict[str, Any]
NUMBER = re.compile(r"(?<![\w.+-])-?\d+\.?\d*(?:e-?\d+)?(?![\w.])")


def lines_of(text: str, pattern: str) -> list[int]:
    """Return the numbers of the lines that match."""
    return [k for k, line in enumerate(text.splitlines()) if re.match(pattern, line)]


def on_line(pattern: str, change: Callable[[str, random.Random], str]) -> Mutation:
    """Return a mutation of one line that matches."""

    def mutate(text: str, draw: random.Random) -> str:
        lines = text.splitlines()
        k = draw.choice(lines_of(text, pattern))
        lines[k] = change(lines[k], draw)
        return "\n".join(lines) + "\n"

    return mutate


def number_to(*words: str) -> Callable[[str, random.Random], str]:
    """Return a change of one number of a line into one of the words."""

    def change(line: str, draw: random.Random) -> str:
        matches = list(NUMBER.finditer(line))
        if not matches:
            return line
        match = draw.choice(matches)
        return line[: match.start()] + draw.choice(words) + line[match.end() :]

    return change


def crlf(text: str, draw: random.Random) -> str:
    """End lines as Windows does."""
    return text.replace("\n", "\r\n")


def spaces(text: str, draw: random.Random) -> str:
    """Add spaces behind lines."""
    return "".join(line + " " * draw.randint(0, 3) + "\n" for line in text.splitlines())


def open_end(text: str, draw: random.Random) -> str:
    """Leave the last end of line out."""
    return text.rstrip("\n")


def insert(line: str, first: int = 1) -> Mutation:
    """Return a mutation that adds a line somewhere from the line `first` on."""

    def mutate(text: str, draw: random.Random) -> str:
        lines = text.splitlines()
        lines.insert(draw.randint(min(first, len(lines)), len(lines)), line)
        return "\n".join(lines) + "\n"

    return mutate


def cut(low: float, high: float) -> Mutation:
    """Return a mutation that cuts the text off at a share of it."""
    return lambda text, draw: text[: int(draw.uniform(low, high) * len(text))]


def replaced(old: str, new: str) -> Mutation:
    """Return a mutation of each match of a pattern."""
    return lambda text, draw: re.sub(old, new, text, flags=re.M)


def doubled(pattern: str) -> Mutation:
    """Return a mutation that has one line twice."""

    def mutate(text: str, draw: random.Random) -> str:
        lines = text.splitlines()
        k = draw.choice(lines_of(text, pattern))
        return "\n".join([*lines[: k + 1], *lines[k:]]) + "\n"

    return mutate


def dropped(pattern: str) -> Mutation:
    """Return a mutation that leaves one line out."""

    def mutate(text: str, draw: random.Random) -> str:
        lines = text.splitlines()
        del lines[draw.choice(lines_of(text, pattern))]
        return "\n".join(lines) + "\n"

    return mutate


def decimal_commas(text: str, draw: random.Random) -> str:
    """Write numbers as half of Europe does, or at least its semicolons."""
    text = text.replace(",", ";")
    return text if draw.random() < 0.5 else re.sub(r"(\d)\.(\d)", r"\1,\2", text)


def nothing(text: str, draw: random.Random) -> str:
    """Leave nothing, or what is no text of the kind."""
    return draw.choice(
        ["", "\n\n", "hello\n", "\0" * 40, "<html><body>404</body></html>\n", "\x89PNG\r\n\x1a\n"]
    )


PLAIN = [crlf, spaces, open_end]
BAD = ("nan", "inf", "-inf", "x", "1.2.3", "1,5", "1e999", "")
# Kind -> text mutations that change nothing, and those that leave no meaning.
TEXT: dict[str, tuple[list[Mutation], list[Mutation]]] = {
    "motion.bvh": (
        [*PLAIN, insert("", 0), replaced(r"^(\t+)", "    "), replaced("HIERARCHY", "Hierarchy"),
         replaced("MOTION", "Motion"), replaced("Frame Time", "frame time")],
        [nothing, cut(0.02, 0.97), on_line(r"-?\d", number_to(*BAD)), on_line(r"\t*OFFSET", number_to(*BAD)),
         dropped(r"-?\d"), doubled(r"-?\d"), dropped(r"\t*CHANNELS"), dropped(r"\t*\}"), replaced("left_knee", "knob"),
         on_line("Frame Time", number_to("0", "-1", "9", *BAD)), on_line("Frames:", number_to("0", "7", "1e9", *BAD)),
         on_line(r"\t*CHANNELS", lambda line, draw: line.replace("rotation", "twist", 1))],
    ),
    "clip.amc": (
        [*PLAIN, insert("# by hand", 0), insert("", 0)],
        [nothing, on_line(r"[a-z]", number_to(*BAD)), dropped("[a-z]"), replaced(":DEGREES", ":RADIANS"),
         on_line("[a-z]", lambda line, draw: line + " 0.5"), on_line("[a-z]", lambda line, draw: "tail 1 2 3"),
         on_line(r"root", number_to("1e9", "-1e8"))],
    ),
    "skeleton.asf": (
        [*PLAIN, insert("# by hand", 0), insert("", 0)],
        [nothing, on_line(r" (direction|length \d)", number_to(*BAD)), replaced("angle deg", "angle rad"),
         replaced("lfemur", "lbone"), replaced("order TX TY TZ", "order"), on_line(r" length \d+\.\d+$", number_to(*BAD)),
         on_line(" axis .*XYZ", lambda line, draw: line.replace("XYZ", "ZYX")), cut(0.05, 0.9),
         on_line(r" dof", lambda line, draw: " dof rq"), on_line(" direction", lambda line, draw: " direction 0 0 0")],
    ),
    "garment.obj": (
        [*PLAIN, insert("# by hand", 0), insert("g shirt", 0), insert("", 0), insert("vn 0 0 1", 0), insert("s off", 0),
         insert("usemtl cotton", 0), replaced(r"^v (.*)$", r"v \1 1.0"), replaced(r"^v (\S+ \S+ \S+)$", r"v \1 0.5 0.5 0.5")],
        [nothing, cut(0.0, 0.3), on_line("v ", number_to(*BAD)), on_line("f ", number_to("0", "99999", "-99999", "x", "1.5")),
         doubled("f "), on_line("f ", lambda line, draw: "f " + " ".join([line.split()[1]] * 2 + line.split()[2:3])),
         on_line("f ", lambda line, draw: "f 1 2 3 4 5"), on_line("f ", lambda line, draw: "f 1 2"), dropped("v "),
         on_line("v ", number_to("1e300", "1e30")), replaced(r"^v (\S+) (\S+) (\S+)", r"v \3 \1 1\2")],
    ),
    "garment.ply": (
        [*PLAIN, replaced("^(element .*)$", r"comment by hand\n\1"), replaced("^(element face.*)$", r"obj_info a shirt\n\1")],
        [nothing, cut(0.0, 0.97), on_line(r"-?\d+\.\d", number_to(*BAD)), on_line(r"3 \d", number_to("99999", "-5", "x")),
         dropped(r"3 \d"), dropped(r"-?\d+\.\d"), replaced("element vertex", "element corner"),
         on_line("element (vertex|face)", number_to("1", "-3", "99999999999")), dropped("end_header"),
         replaced("ascii", "binary_middle_endian"), replaced("property double x", "property double w")],
    ),
    "study.toml": (
        [*PLAIN, insert("# by hand", 0), insert("", 0), replaced(" = ", "  =   ")],
        [nothing, insert("motion = 3", 0), insert("[sizes", 0), insert("seeds = [0, 'a']", 0), doubled("seeds"),
         on_line("seeds", lambda line, draw: "seeds = " + draw.choice(["x", "'one'", "[0.5]", "nan", "9" * 400, "[" * 500, "{}"])),
         on_line("scenes", lambda line, draw: "scenes = " + draw.choice(["3", "[1, 2]", "{a = 1}", "nan", "'''x"])),
         insert(".".join("ab" * 3000) + " = 1", 0), on_line("methods", lambda line, draw: "methods = 1979-05-27")],
    ),
    "cotton.toml": (
        [*PLAIN, insert("# by hand", 0), insert("", 0), replaced("1e5", "100000.0"), replaced(" = ", "=")],
        [nothing, on_line("[a-z]", number_to("nan", "inf", "x", "'1'", "-1", "1e999", "[1]", "true")), doubled("[a-z]"),
         replaced("young_modulus", "youngs_modulus"), insert("colour = 'red'", 0), insert("[young_modulus]", 0)],
    ),
    "fabrics.csv": (
        [*PLAIN, insert("", 1), insert(",,,", 1), replaced("^", " "), lambda text, draw: "\ufeff" + text,
         decimal_commas],
        [nothing, on_line(r" *[a-z]+[,;] *\d", number_to("nan", "inf", "x", "-1", "1e999", "1e9", "0", "1.2.3")), replaced("weft.*]$", "other"),
         lambda text, draw: text.splitlines()[0] + "\n", on_line(r" *[a-z]+[,;] *\d", lambda line, draw: line.rpartition(",")[0]),
         on_line(r" *[a-z]+[,;] *\d", lambda line, draw: line + ",7,8")],
    ),
    "entry/entry.toml": (
        [*PLAIN, insert("# by hand", 0), insert("", 0), replaced(" = ", "=")],
        [nothing, insert("colour = 'red'", 0), doubled("[a-z]"), dropped("title|authors|protocol|milliseconds|seeds"),
         on_line("milliseconds", number_to("nan", "-1", "0", "inf", "'fast'", "9" * 309)), replaced("^protocol.*", "protocol = '0.9'"),
         replaced("^roll_outs.*", "roll_outs = '../{scene}.npz'"), replaced("^roll_outs.*", "roll_outs = '/tmp/{scene}.npz'"),
         replaced("^seeds.*", "seeds = [0, 0]"), replaced("^scenes.*", "scenes = ['tshirt/moonwalk']"), cut(0.05, 0.2)],
    ),
}  # fmt: skip
GOOD = make_motion("walk").cut(0, 40)
AMASS: Arrays = {"poses": GOOD.poses.reshape(40, 72), "trans": GOOD.translations, "mocap_framerate": 30.0}


def without(*names: str) -> Callable[[Arrays, random.Random], Arrays]:
    """Return a mutation that leaves out one of these arrays."""

    def mutate(arrays: Arrays, draw: random.Random) -> Arrays:
        name = draw.choice(names)
        return {key: value for key, value in arrays.items() if key != name}

    return mutate


def spoilt(arrays: Arrays, name: str, draw: random.Random, value: float) -> Arrays:
    """Put a value in one place of an array."""
    array = np.array(arrays[name], dtype=float)
    array.flat[draw.randrange(array.size)] = value
    return {**arrays, name: array}


def setting(name: str, change: Callable[[Any], Any]) -> Callable[[Arrays, random.Random], Arrays]:
    """Return a mutation of one array."""
    return lambda arrays, draw: {**arrays, name: change(np.asarray(arrays[name]))}


def renamed(old: str, *new: str) -> Callable[[Arrays, random.Random], Arrays]:
    """Return a mutation of one array's name."""
    return lambda arrays, draw: {draw.choice(new) if key == old else key: v for key, v in arrays.items()}


def spoil(name: str, *values: float) -> Callable[[Arrays, random.Random], Arrays]:
    """Return a mutation that puts one of the values somewhere into an array."""
    return lambda arrays, draw: spoilt(arrays, name, draw, draw.choice(values))


MOTION_ARRAYS = (
    [setting("poses", np.asfortranarray), setting("poses", lambda x: x.reshape(len(x), -1, 3)),
     setting("mocap_framerate", lambda x: x.astype(int)), lambda arrays, draw: {**arrays, "gender": "female"},
     lambda arrays, draw: {**arrays, "betas": np.zeros(16)}, lambda arrays, draw: dict(reversed(arrays.items())),
     lambda arrays, draw: {**arrays, "dmpls": np.zeros((40, 8))}],
    [without("poses", "trans", "mocap_framerate"), spoil("poses", np.nan, np.inf, 1e9, 300.0), spoil("trans", np.nan, np.inf, 1e7, 50.0),
     setting("poses", np.degrees), setting("poses", lambda x: x[:-1]), setting("trans", lambda x: x[:, :2]),
     setting("trans", lambda x: x[1:]), setting("trans", lambda x: 1000 * x), setting("mocap_framerate", lambda x: np.nan),
     setting("poses", lambda x: joint_positions(x.reshape(40, 24, 3), GOOD.translations).reshape(40, 72)),
     setting("poses", lambda x: x.astype(complex)), setting("poses", lambda x: x.astype(str)), setting("poses", lambda x: x[:0]),
     setting("poses", lambda x: x.reshape(40, 72)[:, :70]), setting("mocap_framerate", lambda x: np.array([30.0, 60.0]))],
)  # fmt: skip
CORNERS, FACES = sphere(1, 0.5)
ROLL_OUT: Arrays = {"positions": np.stack([CORNERS, CORNERS + 0.1]), "faces": FACES, "fps": 30.0}
ROLL_OUT_ARRAYS = (
    [setting("positions", np.asfortranarray), setting("faces", lambda x: x.astype(np.int32)),
     lambda arrays, draw: {**arrays, "note": np.zeros(3)}, lambda arrays, draw: dict(reversed(arrays.items()))],
    [without("positions"), setting("positions", lambda x: x[..., :2]),
     spoil("faces", 99999, -7), spoil("faces", 0.5), setting("positions", lambda x: x[0, :0]), setting("fps", lambda x: -30.0),
     setting("faces", lambda x: x[:, :2]), setting("positions", lambda x: x.astype(complex)), setting("fps", lambda x: np.nan)],
)  # fmt: skip


ROLLED = Trajectory(
    ROLL_OUT["positions"], FACES, np.array([0.0, 1 / 30]), np.zeros(2), "ok",
    frame_fields={"iterations": np.arange(2.0)},
)  # fmt: skip


class Kind:
    """A kind of input: how a valid one is written, mutated and read."""

    def __init__(
        self, name: str, write: Callable[[Path], object], read: Callable[[Path], object]
    ) -> None:
        """Take the file's name within a folder, writer of the folder, and reader of the file."""
        self.name, self.write, self.read = name, write, read

    def mutate(self, path: Path, draw: random.Random, spoil: bool) -> list[str]:
        """Mutate the file that lies there, and return what was done."""
        raise NotImplementedError


class TextKind(Kind):
    """A file of text."""

    def mutate(self, path: Path, draw: random.Random, spoil: bool) -> list[str]:
        """Apply up to two harmless mutations behind the one that is not, if any."""
        same, refused = TEXT[self.name]
        chosen = ([draw.choice(refused)] if spoil else []) + draw.sample(
            same, draw.randint(0 if spoil else 1, 2)
        )
        text, differences = path.read_text(encoding="utf-8"), []
        for mutation in chosen:
            before = text
            text = mutation(text, draw)
            differences.append(f"{getattr(mutation, '__name__', mutation)}: {difference(before, text)}")
            if spoil and text == before and mutation is chosen[0]:
                return []
        path.write_bytes(text.encode("utf-8", errors="surrogateescape"))
        return differences


class ArrayKind(Kind):
    """An .npz or a pickled dict of arrays."""

    def __init__(self, name: str, arrays: Arrays, mutations: Any, read: Callable[[Path], object]) -> None:
        """Take the arrays and their mutations in place of a writer."""
        super().__init__(name, lambda path: save(path, arrays), read)
        self.arrays, self.mutations = arrays, mutations

    def mutate(self, path: Path, draw: random.Random, spoil: bool) -> list[str]:
        """Apply mutations of arrays, or cut or overwrite the file."""
        same, refused = self.mutations
        if spoil and draw.random() < 0.25:
            data = path.read_bytes()
            at = draw.randrange(1, int(0.9 * len(data)))
            path.write_bytes(
                draw.choice([data[:at], b"", draw.randbytes(len(data) // 4), b"PK" + data[:at]])
            )
            return [f"bytes cut at {at}"]
        chosen = [
            *draw.sample(same, draw.randint(0 if spoil else 1, 2)),
            *([draw.choice(refused)] if spoil else []),
        ]
        arrays = self.arrays
        for mutation in chosen:
            arrays = mutation(arrays, draw)
        save(path, arrays)
        return [f"mutation {(refused if spoil else same).index(chosen[-1])}"]


def save(path: Path, arrays: Arrays) -> None:
    """Write arrays as the name of the file says."""
    if path.suffix == ".pkl":
        path.write_bytes(pickle.dumps({key: np.asarray(value) for key, value in arrays.items()}))
    else:
        np.savez_compressed(path, **arrays)


class BinaryKind(Kind):
    """A binary file: spoilt, or as it is."""

    def mutate(self, path: Path, draw: random.Random, spoil: bool) -> list[str]:
        """Cut the file at either end, or put other bytes in its place."""
        data = path.read_bytes()
        at = draw.randrange(1, int(0.97 * len(data)))
        if spoil:
            path.write_bytes(
                draw.choice([data[:at], data[:at], draw.randbytes(200), data[len(data) - at :]])
            )
        return [f"bytes cut at {at} of {len(data)}" if spoil else "nothing"]


class SequenceKind(Kind):
    """A folder of meshes, one a frame."""

    def mutate(self, path: Path, draw: random.Random, spoil: bool) -> list[str]:
        """Rename, remove, add or spoil files."""
        files = sorted(path.iterdir())
        file = draw.choice(files[1:-1])
        same: list[Callable[[], object]] = [
            lambda: [f.rename(path / f"f_{k + 7:05d}.obj") for k, f in enumerate(files)],
            lambda: [f.rename(path / f"f_{10 * k}.obj") for k, f in enumerate(files)],
            lambda: (path / "._f_001.obj").write_bytes(b"\0\5\26\7"), lambda: (path / "notes.txt").write_text("x"),
            lambda: file.write_bytes(file.read_bytes().replace(b"\n", b"\r\n")),
        ]  # fmt: skip
        text = file.read_text()
        lines = text.splitlines()
        refused: list[Callable[[], object]] = [
            file.unlink, lambda: shutil.copy(file, path / ("copy_of_" + file.name)), lambda: file.write_text(""),
            lambda: shutil.copy(file, path / "f_99.obj"), lambda: file.write_text(text[: len(text) // 5]),
            lambda: file.write_text(text.replace("v ", "# ", 1)), lambda: file.write_text("\n".join(lines[:-1])),
            lambda: file.write_text(NUMBER.sub("nan", text, 1)), lambda: file.rename(file.with_suffix(".bak")),
            lambda: file.write_text("\n".join(lines[:-2] + lines[:-3:-1])), lambda: [f.unlink() for f in files],
        ]  # fmt: skip
        chosen = draw.choice(refused if spoil else same)
        chosen()
        return [
            f"{'refused' if spoil else 'same'} {(refused if spoil else same).index(chosen)}, {file.name}"
        ]


def no_file(path: Path, draw: random.Random) -> list[str]:
    """Put something that is no regular file, or is not there, in the place of a file."""
    path.unlink()
    kind = draw.choice(["folder", "pipe", "device", "loop", "dangling", "gone"])
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind != "gone":
        path.symlink_to({"device": "/dev/zero", "loop": path.name, "dangling": "nowhere"}[kind])
    return [kind]


def difference(before: str, after: str) -> str:
    """Return the first lines in which two texts differ."""
    pairs = zip(before.splitlines(), after.splitlines())
    old, new = next(((a, b) for a, b in pairs if a != b), ("", f"{len(after)} letters for {len(before)}"))
    return f"{old[:60]!r} -> {new[:60]!r}"


BODY = Body.load()
SHIRT = find_template("tshirt").tailor(BODY, vertices=300)


def write_shirt(path: Path) -> None:
    """Write the T-shirt as text of the kind of mesh that the path names."""
    if path.suffix == ".obj":
        write_obj(path, SHIRT.rest_positions, SHIRT.faces)
    else:
        mesh = meshio.Mesh(SHIRT.rest_positions, [("triangle", SHIRT.faces)])
        with contextlib.redirect_stdout(io.StringIO()):
            mesh.write(path, binary="binary" in path.name)  # type: ignore[call-arg]


def write_frames(path: Path) -> None:
    """Write a folder of six frames."""
    for k in range(6):
        write_obj(path / f"f_{k:03d}.obj", CORNERS + 0.01 * k, FACES)


def motion_of(path: Path) -> object:
    """Return poses, path and rate of the one motion of a file."""
    [motion] = load_motions(path)
    return motion.poses, motion.translations, motion.fps


def garment_of(path: Path) -> object:
    """Return all arrays of a garment."""
    garment = read_garment(path, BODY)
    openings = [(name, *garment.loops[name].tolist()) for name in garment.loops]
    return garment.rest_positions, garment.faces, garment.pins, garment.skinning_weights, str(openings)


def roll_out_of(path: Path) -> object:
    """Return arrays of a roll-out."""
    stored = read_roll_out(path)
    return tuple(vars(stored).values())


def obstacle_of(path: Path) -> object:
    """Return positions and faces of a moving obstacle."""
    positions, surface = read_sequence(path)
    obstacle = Obstacle(positions, surface.faces)
    return obstacle.positions, obstacle.faces


def study_of(path: Path) -> object:
    """Return a study without its place."""
    return re.sub(r"'name': '[^']*'", "", repr(read_study(str(path))))


CLIP = ":FULLY-SPECIFIED\n:DEGREES\n" + "".join(
    amc_frame(k, root=(0.0, 16.0, 0.1 * k, 0.0, 0.0, 0.0), lfemur=(k, 0.0, 0.0)) for k in range(1, 9)
)


def write_pair(path: Path) -> None:
    """Write a clip with its skeleton."""
    (path.parent / "clip.asf").write_text(cmu_like())
    (path.parent / "clip.amc").write_text(CLIP)
    if path.suffix == ".asf":
        (path.parent / "clip.asf").rename(path)
        (path.parent / "clip.amc").rename(path.with_suffix(".amc"))


STUDY = 'seeds = [0, 1]\nscenes = ["tshirt/walk", "flag"]\nmethods = ["simulation", "skinning"]\n'
FABRICS = "name,density[g/m2],bending warp[uN.m],bending weft[uN.m]\ncotton,150.0,8.5,4.5\nsilk,60.5,1.5,1.25\nwool,220.5,12.5,9.5\n"
COTTON = "young_modulus = 1e5\npoisson_ratio = 0.3\nthickness = 5e-4\ndensity = 400.0\n"
KINDS = [
    TextKind("motion.bvh", lambda p: p.write_text(bvh(GOOD.poses, GOOD.translations, 30.0)), motion_of),
    TextKind("clip.amc", write_pair, motion_of),
    TextKind("skeleton.asf", write_pair, lambda p: motion_of(p.with_suffix(".amc"))),
    ArrayKind("amass.npz", AMASS, MOTION_ARRAYS, motion_of),
    ArrayKind("amass.pkl", AMASS, MOTION_ARRAYS, motion_of),
    *(TextKind(f"garment.{suffix}", write_shirt, garment_of) for suffix in ("obj", "ply")),
    BinaryKind("binary.ply", write_shirt, garment_of),
    SequenceKind("obstacle", write_frames, obstacle_of),
    SequenceKind("roll_out", write_frames, roll_out_of),
    ArrayKind("roll_out.npz", ROLL_OUT, ROLL_OUT_ARRAYS, roll_out_of),
    BinaryKind("roll_out.pc2", lambda p: write_point_cache(p, ROLLED), roll_out_of),
    BinaryKind("roll_out.vtkhdf", lambda p: ROLLED.save(p), roll_out_of),
    TextKind("study.toml", lambda p: p.write_text(STUDY), study_of),
    TextKind("cotton.toml", lambda p: p.write_text(COTTON), lambda p: repr(Material.from_file(p))),
    TextKind("fabrics.csv", lambda p: p.write_text(FABRICS), lambda p: repr(read_fabrics(p))),
    TextKind(
        "entry/entry.toml",
        lambda p: (
            shutil.copytree("submissions/early-stopped-lbfgs", p.parent, dirs_exist_ok=True)
            and p.write_text(re.sub("(?m)^protocol.*", "protocol = '2.0'", p.read_text()))
        ),
        lambda p: repr(read_entry(p.parent).metadata),
    ),
]


def same(one: Any, other: Any) -> bool:
    """Return whether two answers are equal, numbers to round-off."""
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, np.ndarray):
        return one.shape == other.shape and np.allclose(one, other, rtol=0.0, atol=1e-9, equal_nan=True)
    return bool(one == other)


def end_of(kind: Kind, path: Path, expected: object) -> tuple[str, str]:
    """Read a file through a command's frame; return the end, and the line or the traceback."""
    answers: list[object] = []

    def main() -> int:
        answers.append(kind.read(path))
        return 0

    errors = io.StringIO()
    try:
        with contextlib.redirect_stderr(errors), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            signal.alarm(int(LIMIT))
            status = command("mutated")(main)()
            signal.alarm(0)
    except Hang:
        return "hang", ""
    except BaseException:
        return "traceback", traceback.format_exc()[-900:]
    line = errors.getvalue().strip()
    if status == 0:
        return ("same" if same(answers[0], expected) else "another answer"), ""
    names_it = path.stem in line or path.parent.name in line or kind.name == "study.toml"
    fine = status == 2 and "\n" not in line and len(line) < 1000 and names_it
    return ("refused" if fine else "a poor line"), line


def run(kind: Kind, count: int, seed: int) -> Counter[str]:
    """Try one kind, print each fault, and return counts by expected and true end."""
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder, "whole", kind.name)
        whole.parent.mkdir(parents=True)
        kind.write(whole)
        expected = kind.read(whole)
        number = 0
        while counts.total() < count:
            number += 1
            draw = random.Random(f"{kind.name} {seed} {number}")
            place = Path(folder, "tried")
            shutil.copytree(Path(folder, "whole"), place)
            spoil = draw.random() < 2 / 3
            file = place / kind.name
            odd = spoil and file.is_file() and draw.random() < 0.08
            done = no_file(file, draw) if odd else kind.mutate(file, draw, spoil)
            if done:
                end, line = end_of(kind, place / kind.name, expected)
                wanted = "refused" if spoil else "same"
                counts[wanted, end] += 1  # type: ignore[index]
                if end != wanted:
                    print(
                        f"{kind.name} {number}: {wanted} expected, {end}: {'; '.join(done)} | {line}",
                        flush=True,
                    )
            shutil.rmtree(place)
    return counts


class Hang(BaseException):
    """An input took longer than LIMIT."""


def stop(*_: object) -> None:
    """End what takes too long, whatever it catches."""
    raise Hang


def main(count: int = 2000, seed: int = 0) -> None:
    """Print the table."""
    signal.signal(signal.SIGALRM, stop)
    rows = []
    for k, kind in enumerate(KINDS):
        share = count // len(KINDS) + (k < count % len(KINDS))
        counts = run(kind, share, seed)
        right = {end: counts[end, end] for end in ("refused", "same")}  # type: ignore[index]
        faults = share - sum(right.values())
        rows.append((kind.name, share, right["refused"], right["same"], faults))
    print("| kind | inputs | refused | same answer | faults |\n| --- | --- | --- | --- | --- |")
    for row in (*rows, ("all", *(sum(column) for column in list(zip(*rows))[1:]))):
        print("| " + " | ".join(map(str, row)) + " |")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
