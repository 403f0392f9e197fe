"""Studies: how they are chosen, and what becomes of one that fails."""

from __future__ import annotations

import dataclasses
import pickle

import pytest
from plans import SMOKE, plan_of

from benchmarks.plan import PlanError, choose_cells, choose_studies
from benchmarks.results import RunFolder
from benchmarks.studies import STUDIES


def test_studies_are_chosen_as_checks_are():
    everything = choose_studies(("garments", "validation", "extremes"), [], [])
    assert everything == STUDIES and len({study.name for study in STUDIES}) == len(STUDIES)
    assert [study.name for study in choose_studies(("validation",), ["law*"], [])] == ["laws"]
    assert choose_studies(("validation",), ["free_fall"], []) == ()
    assert choose_studies(("validation",), [], ["snug"]) == ()
    assert choose_studies(("speed",), [], []) == ()
    assert pickle.loads(pickle.dumps(STUDIES)) == STUDIES


def test_what_a_study_raises_is_a_failed_row(tmp_path):
    broken = dataclasses.replace(STUDIES[0], module="benchmarks.studies.nowhere")
    (row,) = broken.run(plan_of(tmp_path), RunFolder(tmp_path), None)
    assert row.status == "failed" and "nowhere" in row.reason and row.suite == STUDIES[0].suite


def test_a_study_may_be_all_that_is_asked():
    options = {"full": True, "preset": SMOKE, "methods": (), "seeds": (0,)}
    from benchmarks.plan import Motions

    nothing = Motions((), (), {})
    chosen = choose_cells(("validation",), motions=nothing, scenes=["laws"], **options)
    assert chosen == ((), (), ())
    with pytest.raises(PlanError):
        choose_cells(("garments",), motions=nothing, scenes=["laws"], **options)
