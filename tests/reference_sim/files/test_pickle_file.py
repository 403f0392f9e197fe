"""Arrays of pickles: plain ones come back as they are, and nothing in a file is ever run."""

import pickle
import struct
from collections import OrderedDict, defaultdict
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse

from reference_sim.files.array_file import ArrayFileError
from reference_sim.files.pickle_file import ALLOWED, read_pickled_arrays

ROLL_OUT = {
    "pred": np.arange(24, dtype=np.float32).reshape(2, 4, 3),
    "obstacle": np.ones((2, 5, 3), dtype=">f8"),
    "cloth_faces": np.array([[0, 1, 2], [2, 1, 3]]),
    "obstacle_faces": np.asfortranarray(np.array([[0, 1, 2]], dtype=np.uint32)),
    "metrics": defaultdict(list, time=[0.1, np.float64(0.2)]),
    "config": OrderedDict(name="höd", sizes=(1, None, True), tags={"a"}),
    "turned": np.arange(24).reshape(2, 3, 4).transpose(1, 0, 2),
    "names": np.array(["neck", "hem"]),
    "empty": np.empty((0, 3)),
    "columns": scipy.sparse.csc_matrix(np.diag([1.0, 2.0, 3.0])[:2]),
    "rows": scipy.sparse.csr_array(np.eye(2)),
    "fps": 30.0,
}


def written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("protocol", range(6))
def test_arrays_come_back_by_name(tmp_path, protocol):
    read = read_pickled_arrays(written(tmp_path / "a.pkl", pickle.dumps(ROLL_OUT, protocol)), ROLL_OUT)
    assert set(read) == set(ROLL_OUT) - {"metrics", "config", "rows"}
    for key, array in read.items():
        value = ROLL_OUT[key].toarray() if key == "columns" else np.asarray(ROLL_OUT[key])
        assert type(array) is np.ndarray and array.dtype.kind == value.dtype.kind
        assert array.flags.fnc == np.asarray(value, order="K").flags.fnc or key in ("turned", "columns")
        np.testing.assert_array_equal(array, value)


def python2(numbers: np.ndarray) -> bytes:
    """Opcodes of an array as Python 2 writes it at protocol 2: raw bytes in a str, the old module's name."""
    raw = numbers.tobytes()
    dtype = b"cnumpy\ndtype\nU\x02" + numbers.dtype.str[1:].encode() + b"K\x00K\x01\x87R"
    dtype += b"(K\x03U\x01<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb"
    shape = b"(" + b"".join(b"K" + bytes([n]) for n in numbers.shape) + b"t"
    head = b"cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85U\x01b\x87R"
    return head + b"(K\x01" + shape + dtype + b"\x89T" + struct.pack("<i", len(raw)) + raw + b"tb"


def test_an_official_body_of_python_2_is_read(tmp_path):
    """Raw bytes as text, chumpy's array by its content, a sparse matrix of an old module."""
    shapes = np.linspace(-1, 1, 12).reshape(2, 3, 2)
    chumpy = (
        b"cchumpy.ch\nCh\n)\x81}(U\x01x" + python2(shapes) + b"U\x0b_dirty_varsc__builtin__\nset\n]\x85Rub"
    )
    parts = [
        (b"data", np.ones(2)),
        (b"indices", np.array([1, 0], "<i4")),
        (b"indptr", np.array([0, 1, 2], "<i4")),
    ]
    sparse = b"ccopy_reg\n_reconstructor\n(cscipy.sparse.csc\ncsc_matrix\nc__builtin__\nobject\nNtR}("
    sparse += b"".join(b"U" + bytes([len(key)]) + key + python2(value) for key, value in parts)
    sparse += b"U\x06_shapeK\x03K\x02\x86ub"
    content = b"\x80\x02}(U\tshapedirs" + chumpy + b"U\x0bJ_regressor" + sparse + b"u."
    read = read_pickled_arrays(written(tmp_path / "smpl.pkl", content), ("shapedirs", "J_regressor"))
    np.testing.assert_array_equal(read["shapedirs"], shapes)
    np.testing.assert_array_equal(read["J_regressor"], [[0, 1], [1, 0], [0, 0]])


class Calls:
    """Pickles as a call of that function."""

    def __init__(self, function, *values):
        self.call = function, values

    def __reduce__(self):
        return self.call


def raw(*operations: bytes) -> bytes:
    return b"\x80\x04" + b"".join(operations) + b"."


def name(text: str) -> bytes:
    return b"\x8c" + bytes([len(text)]) + text.encode()


