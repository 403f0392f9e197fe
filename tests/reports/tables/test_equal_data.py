"""The equal-data block in the report: its table, and the curves of every training."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from reports.run.reading import read_run_with_trainings
from reports.tables.equal_data import EQUAL_DATA, members
from reports.tables.trainings import training_curves
from tests.reports.report_folder import row, run_folder, run_of, write_model

COSTS = {"cost/data": 60.0, "cost/setup": 5.0, "cost/train": 100.0, "cost/train_steps": 5300.0}


def block(*names: str, families=("snug-data", "supervised-data")) -> list:
    """Rows of networks that learned from 100 frames and 12 mixed ones for each, or not; of two seeds."""
    rows = [row("tshirt/walk", "simulation", "energy/total", 0.25)]
    for family in families:
        for level, frames in ((0, 100.0), (12, 1300.0)):
            columns = {
                "role": "ablation", "family": family, "level": float(level), "base": family.split("-")[0],
            }  # fmt: skip
            name = f"{family}-{level}"
            for seed in (0, 1):
                total = (1.0 if level else 4.0) + seed
                rows.append(row("tshirt/walk", name, "energy/total", total, seed=seed, **columns))
                for metric, value in {**COSTS, "cost/train_frames": frames}.items():
                    rows.append(row("tshirt/walk", name, metric, value, seed=seed, **columns))
            cleaned = columns | {"family": f"{family}+cleanup", "base": name}
            for metric, value in (("cost/train_frames", frames), ("energy/total", 0.5)):
                rows.append(row("tshirt/walk", f"{name}+cleanup", metric, value, **cleaned))
    return rows


def test_each_method_of_the_block_has_its_frames_seconds_and_errors():
    # Neither the network that everybody runs nor a warm-started solver of some iterations belongs to it.
    rows = [*block(), row("tshirt/walk", "snug", "cost/train_frames", 1300.0)]
    rows += [row("tshirt/walk", "snug+lbfgs-4", "cost/train_frames", 1300.0)]
    run = run_of(rows)
    (made,) = EQUAL_DATA(run)
    lines = {line[1]: dict(zip([column.name for column in made.columns], line)) for line in made.rows}
    assert next(iter(lines)) == "simulation" and set(lines) == {"simulation", *members(run)}
    assert len(members(run)) == 8 and lines["simulation"]["cost/train"] is None
    cells = lines["snug-data-12"]
    costs = {name: cells[name].value for name in COSTS}
    assert costs == COSTS and cells["cost/train_frames"].value == 1300.0
    total = cells["energy/total"]
    assert total.value == 1.5 and total.spread == pytest.approx(np.sqrt(0.5)) and total.seeds == 2
    assert lines["snug-data-0"]["energy/total"].value == 4.5
    assert EQUAL_DATA(run_of([r for r in rows if r.method in ("simulation", "snug", "snug+lbfgs-4")])) == []


def test_curves_of_every_network_are_kept_with_their_value_on_held_out_motions(tmp_path):
    folder = run_folder(tmp_path, block())
    write_model(folder.models / "snug-data-12-seed0.safetensors", "snug")
    write_model(folder.models / "supervised-data-0-seed1.safetensors", "supervised", validation=3.0)
    run = read_run_with_trainings(folder)
    assert [(h.garment, h.method, h.seed) for h in run.histories] == [
        ("tshirt", "snug-data-12", 0), ("tshirt", "supervised-data-0", 1),
    ]  # fmt: skip
    (made,) = training_curves(run)
    lines = list(csv.DictReader(made.write_csv(tmp_path).read_text().splitlines()))
    assert [line["step"] for line in lines] == ["1", "2", "4"] * 2
    assert [line["loss"] for line in lines[:3]] == ["2", "1", "0.5"]
    assert {line["validation"] for line in lines[:3]}.isdisjoint({"3"})
    assert {line["validation"] for line in lines[3:]} == {"3"}
