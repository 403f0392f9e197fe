"""The table of a package's rooms has each folder and each module, with what it says of itself."""

import pytest

import snug.motion
from reports.text import rooms


def test_rooms_are_folders_then_modules_with_their_first_lines(tmp_path, monkeypatch):
    (tmp_path / "cloth" / "physics").mkdir(parents=True)
    (tmp_path / "cloth" / "__init__.py").write_text('"""Face."""')
    (tmp_path / "cloth" / "physics" / "__init__.py").write_text('"""Energies.\n\nMore."""')
    (tmp_path / "cloth" / "physics" / "strain.py").write_text('"""Strain."""')
    (tmp_path / "cloth" / "run.py").write_text('"""Command."""')
    (tmp_path / "cloth" / "notes").mkdir()  # no package
    monkeypatch.setattr(rooms, "ROOT", tmp_path)
    assert rooms.room_rows("cloth")[1:] == [("`physics/`", "Energies."), ("`run.py`", "Command.")]
    with pytest.raises(ValueError, match="no package 'garments'"):
        rooms.room_rows("garments")


def test_a_room_of_the_project_says_what_its_face_says():
    assert dict(rooms.room_rows("snug"))["`motion/`"] == snug.motion.__doc__.partition("\n")[0]