def evil(marker: Path) -> dict[str, bytes]:
    """Pickles that would make the file `marker` if what they name were called."""
    import os

    shell, python = f"touch {marker}", f"open({str(marker)!r}, 'w')"
    array = b"cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85C\x01b\x87R"
    call = name(shell) + b"\x85R"
    return {
        "os.system": pickle.dumps(Calls(os.system, shell)),
        "posix": b"cposix\nsystem\n(S'" + shell.encode() + b"'\ntR.",
        "eval": pickle.dumps(Calls(eval, python)),
        "python 2": b'c__builtin__\neval\n(S"' + python.encode() + b'"\ntR.',
        "inst": b"(S'" + shell.encode() + b"'\nios\nsystem\n.",
        "obj": b"(cos\nsystem\nS'" + shell.encode() + b"'\no.",
        "nested name": raw(name("numpy"), name("ndarray.__class__"), b"\x93", call),
        "by an allowed module": raw(name("numpy"), name("f2py.os.system"), b"\x93", call),
        "by collections": raw(name("collections"), name("_sys.modules"), b"\x93"),
        "getattr": raw(b"c__builtin__\ngetattr\n", b"cnumpy\nndarray\n", name("__class__"), b"\x86R"),
        "copyreg": raw(name("copyreg"), name("__newobj__"), b"\x93", b"cos\nsystem\n", b"\x85R"),
        "reconstructor": b"ccopy_reg\n_reconstructor\n(cos\nsystem\nc__builtin__\nobject\nNtR.",
        "extension": raw(b"\x82\x01"),
        "persistent": raw(b"Pos.system\n"),
        "object array": raw(array, b"(K\x01K\x01\x85cnumpy\ndtype\n", name("O8"), b"\x89\x88\x87R\x89]tb"),
        "pickle in a pickle": pickle.dumps(Calls(pickle.loads, pickle.dumps(Calls(os.system, shell)))),
        "numpy.load": pickle.dumps(Calls(np.load, str(marker), None, True)),
        "setstate of a name": raw(b"cnumpy\nndarray\n}(", name("__call__"), b"cos\nsystem\n", b"ub", call),
        "slots of a name": raw(b"cnumpy\nndarray\nN}(", name("plain"), name(shell), b"u\x86b"),
        "slots of a dict": raw(b"}N}(", name("__class__"), b"cnumpy\nndarray\n", b"u\x86b"),
        "call a value": raw(name("os.system"), call),
        "type as value": raw(b"cnumpy\nndarray\n"),
    }


ARRAY = pickle.dumps(np.arange(6.0).reshape(2, 3), 4)


BROKEN = {
    "bytes without end": raw(b"\x8e" + struct.pack("<Q", 2**40)),
    "bytearray without end": raw(b"\x96" + struct.pack("<Q", 2**40)),
    "text without end": raw(b"\x8d" + struct.pack("<Q", 2**40)),
    "frame without end": raw(b"\x95" + struct.pack("<Q", 2**62), b"N"),
    "memo of 64 GiB": raw(b"Nr" + struct.pack("<I", 2**32 - 1)),
    "memo in text": raw(b"Np4000000000\n"),
    "integer without end": raw(b"\x8b" + struct.pack("<i", 2**31 - 1)),
    "integer of 100,000 digits": b"L" + b"9" * 100_000 + b"L\n.",
    "nest of tuples": b"\x80\x02)" + b"\x85" * 500_000 + b"}\x94(h\x00Nu.",
    "nest of lists": raw(b"]" * 900_000 + b"a" * 899_999),
    "list that holds itself": raw(b"}", name("a"), b"]q\x00h\x00as"),
    "cut off": ARRAY[:-40],
    "shape too large": ARRAY.replace(b"K\x02K\x03", b"K\x02K\x04"),
    "shape too small": ARRAY.replace(b"K\x02K\x03", b"K\x02K\x02"),
    "another shape": ARRAY.replace(b"K\x02K\x03", b"K\xffK\xff"),
    "objects": pickle.dumps({"a": np.array([{}], dtype=object)}),
    "fields": pickle.dumps({"a": np.zeros(2, dtype=[("a", "f4")])}),
    "sparse matrix of 80 GB": pickle.dumps({"a": scipy.sparse.csc_matrix((100_000, 100_000))}),
    "rows of several lengths": pickle.dumps({"a": [[1, 2], [3]]}),
    "no dict": ARRAY,
    "no array": pickle.dumps({"b": 1, "a": None}),
    "empty": b"", "byte": b"\x80", "zip": b"PK\x03\x04", "npy": b"\x93NUMPY\x01\x00",
}  # fmt: skip
HOSTILE = {name: lambda marker, name=name: evil(marker)[name] for name in evil(Path("x"))}
HOSTILE |= {name: lambda marker, content=content: content for name, content in BROKEN.items()}
HOSTILE |= {
    f"slots of {module}.{title}": lambda marker, names=(module, title): raw(
        b"c%b\n%b\nN}(" % tuple(map(str.encode, names)), name("made"), name("x"), b"u\x86b"
    )
    for module, title in ALLOWED
}


@pytest.mark.parametrize("trick", HOSTILE)
def test_a_hostile_or_broken_pickle_is_refused_in_one_line_and_nothing_is_run(tmp_path, trick):
    marker, before = tmp_path / "ran", [dict(vars(kind)) for kind in ALLOWED.values()]
    path = written(tmp_path / "a.pkl", HOSTILE[trick](marker))
    with pytest.raises(ArrayFileError) as caught:
        read_pickled_arrays(path, ("a", "x"))
    message = str(caught.value)
    assert not marker.exists() and before == [dict(vars(kind)) for kind in ALLOWED.values()]
    assert str(path) in message and "\n" not in message and len(message) < 500
    assert "MemoryError" not in message  # refused before anything of that size is asked for
