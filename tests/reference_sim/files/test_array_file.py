"""Arrays of strangers: plain ones come back as they are, the rest is refused in one line, nothing is run."""

from __future__ import annotations

import gzip
import os
import pickle
import struct
import zlib
from collections import OrderedDict, defaultdict
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse

from reference_sim.files.array_file import ArrayFileError, read_arrays, read_pickled_arrays, write_array

POSES = np.arange(12.0).reshape(4, 3)
ARRAYS = {
    "poses": POSES,
    "by_columns": np.asfortranarray(POSES),
    "empty": np.zeros((0, 3)),
    "one": np.array(30.0),
    "big_endian": POSES.astype(">f4"),
    "word": np.array("female"),
}


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_whole_files_are_read_as_they_were_written(tmp_path, save):
    save(tmp_path / "a.npz", **ARRAYS)
    arrays = read_arrays(tmp_path / "a.npz")
    assert list(arrays) == list(ARRAYS)
    assert list(read_arrays(tmp_path / "a.npz", ("poses", "absent"))) == ["poses"]
    for name, array in ARRAYS.items():
        write_array(tmp_path / "a.npy", array)
        for stored in (arrays[name], np.load(tmp_path / "a.npy")):
            assert stored.dtype == array.dtype and stored.shape == array.shape and stored.flags.writeable
            np.testing.assert_array_equal(stored, array)


ROLL_OUT = {
    "pred": np.arange(24, dtype=np.float32).reshape(2, 4, 3),
    "obstacle_faces": np.asfortranarray(np.array([[0, 1, 2]], dtype=np.uint32)),
    "metrics": defaultdict(list, time=[0.1, np.float64(0.2)]),
    "config": OrderedDict(name="höd", sizes=(1, None, True), tags={"a"}),
    "columns": scipy.sparse.csc_matrix(np.diag([1.0, 2.0, 3.0])[:2]),
    "fps": 30.0,
}


def pickled(path: Path, content: object, protocol: int = 4) -> Path:
    path.write_bytes(content if isinstance(content, bytes) else pickle.dumps(content, protocol))
    return path


@pytest.mark.parametrize("protocol", (0, 5))
def test_a_pickle_gives_its_arrays_by_name(tmp_path, protocol):
    arrays = read_pickled_arrays(pickled(tmp_path / "a.pkl", ROLL_OUT, protocol), ROLL_OUT)
    assert set(arrays) == set(ROLL_OUT) - {"metrics", "config"}
    for key, array in arrays.items():
        value = ROLL_OUT[key].toarray() if key == "columns" else np.asarray(ROLL_OUT[key])
        assert type(array) is np.ndarray and array.dtype.kind == value.dtype.kind
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
    dirty = b"U\x0b_dirty_varsc__builtin__\nset\n]\x85Rub"
    chumpy = b"cchumpy.ch\nCh\n)\x81}(U\x01x" + python2(shapes) + dirty
    parts = {
        b"data": np.ones(2),
        b"indices": np.array([1, 0], "<i4"),
        b"indptr": np.array([0, 1, 2], "<i4"),
    }
    sparse = b"ccopy_reg\n_reconstructor\n(cscipy.sparse.csc\ncsc_matrix\nc__builtin__\nobject\nNtR}("
    sparse += b"".join(b"U" + bytes([len(key)]) + key + python2(value) for key, value in parts.items())
    sparse += b"U\x06_shapeK\x03K\x02\x86ub"
    content = b"\x80\x02}(U\tshapedirs" + chumpy + b"U\x0bJ_regressor" + sparse + b"u."
    arrays = read_pickled_arrays(pickled(tmp_path / "smpl.pkl", content), ("shapedirs", "J_regressor"))
    np.testing.assert_array_equal(arrays["shapedirs"], shapes)
    np.testing.assert_array_equal(arrays["J_regressor"], [[0, 1], [1, 0], [0, 0]])


class Shell(str):
    """Pickles as a call of os.system."""

    def __reduce__(self):
        return os.system, (str(self),)


def name(text: str) -> bytes:
    return b"\x8c" + bytes([len(text)]) + text.encode()


def evil(marker: object) -> dict[str, bytes]:
    """Pickles that would make the file `marker` if what they name were called."""
    shell = f"touch {marker}"
    array = b"cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85C\x01b\x87R"
    call = name(shell) + b"\x85R."
    return {
        "os.system": pickle.dumps(Shell(shell)),
        "eval": b"c__builtin__\neval\n" + name(f"open({str(marker)!r}, 'w')") + b"\x85R.",
        "nested name": b"\x80\x04" + name("numpy") + name("ndarray.__class__") + b"\x93" + call,
        "reconstructor": b"ccopy_reg\n_reconstructor\n(cos\nsystem\nc__builtin__\nobject\nNtR.",
        "object array": b"\x80\x04" + array + b"(K\x01K\x01\x85cnumpy\ndtype\n" + name("O8")
        + b"\x89\x88\x87R\x89](cos\nsystem\netb.",
        "slots of a class": b"\x80\x04cchumpy.ch\nCh\nN}(" + name("array") + b"cos\nsystem\nu\x86b.",
    }  # fmt: skip


ARRAY = pickle.dumps({"a": np.arange(6.0).reshape(2, 3)}, 4)
BROKEN = {
    "cut off": ARRAY[:-40],
    "objects": pickle.dumps({"a": np.array([{}], dtype=object)}),
    "no dict": pickle.dumps(np.arange(6.0)),
    "no array": pickle.dumps({"b": 1, "a": None}),
    "sparse rows": pickle.dumps({"a": scipy.sparse.csr_array(np.eye(2))}),
    "empty": b"", "byte": b"\x80", "zip": b"PK\x03\x04",
}  # fmt: skip


@pytest.mark.parametrize("trick", [*evil("x"), *BROKEN])
def test_a_hostile_or_broken_pickle_is_refused_in_one_line_and_nothing_is_run(tmp_path, trick):
    marker = tmp_path / "ran"
    path = pickled(tmp_path / "a.pkl", (evil(marker) | BROKEN)[trick])
    with pytest.raises(ArrayFileError) as caught:
        read_pickled_arrays(path, ("a", "x"))
    message = str(caught.value)
    assert not marker.exists() and str(path) in message and "\n" not in message and len(message) < 500
    assert trick in BROKEN or "is no plain value" in message


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (ARRAY[:15] + name("joblib.numpy_pickle") + name("NumpyArrayWrapper") + b"\x93\xff", "by joblib"),
        (zlib.compress(ARRAY), "is compressed"),
        (gzip.compress(ARRAY), "is compressed"),
    ],
    ids=["joblib", "zlib", "gzip"],
)
def test_a_pickle_of_joblib_is_refused_as_one(tmp_path, content, words):
    with pytest.raises(ArrayFileError, match=f"{words}.* joblib.load .* numpy.savez"):
        read_pickled_arrays(pickled(tmp_path / "a.pkl", content), ("a",))


def test_a_pickle_that_asks_for_a_table_of_gigabytes_is_refused(tmp_path):
    """CPython's unpickler would take 2.6 GB before it asks what a name stands for."""
    path = tmp_path / "large.pkl"
    path.write_bytes(b"\x80\x02}r" + (330_743_571).to_bytes(4, "little") + b".")
    with pytest.raises(ArrayFileError, match="puts an object in a place beyond its end"):
        read_pickled_arrays(path, ["a"])
