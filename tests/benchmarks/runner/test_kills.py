"""A run whose processes are killed at any moment loses nothing that was finished."""

from __future__ import annotations

import os
import random
import signal
import time
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path

import pytest

from tests.benchmarks.runner.processes_by_hand import alive, chain, finish, until

KILLS = int(os.environ.get("KILLS", "10"))


def files(folder: Path) -> dict[str, str]:
    """Name -> text, of what is whole and of what is not."""
    return {path.name: path.read_text() for path in sorted(folder.rglob("*.txt"))}


@pytest.mark.slow
def test_killed_at_random_moments_the_files_are_the_same(tmp_path):
    """The runner, or the process of a task. What was finished is not done again."""
    finish(tmp_path / "undisturbed", *chain())
    expected, folder = files(tmp_path / "undisturbed"), tmp_path / "run"
    chance, kills, begun = random.Random(7), 0, tmp_path / "begun"
    begun.touch()
    options = {"workers": 2, "retry": True}
    while kills < KILLS:
        runner = get_context("spawn").Process(
            target=finish, args=(folder, *chain(sleep=0.3)), kwargs=options
        )
        runner.start()
        while kills < KILLS and runner.is_alive():
            before = begun.read_text()
            until(lambda: begun.read_text() != before or not runner.is_alive())  # noqa: B023
            time.sleep(chance.uniform(0.0, 0.6))
            if not runner.is_alive():
                break
            contents = {path: path.read_bytes() for path in folder.glob("cache/**/*.json")}
            if chance.random() < 0.5:
                runner.kill()
                runner.join()
            else:
                with suppress(ProcessLookupError):  # it has just ended with the chain
                    os.kill(int(begun.read_text().split()[-1]), signal.SIGKILL)
            kills += 1
            assert {path: path.read_bytes() for path in contents} == contents
        runner.join(120)
        if files(folder) == expected:  # begin again: there are kills left
            for path in folder.rglob("*.json"):
                path.unlink()
    finish(folder, *chain(), **options)
    assert len(expected) == 12 and files(folder) == expected
    until(lambda: not any(alive(int(pid)) for pid in begun.read_text().split()), 15.0)
