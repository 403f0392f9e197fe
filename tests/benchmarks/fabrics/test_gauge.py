"""Fabrics of GAUGE's metadata, on a small folder of the same form."""

from __future__ import annotations

import json
import re

import pytest

from benchmarks.fabrics.fabric import Fabric
from benchmarks.fabrics.gauge import read_gauge
from benchmarks.fabrics.measured import FabricFileError
from tests.benchmarks.fabrics.gauge_folder import FABRICS, make_folder


@pytest.fixture
def folder(tmp_path):
    return make_folder(tmp_path / "GAUGE-Dataset")


def test_fabrics_are_read_from_the_metadata_of_either_task(folder):
    expected = tuple(Fabric(name, density, k, k) for name, (density, k) in FABRICS.items())
    assert read_gauge(folder) == expected
    (folder / "metadata/textile/textile stretching.json").unlink()
    assert read_gauge(folder) == expected


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda materials: materials["satin"].pop("density"), "not the metadata .*KeyError: 'density'"),
        (lambda materials: materials["satin"].update(density=71.0), "density 71 is outside"),
        (lambda materials: materials["satin"].update({"bend stiffness": "soft"}), "ValueError"),
        (lambda materials: materials.update(satin=[]), "TypeError"),
    ],
)
def test_metadata_that_cannot_be_used_is_refused(folder, change, complaint):
    path = folder / "metadata/textile/textile stretching.json"
    content = json.loads(path.read_text())
    change(content["assets"]["textile"]["material"])
    path.write_text(json.dumps(content))
    with pytest.raises(FabricFileError, match=f"--gauge {re.escape(str(path))}: .*{complaint}"):
        read_gauge(folder)


def test_another_folder_is_refused(tmp_path):
    with pytest.raises(FabricFileError, match=r"textile bending\.json': give the folder"):
        read_gauge(tmp_path)
    path = tmp_path / "metadata/textile/textile bending.json"
    path.parent.mkdir(parents=True)
    for text in ("[", "[]"):
        path.write_text(text)
        with pytest.raises(FabricFileError, match=r"not the metadata .*: download it again"):
            read_gauge(tmp_path)
