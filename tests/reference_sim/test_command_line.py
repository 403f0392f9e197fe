"""Every command reports a user's error in one line and by its exit status, and raises a fault of its own."""

from __future__ import annotations

import errno
import importlib

import pytest

from reference_sim.command_line import announce_compilation, command


@pytest.mark.parametrize(
    ("name", "words", "message"),
    [
        ("snug.train", ["--no-such-option"], "--no-such-option"),
        (
            "benchmarks.run",
            ["--body", ""],
            "--body '' names nothing: give a value",
        ),  # of an unset variable
        ("benchmarks.run", ["--body="], "'--body=' names nothing"),
        # Bytes that are no UTF-8.
        ("snug.check", ["b\udcff/a.obj"], r"'b\udcff/a.obj' is no text: rename"),
    ],
)
def test_a_wrong_word_is_one_line_with_the_name_of_the_command(
    name, words, message, capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert importlib.import_module(name).main(words) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"{name}: ") and error.count("\n") == 1 and message in error
    assert "--help" in error and not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("met", "goes_on", "status", "message"),
    [
        (ValueError("a.obj: face 3\n has no area"), "", 2, "a.obj: face 3 has no area"),
        (
            OSError(errno.ENOSPC, "No space left", "a.csv"),
            "--resume goes on",
            1,
            "there); --resume goes on",
        ),
        (KeyboardInterrupt(), "--resume goes on", 130, "interrupted; --resume goes on"),
        (KeyboardInterrupt(), "", 130, "interrupted; nothing was written"),
    ],
)
def test_what_a_command_meets_is_its_exit_status(met, goes_on, status, message, capsys):
    @command("some.command", goes_on=goes_on)
    def main() -> int:
        raise met

    assert main() == status
    error = capsys.readouterr().err
    assert error.startswith("some.command: ") and message in error and error.count("\n") == 1


def test_a_fault_of_the_program_is_raised():
    @command("some.command", bad_input=(FileNotFoundError,))
    def main() -> int:
        raise ValueError("shapes (3,) and (4,)")

    with pytest.raises(ValueError, match="shapes"):
        main()


def test_compilation_is_announced_where_no_compiled_kernel_lies_on_disk(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    announce_compilation()
    assert capsys.readouterr().err.startswith("first use: kernels are compiled")
    folder = tmp_path / "reference_sim.kernels.fast_kernels-0123456789abcdef"
    folder.mkdir()
    (folder / "sweep-1.py311.nbi").touch()
    announce_compilation()
    assert capsys.readouterr().err == ""
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "kernels"))
    announce_compilation()
    assert "in each process anew" in (error := capsys.readouterr().err) and "set NUMBA_CACHE_DIR" in error
