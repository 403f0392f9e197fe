"""Garments for tests that run the training's command several times."""

from functools import cache

import pytest

from snug.body.parametric_body import Body
from snug.garments.garment import Garment
from snug.garments.templates import GarmentTemplate, find_template

TAILOR = GarmentTemplate.tailor


@cache
def tailored(name: str, vertices: int) -> Garment:
    return TAILOR(find_template(name), Body.load(), vertices=vertices)


@pytest.fixture
def tailored_once(monkeypatch) -> None:
    """Each garment is tailored to the package's body once: otherwise a second of every command."""

    def tailor(template: GarmentTemplate, body: Body, *, vertices: int) -> Garment:
        return tailored(template.name, vertices)

    monkeypatch.setattr(GarmentTemplate, "tailor", tailor)
