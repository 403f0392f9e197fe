"""One training run, step by step: draw sub-sequences, predict, sum energies, update, renew contact
anchors.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from snug.baselines.supervised import VertexTargets
from snug.dresser import DressedBody
from snug.loss import PhysicsLoss, make_contact
from snug.mixing import mixed_motions
from snug.recipe import Recipe
from snug.skinning import skin
from snug.trained_model import TrainedModel, find_kind, make_network
from snug.training_set import Batch, TrainingContact, TrainingError, TrainingSet

NAMED_WINDOWS = 50  # windows above the spike limit that are named one by one; all are counted
SETTLING = 50  # steps before which a high window is no cause for a remark
GIVE_UP = 100  # updates left out in a row, after which training stops


class Trainer:
    """See `snug.train.train` for the arguments. Everything random comes from `seed`; no decision from a
    clock.
    """

    def __init__(
        self,
        kind: str,
        dressed: DressedBody,
        motions: Sequence[Any],
        *,
        steps: int,
        seed: int,
        recipe: Recipe,
        trajectories: Mapping[str, np.ndarray] | None = None,
    ) -> None:
        if steps < 1:
            raise TrainingError(f"steps={steps}: training needs at least one step")
        if not motions:
            raise TrainingError("no motions to train on")
        how = find_kind(kind)
        self.kind, self.how, self.recipe, self.steps, self.seed = kind, how, recipe, steps, seed
        if how.physics:
            frames = round(recipe.mixed * sum(len(motion.poses) for motion in motions))
            motions = [*motions, *mixed_motions(motions, frames, turn=recipe.mixed_turn, seed=seed)]
        self.data = TrainingSet(dressed, motions, recipe, features=how.features, sequences=how.sequences)
        self.dressed, self.weights = dressed, dressed.weights(recipe.smoothing)
        self.network = make_network(kind, self.data.features.shape[1], dressed.vertices, recipe, seed=seed)
        self.network.normalise_by(*self.data.input_statistics())
        self.optimiser = torch.optim.Adam(self.network.parameters(), lr=recipe.learning_rate, fused=True)
        self.random = np.random.default_rng(seed)
        self.noise = torch.Generator().manual_seed(seed)
        self.shaped = bool(recipe.shape_range) and how.features == "motion" and how.physics
        self.windows = recipe.batch if how.sequences else recipe.batch * recipe.window
        self.order = np.empty(0, np.int64)
        self.epoch = 0
        self.loss: PhysicsLoss | None = None
        self.contact: TrainingContact | None = None
        self.targets: VertexTargets | None = None
        if how.targets is None:
            self._prepare_physics()
        else:
            self.targets = how.targets(dressed, motions, trajectories, self.weights, self.data.transforms)
        self.summary: dict[str, Any] = {"high_windows": 0, "skipped_updates": 0, "named_windows": []}
        self.skipped_in_a_row = 0

    def _prepare_physics(self) -> None:
        contact = make_contact(self.dressed.cloth, self.recipe)
        self.loss = PhysicsLoss(self.dressed.cloth, self.recipe, dt=self.data.dt, contact=contact)
        if "collision" in self.recipe.terms:
            samples = contact.sample_matrix @ self.dressed.cloth.rest_positions
            self.contact = TrainingContact(
                self.data, samples, refresh=self.recipe.contact_refresh, one_shape=not self.shaped
            )

    def draw(self) -> np.ndarray:
        """The next windows: every sub-sequence once, in random order, before any comes again."""
        while len(self.order) < self.windows:
            self.order = np.concatenate([self.order, self.random.permutation(len(self.data.starts))])
            self.epoch += 1
        drawn, self.order = self.order[: self.windows], self.order[self.windows :]
        return drawn

    def start_state(self, batch: Batch) -> Any:
        """What the windows of a batch start from: noise of the recipe's sigma, or a network's own masks."""
        return self.network.random_state(len(batch.frames), self.recipe.h0_sigma, self.noise)

    def predict(self, batch: Batch) -> Tensor:
        """Vertices relative to the pelvis, (N, T, V, 3) [m]."""
        offsets, _ = self.network(batch.features, self.start_state(batch))
        return skin(batch.rest + offsets, self.weights, batch.transforms)

    def step(self, number: int) -> dict[str, float]:
        """One update; mean joules a frame by term (cm^2 or cm for what simulated vertices teach)."""
        self._set_rate(number)
        windows = self.draw()
        betas = None
        if self.shaped:
            shapes = self.dressed.body.shape_count
            betas = self.random.uniform(-1, 1, (len(windows), shapes)) * self.recipe.shape_range
        batch = self.data.batch(windows, betas)
        if self.loss is None:
            assert self.targets is not None
            terms = self.targets.terms(self.network, batch, self.start_state(batch))
            self._update(number, batch, terms)
        else:
            x = self.predict(batch)
            posed = self.contact.posed(batch, betas) if self.contact else None
            planes = self.contact.planes(batch, posed) if self.contact and posed else None
            terms = self.loss(x, batch.ahead, planes)
            if self._update(number, batch, terms) and self.contact and posed:
                self.contact.renew(batch, posed, x, self.loss.contact.sample_matrix)
        with torch.no_grad():
            means = torch.stack([term.mean() for term in terms.values()]).tolist()
        return {"loss": sum(means), **dict(zip(terms, means))}

    def _set_rate(self, number: int) -> None:
        recipe = self.recipe
        if recipe.drop_after_epochs is not None:
            late = self.epoch > recipe.drop_after_epochs
        else:
            late = number >= recipe.drop_at * self.steps
        for group in self.optimiser.param_groups:
            group["lr"] = recipe.learning_rate / (recipe.drop_factor if late else 1.0)

    def _update(self, number: int, batch: Batch, terms: dict[str, Tensor]) -> bool:
        """Descend by the mean joules a frame, unless a window is not finite. Returns whether it did."""
        frames = torch.stack(list(terms.values())).sum(0)
        joules = frames.detach().mean(1).numpy()
        bad, high = ~np.isfinite(joules), False
        if bad.any():
            self._remark(number, batch, bad, joules, "update left out")
            self.summary["skipped_updates"] += 1
            self.skipped_in_a_row += 1
            if self.skipped_in_a_row >= GIVE_UP:
                last = self.summary["named_windows"][-1]["window"]
                raise TrainingError(f"training diverged: {GIVE_UP} updates in a row not finite, last {last}")
            return False
        self.skipped_in_a_row = 0
        if self.loss is not None and number >= SETTLING:
            peaks = joules > self.recipe.spike
            high = bool(peaks.any())
            if high:
                self._remark(number, batch, peaks, joules, "gradient clipped")
        self.optimiser.zero_grad(set_to_none=True)
        frames.mean().backward()
        if high:
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), self.recipe.gradient_limit)
        self.optimiser.step()
        return True

    def _remark(self, number: int, batch: Batch, which: np.ndarray, joules: np.ndarray, action: str) -> None:
        for row in np.flatnonzero(which):
            self.summary["high_windows"] += 1
            if len(self.summary["named_windows"]) < NAMED_WINDOWS:
                window = self.data.where(int(batch.frames[row, 0]))
                named = {
                    "step": number,
                    "window": window,
                    "joules": repr(float(joules[row])),
                    "action": action,
                }
                self.summary["named_windows"].append(named)

    def run(
        self, *, log: Callable[[dict[str, float]], None] | None, progress: bool, every: int
    ) -> TrainedModel:
        """All steps. log gets each row of the history."""
        from tqdm import tqdm

        history: list[dict[str, float]] = []
        recent: list[dict[str, float]] = []
        start = time.perf_counter()
        with tqdm(total=self.steps, desc=f"train {self.kind}", unit="step", disable=not progress) as bar:
            for number in range(self.steps):
                recent.append(self.step(number))
                bar.update()
                if len(recent) == every or number == self.steps - 1:
                    row = {name: float(np.mean([r[name] for r in recent])) for name in recent[0]}
                    history.append({"step": number + 1, "seconds": time.perf_counter() - start, **row})
                    bar.set_postfix(loss=f"{row['loss']:.4g}", refresh=False)
                    if log:
                        log(history[-1])
                    recent = []
        return TrainedModel(
            self.kind,
            self.network.eval(),
            self.recipe,
            seed=self.seed,
            steps=self.steps,
            seconds=time.perf_counter() - start,
            history=history,
            summary={**self.summary, "epochs": self.epoch, "training_frames": self.data.frames},
        )
