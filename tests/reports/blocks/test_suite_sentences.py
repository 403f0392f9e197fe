"""Sentences of page one on textile tests and engines."""

from __future__ import annotations

from reports.blocks.page_one_sentences import headline
from reports.blocks.suite_sentences import engines, textile_tests
from reports.tables.engines.audit import LAWS, RATIOS, SPIN
from tests.reports.report_folder import row, run_of


def of_engine(scene, law, value, **more):
    return row(scene, scene, f"engine/{law}", value, suite="engines", unit="1", role="", **more)


def of_solver(method, bending, drape, error, ms, fabric="limp"):
    solver = {"suite": "fabric", "role": "solver" if method != "simulation" else "reference"}
    for test, metric, value, unit in (
        ("cantilever", "bending_length", bending, "mm"), ("drape", "drape_coefficient", drape, "%"),
    ):  # fmt: skip
        scene = f"fabric/{test}/{fabric}"
        yield row(scene, method, f"fabric/{metric}", value, unit=unit, **solver)
        yield row(scene, method, "fabric/error", error, unit="%", **solver)
        yield row(scene, method, "cost/frame", ms, unit="ms", **solver)


def test_engines_say_what_is_right_and_what_is_farthest():
    laws = [law for law in LAWS if law != SPIN]
    rows = [
        *(
            of_engine("good", law, float(law in RATIOS), expected=float(law in RATIOS), tolerance=0.01)
            for law in laws
        ),
        of_engine("good/x1", "distance", 0.1, expected=0.0, tolerance=1.0),
        of_engine("bad", "fall_over_discrete_law", 0.5, expected=1.0, tolerance=0.01),
        of_engine("bad/x1", "distance", 30.0, expected=0.0, tolerance=1.0),
        of_engine("bad", "budget", 16.0),
    ]
    assert engines(run_of(rows)).replace("\u00a0", " ") == (
        "Of 2 default settings of other engines 1 violates no law and is at its own limit: good. "
        "Farthest from its own limit is bad, by 30 % of what the sheet moves. "
        "16 times its budget is within 1 % of it."
    )
    unmeasured = engines(run_of(rows[1:]))  # a law that was not measured is not kept
    none = "Of 2 default settings of other engines 0 violate no law and are at their own limits."
    assert unmeasured.startswith(none)
    assert [topic for topic, _ in headline(run_of(rows))] == ["Engines"]


def test_textile_tests_name_the_fastest_solver_near_the_answers():
    rows = [
        *of_solver("simulation", 10.0, 40.0, 0.0, 9.0),
        *of_solver("simulation", 20.0, 60.0, 0.0, 9.0, fabric="stiff"),
        *of_solver("near", 10.0, 40.0, 0.5, 4.0),
        *of_solver("near", 20.0, 60.0, 0.5, 4.0, fabric="stiff"),
        *of_solver("slower", 10.0, 40.0, 0.1, 8.0),
        *of_solver("slower", 20.0, 60.0, 0.1, 8.0, fabric="stiff"),
        *of_solver("early", 20.0, 60.0, 30.0, 1.0),
        *of_solver("early", 10.0, 40.0, 30.0, 1.0, fabric="stiff"),
    ]
    sentence = textile_tests(run_of(rows))
    assert " is near, 4.00 ms a frame." in sentence.replace("\u00a0", " "), sentence
    assert "1 of 3 put fabrics in another order" in sentence


def test_a_run_of_garments_has_neither_sentence():
    run = run_of([row("tshirt/kick", "snug", "energy/total", 1.0)])
    assert engines(run) == textile_tests(run) == ""
