"""What a simulation teaches beside the energies, the rates that a network sees, previous frames as given."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pytest
import torch
from dressing import swaying, tube_dress

from snug.baselines.supervised import TargetError
from snug.loss import PhysicsLoss
from snug.motion import Motion
from snug.motion_inputs import RATED, motion_rates
from snug.pca_dynamics import DynamicsSupervision
from snug.recipe import DEFAULT
from snug.recipes import DYNAMIC, TRAININGS
from snug.rollout import roll_out
from snug.skeleton import axis_angles, rotation_matrices
from snug.skinning import unposed
from snug.trained_model import TrainedModel, make_network
from snug.trainer import Trainer
from snug.training import train
from snug.training_set import TrainingSet

SMALL = replace(DYNAMIC, pca_components=6, pretraining=0)


def swung(motion, seed=0):
    """World vertices (T, V, 3) of a tube whose every vertex swings in three ways of its own."""
    dressed, random = tube_dress(), np.random.default_rng(seed)
    ways = 0.03 * random.normal(size=(3, dressed.vertices, 3))
    time = np.arange(motion.frames) / motion.fps
    sizes = np.stack([np.sin(2 * np.pi * f * time + f) for f in (0.7, 1.1, 1.9)], axis=1)
    offsets = torch.as_tensor(np.einsum("tk,kvi->tvi", sizes, ways), dtype=torch.float32)
    return dressed.skinned(motion, smoothing=SMALL.smoothing, offsets=offsets), offsets


@pytest.fixture(scope="module")
def lesson():
    """Two motions, what was simulated of them, and the supervision."""
    motions = [swaying(30), swaying(26, name="other", degrees=15.0)]
    made = [swung(motion) for motion in motions]
    dressed = tube_dress()
    data = TrainingSet(dressed, motions, SMALL, features="rates", sequences=True)
    trajectories = {motion.name: x for motion, (x, _) in zip(motions, made)}
    supervision = DynamicsSupervision(data, motions, trajectories, dressed.weights(SMALL.smoothing), SMALL)
    return data, supervision, torch.cat([offsets for _, offsets in made])


def pretrained(lesson, steps):
    """A network after that many updates of a pretraining, its supervision, and the data with coordinates."""
    data, supervision = copy.copy(lesson[0]), copy.copy(lesson[1])
    supervision.data = data
    network = make_network("dynamic", data.features.shape[1], tube_dress().vertices, SMALL, seed=0)
    network.normalise_by(*data.input_statistics())
    supervision.pretrain(network, steps=steps, sigma=0.1, seed=3)
    return network, supervision, data


def test_unposing_is_the_inverse_of_skinning():
    motion = swaying(5)
    x, offsets = swung(motion)
    dressed = tube_dress()
    posed = torch.as_tensor(x - dressed.pelvis(motion)[:, None]).float()
    found = unposed(posed, dressed.weights(SMALL.smoothing), dressed.transforms(motion.poses))
    torch.testing.assert_close(found - dressed.rest(), offsets, atol=2e-6, rtol=0)


def test_the_components_span_the_swing(lesson):
    _, supervision, offsets = lesson
    assert float(supervision.spread[2]) > 100 * float(supervision.spread[3])  # it swings in three ways
    torch.testing.assert_close(
        supervision.directions @ supervision.directions.T, torch.eye(6), atol=1e-4, rtol=0
    )
    sizes = supervision.coordinates * supervision.spread
    back = supervision.mean + sizes[:, :3] @ supervision.directions[:3]
    torch.testing.assert_close(back, offsets.flatten(1), atol=1e-5, rtol=0)


def test_the_predicted_swing_costs_nothing_and_another_as_inertia_would(lesson):
    _, supervision, data = pretrained(lesson, 0)
    batch = data.batch(np.array([4]), None)
    predicted = data.features[torch.as_tensor(batch.frames), -6:] * supervision.spread
    exact = (supervision.mean + predicted @ supervision.directions).unflatten(-1, (-1, 3))
    assert float(supervision.energy(exact, batch).max()) < 1e-8
    along = 0.004 * supervision.directions[1].view(1, 1, -1, 3)
    mass = float(tube_dress().cloth.masses.mean())
    expected = 0.5 * SMALL.pca_dynamics * mass * 30.0**2 * 0.004**2
    torch.testing.assert_close(
        supervision.energy(exact + along, batch), torch.full((1, SMALL.window), expected), rtol=1e-3, atol=0
    )


def test_pretraining_brings_the_recurrent_units_to_the_coordinates(lesson):
    apart = []
    for steps in (0, 60, 60):
        _, supervision, data = pretrained(lesson, steps)
        wrong = (data.features[:, -6:] - supervision.coordinates) * supervision.spread
        apart.append(float(wrong.square().sum(-1).mean()))
    assert apart[1] < 0.3 * apart[0] and apart[2] == apart[1]  # and the same again


def test_a_whole_motion_and_windows_with_known_coordinates_meet_the_same_decoder(lesson):
    network, _, data = pretrained(lesson, 5)
    torch.nn.init.normal_(network.offsets.weight, generator=torch.Generator().manual_seed(0))
    whole = data.features[None, : data.first[1]]
    inputs = lesson[0].features.shape[1]
    assert whole.shape[-1] == inputs + 6
    with torch.no_grad():
        known, _ = network(whole)
        alone, _ = network(whole[..., :inputs])
        first, state = network(whole[:, :11, :inputs])
        rest, _ = network(whole[:, 11:, :inputs], state)
    assert float(known.std()) > 0
    torch.testing.assert_close(alone, known, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(torch.cat([first, rest], 1), known, atol=1e-4, rtol=1e-4)


def test_energies_leave_the_pretrained_dynamics_alone(lesson):
    network, _, data = pretrained(lesson, 5)
    offsets, _ = network(data.features[None, :4])
    offsets.sum().backward()
    moved = {name.partition(".")[0] for name, p in network.named_parameters() if p.grad is not None}
    assert moved == {"gru", "offsets"}


def test_too_few_frames_for_the_components_are_refused():
    motion = swaying(24)
    data = TrainingSet(tube_dress(), [motion], SMALL, features="rates", sequences=True)
    with pytest.raises(TargetError, match="24 simulated frames"):
        DynamicsSupervision(
            data, [motion], {motion.name: swung(motion)[0]}, tube_dress().weights(SMALL.smoothing),
            replace(SMALL, pca_components=24),
        )  # fmt: skip
    with pytest.raises(TargetError, match="no simulated trajectory"):
        DynamicsSupervision(data, [motion], {"else": swung(motion)[0]}, tube_dress().weights(0), SMALL)


def turning(rate=1.5, frames=20, heading=0.0):
    """A body that turns to the left and speeds up sideways."""
    time = np.arange(frames) / 30.0
    poses = np.zeros((frames, 24, 3))
    poses[:, 0, 1] = rate * time + heading
    around = rotation_matrices(np.array([0.0, heading, 0.0]))
    path = np.stack([2.0 * time**2, 0 * time, 0 * time], axis=1) @ around.T
    return Motion("turning", poses, path)


def test_rates_tell_of_turning_and_of_a_stop():
    rates = motion_rates(turning())
    assert rates.shape == (20, 6 + 3 * len(RATED) + 12)
    np.testing.assert_allclose(rates[1:, 7], 1.5, rtol=1e-9)  # the pelvis' turn about y [rad/s]
    speeds = np.linalg.norm(rates[:, :3], axis=1)
    np.testing.assert_allclose(np.diff(speeds)[2:], 4.0 / 30.0, rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(rates[2:, 3:6], axis=1), 4.0, rtol=1e-6)
    stopped = turning().poses[np.minimum(np.arange(20), 12)]
    after = motion_rates(Motion("stop", stopped, np.zeros((20, 3))))
    assert after[13, 7] == 0 and after[13, 6 + 30 + 1] == pytest.approx(-45.0)  # [rad/s^2]
    assert np.all(after[15:] == 0)


def test_rates_do_not_know_north():
    np.testing.assert_allclose(motion_rates(turning(heading=1.1)), motion_rates(turning()), atol=1e-9)
    bent = turning().poses.copy()
    bent[:, 0] = axis_angles(rotation_matrices(bent[:, 0]))
    assert np.isfinite(motion_rates(Motion("bent", bent, np.zeros((20, 3))))).all()


def test_detached_inertia_moves_the_last_frame_alone():
    dressed = tube_dress()
    x = torch.randn(1, 3, dressed.vertices, 3, requires_grad=True)
    for detached, moved in ((False, True), (True, False)):
        loss = PhysicsLoss(dressed.cloth, replace(DEFAULT, terms=("inertia",), detached=detached), dt=1 / 30)
        gradient = torch.autograd.grad(loss(x, torch.zeros(1, 3, 3), None)["inertia"].sum(), x)[0]
        assert bool(gradient[:, :2].any()) is moved
        assert gradient[:, 2].any()


def test_training_learns_the_swing_and_the_file_brings_it_back(tmp_path):
    motions = [swaying(30), swaying(26, name="other", degrees=15.0)]
    trajectories = {motion.name: swung(motion)[0] for motion in motions}
    rows: list[dict[str, float]] = []
    assert TRAININGS["snug-dynamic"].simulated
    model = train(
        "dynamic", tube_dress(), motions, steps=16, seed=1, recipe=replace(SMALL, pretraining=30),
        trajectories=trajectories, log=rows.append, progress=False, every=4,
    )  # fmt: skip
    assert rows[-1]["loss"] < rows[0]["loss"] and rows[0]["pca_dynamics"] > 0
    again = TrainedModel.load(model.save(tmp_path / "dynamic.safetensors"))
    one, two = (roll_out(m, tube_dress(), motions[0]).positions for m in (model, again))
    np.testing.assert_array_equal(one, two)
    # Held still, a pose is answered as if nothing had moved before it.
    held = roll_out(again, tube_dress(), motions[0], quasi_static=True).positions
    resting = motions[0].cut(0, 1)
    alone = roll_out(again, tube_dress(), resting, quasi_static=True).positions
    np.testing.assert_allclose(held[0], alone[0], atol=1e-5)
    assert np.abs(held - one).max() > 1e-3


def test_mixed_frames_get_a_swing_that_only_simulated_ones_teach(monkeypatch):
    pretrained_on: list[int] = []
    whole = DynamicsSupervision._apart

    def apart(self, network, chosen, *rest):
        pretrained_on.extend(chosen)
        return whole(self, network, chosen, *rest)

    monkeypatch.setattr(DynamicsSupervision, "_apart", apart)
    motion = swaying(30)
    trainer = Trainer(
        "dynamic", tube_dress(), [motion], steps=2, seed=1, recipe=replace(SMALL, mixed=2.0, pretraining=4),
        trajectories={motion.name: swung(motion)[0]},
    )  # fmt: skip
    assert trainer.data.frames == 30 + 60 and set(pretrained_on) == {0}
    assert trainer.supervision.coordinates.shape == (30, 6)
    assert trainer.data.features[30:, -6:].abs().sum(-1).min() > 0  # mixed frames have coordinates too
    assert trainer.step(0)["pca_dynamics"] > 0 and trainer.pretraining_seconds > 0
