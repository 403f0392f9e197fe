"""Arrays of strangers: whatever is wrong with a file is said in one line that names it."""

from __future__ import annotations

import io
import resource
import struct
import zipfile

import numpy as np
import pytest

from reference_sim.files.array_file import ArrayFileError, array_names, read_array, read_arrays, write_array

POSES = np.arange(12.0).reshape(4, 3)
OTHERS = {
    "by_columns": np.asfortranarray(POSES),
    "empty": np.zeros((0, 3)),
    "one": np.array(30.0),
    "big_endian": POSES.astype(">f4"),
    "word": np.array("female"),
    "letters": np.array([b"a", b"bc"]),
    "truth": np.array([True, False]),
}


def npy(shape: str, descr: str = "'<f8'", data: bytes = b"", version: tuple[int, int] = (1, 0)) -> bytes:
    """An .npy file that declares this, and holds those bytes."""
    header = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}\n".encode("latin-1")
    length = struct.pack("<H" if version == (1, 0) else "<I", len(header))
    return b"\x93NUMPY" + bytes(version) + length + header + data


def npz(member: bytes, method: int = zipfile.ZIP_DEFLATED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        archive.writestr("poses.npy", member)
    return stream.getvalue()


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_whole_files_are_read_as_numpy_reads_them(tmp_path, save):
    save(tmp_path / "a.npz", poses=POSES, **OTHERS)
    arrays = read_arrays(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as stored:
        for name in stored.files:
            assert arrays[name].dtype == stored[name].dtype and arrays[name].flags.writeable
            np.testing.assert_array_equal(arrays[name], stored[name])
        assert list(arrays) == stored.files == array_names(tmp_path / "a.npz")
    assert list(read_arrays(tmp_path / "a.npz", ("poses", "absent"))) == ["poses"]
    for name, array in OTHERS.items():
        np.save(tmp_path / f"{name}.npy", array)
        np.testing.assert_array_equal(read_array(tmp_path / f"{name}.npy"), array)


@pytest.mark.parametrize("array", [np.array(3.0), np.zeros((0, 3)), np.arange(6.0).reshape(2, 3).T])
def test_what_is_written_is_read(tmp_path, array):
    write_array(tmp_path / "a.npy", array)
    assert read_array(tmp_path / "a.npy").shape == array.shape
    np.testing.assert_array_equal(read_array(tmp_path / "a.npy"), array)


def test_an_array_of_objects_is_refused_only_where_it_is_asked_for(tmp_path):
    np.savez(tmp_path / "a.npz", poses=POSES, gender=np.array(["f", None], dtype=object))
    assert list(read_arrays(tmp_path / "a.npz", ("poses",))) == ["poses"]
    with pytest.raises(ArrayFileError, match=r"a\.npz: array 'gender': Object arrays cannot be loaded"):
        read_arrays(tmp_path / "a.npz")


SHORT = "negative|read all|could not read|convert to|too large|EOF|more numbers than fit"


@pytest.mark.parametrize(
    ("shape", "descr", "reason"),
    [
        ("(10**30,)", "'<f8'", "Header|malformed"),
        (f"({10**30},)", "'<f8'", SHORT),
        ("(40000, 40000)", "'<f8'", SHORT),
        ("(-1, 3)", "'<f8'", SHORT),
        ("(3,)", "'<f8'", SHORT),
        ("(1,)", "'<f8'", "longer than its shape"),
        (f"({10**14},)", "'S0'", "."),
        ("(2,)", "'|O'", "Object arrays"),
        ("(2,)", "[('a', '<f8')]", "type"),
        ("(2,)", "('<f8', (10**9,))", "."),
        ("(" * 3000, "'<f8'", "."),
        ("-" * 9000 + "1", "'<f8'", "."),
    ],
)
def test_a_declaration_that_the_file_does_not_bear_out_is_refused(tmp_path, shape, descr, reason):
    for data, name, read in ((npy(shape, descr, bytes(16)), "a.npy", read_array),
                             (npz(npy(shape, descr, bytes(16))), "b.npz", read_arrays)):  # fmt: skip
        (tmp_path / name).write_bytes(data)
        with pytest.raises(ArrayFileError, match=reason) as refusal:
            read(tmp_path / name)
        assert str(tmp_path / name) in str(refusal.value) and "\n" not in str(refusal.value)


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("second", ["poses.npy", "poses"])
def test_two_arrays_of_one_name_are_refused(tmp_path, second):
    """Readers differ in which of the two they take."""
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        for name, value in (("poses.npy", b"1"), (second, b"2")):
            archive.writestr(name, npy("(2,)", data=8 * value + bytes(8)))
    with pytest.raises(ArrayFileError, match="array 'poses': is there twice"):
        read_arrays(tmp_path / "a.npz")


def test_a_small_file_of_a_large_array_takes_no_memory(tmp_path):
    """The file declares five gigabytes and holds fifty megabytes, packed into fifty kilobytes."""
    member = npy("(625000000,)", data=bytes(50_000_000))
    data = npz(member)
    true, claimed = (struct.pack("<I", n) for n in (len(member), 4_000_000_000))
    assert data.count(true) == 2
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for file, limit, reason in (
        (data, 40_000_000, "too large"),
        (data, 1 << 30, "."),
        (data.replace(true, claimed), 1 << 30, "too large"),
        (data.replace(true, claimed), 1 << 40, "."),
    ):
        (tmp_path / "a.npz").write_bytes(file)
        with pytest.raises(ArrayFileError, match=f"array 'poses': .*{reason}"):
            read_arrays(tmp_path / "a.npz", limit=limit)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000  # kB


def test_archives_that_cannot_be_unpacked_are_refused(tmp_path):
    whole, path = npz(npy("(2,)", data=bytes(16))), tmp_path / "a.npz"
    place = whole.index(b"PK\1\2")
    encrypted = bytearray(whole)
    encrypted[6] |= 1
    encrypted[place + 8] |= 1
    damaged = bytearray(whole)
    damaged[60] ^= 16
    for data, reason in (
        (bytes(encrypted), "encrypted"),
        (bytes(damaged), "."),
        (npz(npy("(2,)", data=bytes(16)), zipfile.ZIP_LZMA), "method 14"),
        (whole[:-30], "not a zip file"),
        (b"", "not a zip file"),
    ):
        path.write_bytes(data)
        with pytest.raises(ArrayFileError, match=reason):
            read_arrays(path)
    with pytest.raises(ArrayFileError, match="no such file"):
        read_arrays(tmp_path / "absent.npz")
