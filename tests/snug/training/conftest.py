"""Garments for tests that run the training's command several times."""

from dataclasses import replace
from functools import cache

import pytest

from snug.body.parametric_body import Body
from snug.garments.garment import Garment
from snug.garments.templates import GarmentTemplate, find_template
from snug.training.command import choices


@cache
def tailored(name: str, vertices: int) -> Garment:
    return find_template(name).tailor(Body.load(), vertices=vertices)


@pytest.fixture
def tailored_once(monkeypatch) -> None:
    """Each garment is tailored to the package's body once: otherwise a second of every command."""

    def find(name: str) -> GarmentTemplate:
        return replace(find_template(name), tailor=lambda body, *, vertices: tailored(name, vertices))

    monkeypatch.setattr(choices, "find_template", find)
