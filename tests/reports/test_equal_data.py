"""The equal-data block in the report: its table, its figures, and the curves of every training."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest
from reports.figures.equal_data import equal_data, error_against_frames, held_out_curves, members

from benchmarks.results.run_folder import RunFolder
from reports.figures import styles
from reports.run.training_histories import History, curves_table, read_histories
from tests.reports.report_folder import row, run_of, write_model

COSTS = {"cost/data": 60.0, "cost/setup": 5.0, "cost/train": 100.0, "cost/train_steps": 5300.0}


def block(*names: str, families=("snug-data", "supervised-data")) -> list:
    """Rows of networks that learned from 100 frames and 12 mixed ones for each, or not; of two seeds."""
    rows = [row("tshirt/walk", "simulation", "energy/total", 0.25)]
    for family in families:
        for level, frames in ((0, 100.0), (12, 1300.0)):
            own = {
                "role": "ablation", "family": family, "level": float(level), "base": family.split("-")[0],
            }  # fmt: skip
            name = f"{family}-{level}"
            for seed in (0, 1):
                total = (1.0 if level else 4.0) + seed
                rows.append(row("tshirt/walk", name, "energy/total", total, seed=seed, **own))
                for metric, value in {**COSTS, "cost/train_frames": frames}.items():
                    rows.append(row("tshirt/walk", name, metric, value, seed=seed, **own))
            cleaned = own | {"family": f"{family}+cleanup", "base": name}
            for metric, value in (("cost/train_frames", frames), ("energy/total", 0.5)):
                rows.append(row("tshirt/walk", f"{name}+cleanup", metric, value, **cleaned))
    return rows


def test_each_method_of_the_block_has_its_frames_seconds_and_errors():
    # Neither the network that everybody runs nor a warm-started solver of some iterations belongs to it.
    rows = [*block(), row("tshirt/walk", "snug", "cost/train_frames", 1300.0)]
    rows += [row("tshirt/walk", "snug+lbfgs-4", "cost/train_frames", 1300.0)]
    run = run_of(rows)
    (made,) = equal_data(run)
    lines = {line[1]: dict(zip([column.name for column in made.columns], line)) for line in made.rows}
    assert next(iter(lines)) == "simulation" and set(lines) == {"simulation", *members(run)}
    assert len(members(run)) == 8 and lines["simulation"]["seconds"] is None
    own = lines["snug-data-12"]
    assert own["mixed"] == 12 and own["seconds"] == 165.0 and own["cost/train_frames"].value == 1300.0
    total = own["energy/total"]
    assert total.value == 1.5 and total.spread == pytest.approx(np.sqrt(0.5)) and total.seeds == 2
    assert lines["snug-data-0"]["energy/total"].value == 4.5
    assert equal_data(run_of([r for r in rows if r.method in ("simulation", "snug", "snug+lbfgs-4")])) == []


def test_error_falls_along_a_line_for_each_network_and_not_for_its_variants(tmp_path, monkeypatch):
    drawn = []

    def keep(axes, x, y, spread, **look):
        drawn.append((x, y, look["color"]))

    monkeypatch.setattr("matplotlib.axes.Axes.errorbar", keep)
    (picture,) = error_against_frames(tmp_path, run_of(block()))
    assert picture.path.name == "equal_data.svg" and picture.kind == "equal data"
    blue, orange = (styles.KNOWN[name].colour for name in ("snug", "supervised"))
    # Above the simulation, for the zero of a total is a choice.
    assert drawn == [((100.0, 1300.0), (4.25, 1.25), colour) for colour in (blue, orange)]
    one_end = [r for r in block() if r.level != 12.0]
    assert error_against_frames(tmp_path, run_of(one_end)) == []


def test_curves_have_the_colours_of_their_networks_though_these_are_not_in_the_run(tmp_path, monkeypatch):
    kinds = ("snug", "supervised")
    rows = [
        row("tshirt/walk", f"{kind}-long-0", "energy/total", 1.0, role="ablation", family=f"{kind}-long",
            level=0.0, base=f"{kind}-data-0")
        for kind in kinds
    ]  # fmt: skip
    run, steps = run_of(rows), [{"step": s, "validation": 1.0 / s} for s in (1, 2)]
    histories = [History(f"{kind}-long-0", "J", steps, "tshirt", kind=kind) for kind in kinds]
    drawn = []
    monkeypatch.setattr("matplotlib.axes.Axes.plot", lambda axes, x, y, **look: drawn.append(look["color"]))
    held_out_curves(tmp_path, run, histories)
    assert drawn == [styles.KNOWN[kind].colour for kind in kinds]


def test_curves_of_every_network_are_kept_and_those_with_held_out_motions_drawn(tmp_path):
    folder, run = RunFolder(tmp_path), run_of(block())
    write_model(folder.models / "snug-data-12-seed0.safetensors", "snug")
    write_model(folder.models / "supervised-data-0-seed1.safetensors", "supervised", validation=3.0)
    histories = read_histories(folder, run, [])
    assert [(h.garment, h.method, h.seed) for h in histories] == [
        ("tshirt", "snug-data-12", 0), ("tshirt", "supervised-data-0", 1),
    ]  # fmt: skip
    (made,) = curves_table(histories)
    lines = list(csv.DictReader(made.write_csv(tmp_path).read_text().splitlines()))
    assert [line["step"] for line in lines] == ["1", "2", "4"] * 2
    assert [line["loss"] for line in lines[:3]] == ["2", "1", "0.5"]
    assert {line["validation"] for line in lines[:3]}.isdisjoint({"3"})
    assert {line["validation"] for line in lines[3:]} == {"3"}
    (picture,) = held_out_curves(tmp_path, run, histories)
    assert picture.path.name == "held_out.svg" and held_out_curves(tmp_path, run, histories[:1]) == []
    both = [*histories, replace(histories[1], garment="tunic")]
    captions = {p.path.name: p.caption for p in held_out_curves(tmp_path, run, both)}
    assert [caption.split(":")[0] for caption in captions.values()] == ["tshirt", "tunic"]
    assert set(captions) == {"held_out.svg", "held_out_tunic.svg"}
