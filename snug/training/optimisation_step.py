"""One optimisation step: draw sub-sequences, predict, sum energies, update, search contact anchors anew.

snug.training.train_network repeats it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from snug.body.skinning import skin
from snug.kernels.skinning import FastSkin
from snug.kinds import find_kind
from snug.motion.motion import Motion
from snug.networks.dressed_body import DressedBody
from snug.networks.garment_network import make_network
from snug.networks.tensor_file import select_tensors
from snug.recipe import Recipe
from snug.training.augmentation import make_training_set, varies_shape
from snug.training.contact_planes import NearestVertices, Posed, TrainingContact
from snug.training.device import CPU, compile_for
from snug.training.divergence_guard import SETTLING, DivergenceGuard, live_tensors
from snug.training.physics_loss import PhysicsLoss
from snug.training.simulated_data import TARGETS, BandTargets, Trajectories, VertexTargets
from snug.training.training_set import HiddenStateCache, TrainingError

# Factors on the rate after the drop of `epochs`, and at the end of `cosine`.
DROP, COSINE_END = 0.1, 0.01
DROP_AFTER = 10  # epochs
GRADIENT_LIMIT = 1.0  # norm to which the gradient of a step with a high window is clipped
# Largest share of high windows in a batch whose prediction is still worth a search.
MOSTLY_FINE = 0.25


class Trainer:
    """A network in training, and all that its next step depends on.

    Everything random comes from `seed`; no decision comes from a clock. Random numbers are drawn on the
    CPU whatever the device, so that every device sees the same. Arguments: see
    snug.training.train_network.train_network.
    """

    def __init__(
        self,
        kind: str,
        dressed: DressedBody,
        motions: Sequence[Motion],
        *,
        steps: int,
        seed: int,
        recipe: Recipe,
        trajectories: Trajectories | None = None,
        device: torch.device = CPU,
        kernels: bool | None = None,
    ) -> None:
        if steps < 1:
            raise TrainingError(f"steps={steps}: training needs at least one step")
        if not 0 <= seed < 1 << 63:
            raise TrainingError(f"seed={seed}: give a number from 0 to 2^63 - 1")
        if not motions:
            raise TrainingError("no motions to train on")
        spec = find_kind(kind)
        self.kind, self.spec, self.recipe = kind, spec, recipe
        self.steps, self.seed = steps, seed
        self.device = device
        self.kernels = device.type == "cpu" if kernels is None else kernels
        self.posed_by = FastSkin.apply if self.kernels else compile_for(skin, device)
        self.data = make_training_set(spec, dressed, motions, recipe, seed=seed, device=device)
        self.shaped = varies_shape(spec, dressed, recipe) and recipe.shape_of == "window"
        self.dressed, self.weights = dressed, dressed.weights(recipe.smoothing).to(device)
        inputs, garment = self.data.features.shape[1], dressed.garment
        network = make_network(kind, inputs, dressed.vertices, recipe, seed=seed, pins=garment.pins)
        network.wear(garment)
        network.normalise_by(*self.data.input_statistics())
        self.network = network.to(device)
        self.network.closed_form = self.kernels
        on_gpu = device.type == "cuda"
        self.optimiser = torch.optim.AdamW(
            self.network.parameters(),
            # A captured update reads the rate from the device.
            lr=torch.tensor(recipe.learning_rate, device=device) if on_gpu else recipe.learning_rate,
            eps=recipe.adam_epsilon,
            weight_decay=recipe.weight_decay,
            fused=True,
        )
        self.random = np.random.default_rng(seed)
        self.noise = torch.Generator().manual_seed(seed)
        self.windows = recipe.batch if spec.network.sequential else recipe.batch * recipe.window
        self.order = np.empty(0, np.int64)
        self.epoch = 0
        self._set_losses(motions, trajectories)
        self.hidden_states: HiddenStateCache | None = None
        start = self.network.random_state(1, 0.0, torch.Generator())
        # A state belongs to one body.
        if spec.physics and recipe.remembered and not self.shaped and start is not None:
            states = start.shape[0], start.shape[-1]
            self.hidden_states = HiddenStateCache(self.data.first, states, device)
        self.guard = DivergenceGuard(
            self.network, self.optimiser, spike=recipe.spike if spec.physics else None
        )

    def _set_losses(self, motions: Sequence[Motion], trajectories: Trajectories | None) -> None:
        """Set energies with their contact, distances from simulated vertices, and what they weigh."""
        spec, recipe = self.spec, self.recipe
        self.loss: PhysicsLoss | None = None
        self.contact: TrainingContact | None = None
        self.nearest: NearestVertices | None = None  # in place of anchors
        self.targets: VertexTargets | None = None
        spec.check(recipe)
        if spec.physics or recipe.physics_weight:
            self.loss = PhysicsLoss(
                self.dressed.cloth, recipe, dt=self.data.dt, device=self.device, kernels=self.kernels
            )
            if "collision" in recipe.terms and recipe.contact_samples == "nearest_vertices":
                self.nearest = NearestVertices(self.data)
            elif "collision" in recipe.terms:
                self.contact = TrainingContact(
                    self.data, self.loss.contact, fixed=not self.shaped, kernels=self.kernels
                )
        if not spec.physics:
            self.targets = TARGETS[spec.targets](self.data, motions, trajectories, self.weights)
        if self.contact:
            self.contact.search_first(self.weights)
        # Of energies beside simulated vertices in the loss; all other terms have 1.
        self.factors = dict.fromkeys(recipe.terms, recipe.physics_weight) if self.targets else {}

    def draw(self) -> np.ndarray:
        """Draw the next windows: every sub-sequence once, in random order, before any comes again."""
        even = self.recipe.even
        while len(self.order) < self.windows:
            parts = [
                self.random.permutation(np.arange(offset, len(self.data.starts), even))
                for offset in self.random.permutation(even)
            ]
            self.order = np.concatenate([self.order, *parts])
            self.epoch += 1
        drawn, self.order = self.order[: self.windows], self.order[self.windows :]
        return drawn

    def step(self, number: int) -> dict[str, float]:
        """Take step `number`; return the loss in the unit of the kind and its terms, mean over frames."""
        self._set_rate(number)
        windows = self.draw()
        betas = None
        if self.shaped:
            shapes = self.dressed.body.shape_count
            betas = self.random.uniform(-1, 1, (len(windows), shapes)) * self.recipe.shape_range
        state = self.start_state(self.data.frames_of(windows))
        means = self.learn(number, windows, betas, state)
        return {"loss": sum(self.weigh(means).values()), **means}

    def weigh(self, terms: Mapping[str, Any]) -> dict[str, Any]:
        """Return numbers or tensors of terms as they stand in the loss: name -> factor times term."""
        return {name: self.factors.get(name, 1.0) * term for name, term in terms.items()}

    def learn(
        self, number: int, windows: np.ndarray, betas: np.ndarray | None, state: Tensor | None
    ) -> dict[str, float]:
        """Descend once by the loss of windows (N,) on bodies of betas (N, S); return its mean terms."""
        batch = self.data.batch(windows, betas)
        if isinstance(self.targets, BandTargets):
            return self._update(number, windows, self.targets.terms(self.network, batch, state))[0]
        offsets, end = self.network(batch.features, state)
        # Offsets first: the sum then lies in memory as they do.
        x = self.posed_by(offsets + batch.rest, self.weights, batch.transforms)
        distances = self.targets.distances(x, batch) if self.targets else {}
        if self.loss is None:
            return self._update(number, windows, distances)[0]
        planes = posed = None
        if self.contact:
            posed = self.contact.bodies.pose(batch)
            planes = self.contact.planes(batch, posed, x)
        elif self.nearest:
            planes = self.nearest.planes(batch, x)
        terms = self.loss(x, batch.lead, planes, lag=batch.lag)
        if self.contact and posed and self._search_high(number, batch.frames, posed, x, terms):
            planes = self.contact.planes(batch, posed)
            terms = self.loss(x, batch.lead, planes, lag=batch.lag)
        means, trusted = self._update(number, windows, distances | terms)
        if trusted and self.hidden_states and end is not None:
            self.hidden_states.keep(batch.frames[:, -1], end)
        if self.contact and posed:
            self.contact.settle(batch.frames, trusted=trusted)
            if trusted:
                self.contact.requery(batch.frames, posed, x)
        return means

    def _search_high(
        self, number: int, frames: np.ndarray, posed: Posed, x: Tensor, terms: dict[str, Tensor]
    ) -> bool:
        """Search the anchors of windows (N, T) above the spike limit at once; return whether there are any.

        An old anchor can claim a contact that is none, and so can a rough one: hence the search is exact.
        Not where most windows are high: then it is the network that is lost, and its vertices are no
        guide.
        """
        assert self.contact is not None
        if number < SETTLING:
            return False
        joules = torch.stack(list(terms.values())).detach().sum(0).mean(1)
        high = np.flatnonzero((joules > self.recipe.spike).cpu().numpy())
        if not 0 < len(high) <= MOSTLY_FINE * len(frames):
            return False
        places = (high[:, None] * self.data.window + np.arange(self.data.window)).ravel()
        self.contact.search(places, frames, posed, x, exact=True)
        return True

    def start_state(self, frames: np.ndarray) -> Tensor | None:
        """Return the state before windows with frames (N, T): noise of the recipe plus the cached state.

        For TailorNet it is the dropout masks; a network with a lead reads the frames before.
        """
        if self.network.lead:
            return self.network.state_after(self.data.gather_past(frames[:, 0], self.network.lead))
        state = self.network.random_state(len(frames), self.recipe.h0_sigma, self.noise)
        if state is None:
            return None
        return state + self.hidden_states.at(frames[:, 0]) if self.hidden_states else state

    def _set_rate(self, number: int) -> None:
        """Set the learning rate of step `number`, see Recipe.schedule."""
        factor = 1.0
        if self.recipe.schedule == "epochs" and self.epoch > DROP_AFTER:
            factor = DROP
        if self.recipe.schedule == "cosine":
            factor = COSINE_END + (1 - COSINE_END) * 0.5 * (1 + math.cos(math.pi * number / self.steps))
        for group in self.optimiser.param_groups:
            rate = self.guard.rate * self.recipe.learning_rate * factor
            if isinstance(group["lr"], Tensor):
                group["lr"].fill_(rate)
            else:
                group["lr"] = rate

    def _update(
        self, number: int, windows: np.ndarray, terms: dict[str, Tensor]
    ) -> tuple[dict[str, float], bool]:
        """Descend by the mean weighed loss a frame, unless the guard leaves it out.

        Returns the means by term, and whether the prediction is good enough to search contact anchors
        with.
        """
        stacked = torch.stack(list(terms.values()), 1)  # (N, terms, T)
        means = dict(zip(terms, stacked.detach().mean((0, 2)).tolist()))
        if self.factors:
            stacked = torch.stack(list(self.weigh(terms).values()), 1)
        joules = stacked.detach().sum(1).mean(1).cpu().numpy()
        verdict = self.guard.judge(number, joules, self.namer(windows))
        if verdict == "leave out":
            return means, False
        self.optimiser.zero_grad(set_to_none=True)
        stacked.sum(1).mean().backward()
        parameters = [p for p in self.network.parameters() if p.grad is not None]
        norm = nn.utils.get_total_norm([p.grad for p in parameters if p.grad is not None])
        if not self.guard.accepts(verdict, float(norm)):
            return means, False
        if verdict != "update":
            nn.utils.clip_grads_with_norm_(parameters, GRADIENT_LIMIT, norm)
        self.optimiser.step()
        return means, verdict != "distrust"

    def namer(self, windows: np.ndarray) -> Callable[[int], str]:
        """Return what names a window of a step by its place among `windows` (N,)."""
        return lambda row: self.data.name_frame(self.data.starts[windows[row]])

    def state(self) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """Return everything that the next step depends on: tensors, and plain facts for a JSON header."""
        tensors = {name: tensor.detach() for name, tensor in live_tensors(self.network, self.optimiser)}
        tensors["order"], tensors["noise"] = torch.as_tensor(self.order.copy()), self.noise.get_state()
        if self.hidden_states:
            tensors["hidden_states"] = self.hidden_states.states
        facts: dict[str, Any] = {"epoch": self.epoch, "random": self.random.bit_generator.state}
        for name, part in (("guard", self.guard), ("contact", self.contact)):
            if part is not None:
                state, facts[name] = part.state()
                tensors.update({f"{name}.{key}": tensor for key, tensor in state.items()})
        return tensors, facts

    def resume(self, tensors: dict[str, Tensor], facts: dict[str, Any]) -> None:
        """Continue from a `state`."""
        self.epoch, self.random.bit_generator.state = facts["epoch"], facts["random"]
        self.order = tensors["order"].numpy()
        self.noise.set_state(tensors["noise"])
        for name, parameter in self.network.named_parameters():
            moments = select_tensors(tensors, f"adam.{name}")
            self.optimiser.state[parameter] = {
                key: tensor.to(self.device) for key, tensor in moments.items()
            }
        self.network.load_state_dict(select_tensors(tensors, "network"))
        if self.hidden_states:
            self.hidden_states.states.copy_(tensors["hidden_states"])
        self.guard.resume(select_tensors(tensors, "guard"), facts["guard"])
        if self.contact is not None:
            self.contact.resume(select_tensors(tensors, "contact"), facts["contact"])
