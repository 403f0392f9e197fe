"""The restricted pickle reader: plain values come back as they are, and nothing in a file is ever run."""

import pickle
import struct
from collections import OrderedDict, defaultdict
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse

from snug.body.plain_pickle import PlainPickleError, read_plain_pickle

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
}


def written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("protocol", range(6))
def test_plain_values_come_back(tmp_path, protocol):
    read = read_plain_pickle(written(tmp_path / "a.pkl", pickle.dumps(ROLL_OUT, protocol)))
    assert list(read) == list(ROLL_OUT)
    for key, value in ROLL_OUT.items():
        if isinstance(value, np.ndarray):
            assert type(read[key]) is np.ndarray and read[key].dtype.kind == value.dtype.kind
            np.testing.assert_array_equal(read[key], value)
        else:
            assert read[key] == value


@pytest.mark.parametrize("protocol", [0, 2, 5])
@pytest.mark.parametrize("kind", ["csc_matrix", "csr_matrix", "coo_matrix", "csc_array"])
def test_sparse_matrices_come_back(tmp_path, kind, protocol):
    dense = np.diag([1.0, 2.0, 3.0])[:2]
    content = pickle.dumps({"J": getattr(scipy.sparse, kind)(dense)}, protocol)
    read = read_plain_pickle(written(tmp_path / "a.pkl", content))["J"]
    assert scipy.sparse.issparse(read)
    np.testing.assert_array_equal(read.toarray(), dense)


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
    read = read_plain_pickle(written(tmp_path / "smpl.pkl", content))
    np.testing.assert_array_equal(read["shapedirs"], shapes)
    np.testing.assert_array_equal(read["J_regressor"].toarray(), [[0, 1], [1, 0], [0, 0]])


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


@pytest.mark.parametrize("trick", sorted(evil(Path("x"))))
def test_nothing_in_a_pickle_is_run(tmp_path, trick):
    marker = tmp_path / "ran"
    path = written(tmp_path / "evil.pkl", evil(marker)[trick])
    with pytest.raises(PlainPickleError) as caught:
        read_plain_pickle(path)
    assert not marker.exists()
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)
    assert "numpy.savez" in str(caught.value)


ARRAY = pickle.dumps(np.arange(6.0).reshape(2, 3), 4)


@pytest.mark.parametrize(
    "content",
    [
        raw(b"\x8e" + struct.pack("<Q", 2**40)),  # BINBYTES8
        raw(b"\x96" + struct.pack("<Q", 2**40)),  # BYTEARRAY8
        raw(b"\x8d" + struct.pack("<Q", 2**40)),  # BINUNICODE8
        raw(b"\x95" + struct.pack("<Q", 2**62), b"N"),  # FRAME
        raw(b"Nr" + struct.pack("<I", 2**32 - 1)),  # LONG_BINPUT: a memo of 64 GiB
        raw(b"Np4000000000\n"),
        raw(b"\x8b" + struct.pack("<i", 2**31 - 1)),  # LONG4
        b"L" + b"9" * 100_000 + b"L\n.",
        b"\x80\x02)" + b"\x85" * 500_000 + b"}\x94(h\x00Nu.",
        raw(b"]" * 900_000 + b"a" * 899_999),  # a nest of lists
        raw(b"]q\x00h\x00a"),  # a list that holds itself
        ARRAY[:-40],
        ARRAY.replace(b"K\x02K\x03", b"K\x02K\x04"),
        ARRAY.replace(b"K\x02K\x03", b"K\x02K\x02"),
        ARRAY.replace(b"K\x02K\x03", b"K\xffK\xff"),
        pickle.dumps(np.array([{}], dtype=object)),
        pickle.dumps(np.zeros(2, dtype=[("a", "f4")])),
        b"", b"\x80", b"PK\x03\x04", b"\x93NUMPY\x01\x00",
    ],
    ids=range(21),
)  # fmt: skip
def test_sizes_and_broken_files_are_refused(tmp_path, content):
    path = written(tmp_path / "a.pkl", content)
    with pytest.raises(PlainPickleError) as caught:
        read_plain_pickle(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value) and len(str(caught.value)) < 500
    assert "MemoryError" not in str(caught.value)  # refused before anything of that size is asked for
