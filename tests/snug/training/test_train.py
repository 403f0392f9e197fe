"""Training lowers the physics, repeats bit for bit, survives files, and names what goes wrong."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import torch

from reference_sim.energies import StretchStVK
from snug.body.skeleton import JOINT, joint_positions
from snug.body.skinning import skin
from snug.motion.library import TRAIN, make_motion
from snug.motion.motion import Motion, arm_clearance, mirror_motion
from snug.networks import trained_model
from snug.networks.architectures import ARCHITECTURES
from snug.networks.roll_out import roll_out
from snug.networks.tensor_file import read_tensors
from snug.networks.trained_model import ModelFileError, TrainedModel
from snug.recipes.named import PAPER, SUPERVISED
from snug.recipes.recipe import DEFAULT, Recipe, RecipeError
from snug.training.augmentation.mixed_clips import augment, hang_arms, lap_clearance, make_mixed_clips
from snug.training.losses.vertex_targets import TargetError, vertex_loss
from snug.training.optimisation_step import Trainer
from snug.training.train_network import train_network, untrained_model
from snug.training.training_set import TrainingError, TrainingSet
from tests.snug.training.dressing import leaning, swaying, tube_dress

PLAIN = replace(DEFAULT, mixed=0.0)


def short(kind="snug", *, steps=60, seed=0, recipe=PLAIN, motions=None, **options):
    clips = motions or [swaying(30)]
    options = {"progress": False, "every": 10, **options}
    return train_network(kind, tube_dress(), clips, steps=steps, seed=seed, recipe=recipe, **options)


@pytest.fixture(scope="module")
def trained():
    return short(steps=150)


def test_training_lowers_the_potential(trained):
    first, last = trained.history[0], trained.history[-1]
    assert last["loss"] < 0.9 * first["loss"] and last["strain"] < first["strain"]
    parts = sum(last[term] for term in DEFAULT.terms)
    assert last["loss"] == pytest.approx(parts, rel=1e-6) and last["step"] == 150


@pytest.mark.parametrize(
    ("schedule", "wanted"),
    [("cosine", (1.0, 0.505, 0.01)), ("constant", (1.0, 1.0, 1.0)), ("epochs", (1.0, 1.0, 0.1))],
)
def test_rate_follows_its_schedule(schedule, wanted):
    recipe = replace(PLAIN, schedule=schedule, drop_after_epochs=2)
    trainer = Trainer("snug", tube_dress(), [swaying(30)], steps=40, seed=0, recipe=recipe)
    for number, epoch, share in zip((0, 20, 40), (1, 2, 3), wanted):
        trainer.epoch = epoch
        trainer._set_rate(number)
        rate = trainer.optimiser.param_groups[0]["lr"]
        assert rate == pytest.approx(share * PLAIN.learning_rate, rel=1e-9)


@pytest.mark.parametrize("decay", [0.0, 0.5])
def test_weight_decay_takes_its_share_off_weights_that_nothing_else_moves(decay):
    recipe = replace(PLAIN, weight_decay=decay, schedule="constant")
    trainer = Trainer("snug", tube_dress(), [swaying(30)], steps=8, seed=0, recipe=recipe)
    unread = np.isinf(trainer.data.input_statistics()[1])
    weights = next(p for p in trainer.network.parameters() if p.shape[-1] == len(unread))
    before = weights.detach().clone()
    for number in range(8):
        trainer.step(number)
    left = (1 - recipe.learning_rate * decay) ** 8
    assert unread.any() and not unread.all()
    assert torch.allclose(weights[:, unread], left * before[:, unread], rtol=1e-5)
    assert not torch.allclose(weights[:, ~unread], left * before[:, ~unread], rtol=1e-5)


def test_trained_beats_skinning_in_a_roll_out(trained):
    from reference_sim.energies import Gravity, StretchStVK

    dressed, motion = tube_dress(), swaying(30)

    def joules(x):
        return sum(E(dressed.cloth).value_and_gradient(x)[0] for E in (StretchStVK, Gravity))

    run, skinned = roll_out(trained, dressed, motion), dressed.skinned(motion, smoothing=20)
    assert np.mean([joules(x) for x in run.positions]) < np.mean([joules(x) for x in skinned])


@pytest.mark.parametrize("kind", ["snug", "pbns"])
def test_same_seed_same_weights(kind):
    a, b, c = (short(kind, steps=12, seed=seed) for seed in (4, 4, 5))
    same = [torch.equal(p, q) for p, q in zip(a.network.parameters(), b.network.parameters())]
    assert all(same)
    assert not torch.equal(a.network.offsets.weight, c.network.offsets.weight)


def test_model_survives_its_file(trained, tmp_path):
    path = trained.save(tmp_path / "deep" / "model.safetensors")
    loaded = TrainedModel.load(path)
    assert [p.name for p in path.parent.iterdir()] == ["model.safetensors"]
    assert (loaded.kind, loaded.recipe, loaded.steps) == ("snug", trained.recipe, 150)
    assert loaded.history == trained.history and loaded.megabytes == trained.megabytes
    assert read_tensors(path)[1]["unit"] == "J"  # of the losses, for whoever draws them
    motion = swaying(12)
    before, after = (roll_out(model, tube_dress(), motion).positions for model in (trained, loaded))
    assert (before == after).all()


def test_broken_model_files_are_named(tmp_path, trained, monkeypatch):
    from safetensors.torch import save_file

    with pytest.raises(ModelFileError, match="no such model"):
        TrainedModel.load(tmp_path / "none.safetensors")
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(trained.save(tmp_path / "m.safetensors").read_bytes()[:2000])
    with pytest.raises(ModelFileError, match=r"broken\.safetensors"):
        TrainedModel.load(broken)
    foreign = tmp_path / "foreign.safetensors"
    save_file({"a": torch.zeros(2)}, foreign)
    with pytest.raises(ModelFileError, match="no model of this project"):
        TrainedModel.load(foreign)
    with monkeypatch.context() as version:  # one that knows more
        version.setitem(ARCHITECTURES, "later-kind", ARCHITECTURES["snug"])
        later = replace(trained, kind="later-kind").save(tmp_path / "later.safetensors")
    with pytest.raises(
        ModelFileError, match=r"later\.safetensors: broken model file \(unknown model 'later-kind'"
    ):
        TrainedModel.load(later)


def test_a_model_file_of_an_older_version_is_refused_before_it_is_read(tmp_path, trained, monkeypatch):
    monkeypatch.setattr(trained_model, "MODEL_FORMAT", "snug-model-5")
    path = trained.save(tmp_path / "old.safetensors")
    monkeypatch.undo()
    with pytest.raises(ModelFileError, match=r"old\.safetensors: format 'snug-model-5', this version reads"):
        TrainedModel.load(path)


def test_supervised_learns_what_it_is_shown():
    dressed, motion = tube_dress(), swaying(30)
    target = dressed.skinned(motion, smoothing=20)
    target[:, :, 1] -= 0.02
    model = short("supervised", steps=150, recipe=SUPERVISED, motions=[motion], trajectories={"sway": target})
    assert model.recipe.window == 16 and model.recipe.mixed == 0
    start = vertex_loss(torch.as_tensor(target - [0, -0.02, 0]), torch.as_tensor(target)).mean()
    assert start == pytest.approx(4.0, rel=1e-3)  # 2 cm, squared
    assert model.history[-1]["loss"] < 0.1 * float(start)
    error = np.abs(roll_out(model, dressed, motion).positions - target)
    assert error.mean() < 4e-3


def test_supervised_names_unfit_targets():
    dressed, motion = tube_dress(), swaying(30)
    good = dressed.skinned(motion)
    with pytest.raises(TargetError, match="needs trajectories"):
        short("supervised")
    with pytest.raises(TargetError, match="'sway'"):
        short("supervised", trajectories={"walk": good})
    with pytest.raises(TargetError, match=r"shape \(29, 150, 3\), expected \(30, 150, 3\)"):
        short("supervised", trajectories={"sway": good[:-1]})
    good[17, 3] = np.nan
    with pytest.raises(TargetError, match="frame 17"):
        short("supervised", trajectories={"sway": good})


def test_paper_recipe_varies_the_body(monkeypatch):
    shapes = []
    whole = TrainingSet.batch

    def spy(self, windows, betas):
        shapes.append(betas)
        return whole(self, windows, betas)

    monkeypatch.setattr(TrainingSet, "batch", spy)
    model = short(recipe=PAPER, steps=8)
    assert all(np.isfinite(row["loss"]) for row in model.history)
    betas = np.concatenate(shapes)
    assert (
        betas.shape == (8 * 16, 10) and betas.max() > 2.5 and betas.min() < -2.5 and np.abs(betas).max() <= 3
    )


SHAPED = replace(DEFAULT, shape_range=3.0, shape_of="clip")


def test_each_mixed_clip_has_a_body_of_its_own_and_given_motions_the_mean_one():
    def data(seed):
        return Trainer("snug", tube_dress(), [swaying(30)], steps=1, seed=seed, recipe=SHAPED).data

    mine, dressed = data(0), tube_dress()
    drawn = mine.shapes[1:]
    assert not mine.shapes[0].any() and len(drawn) == 6 and len(np.unique(drawn)) == drawn.size
    assert 2.5 < np.abs(drawn).max() <= 3.0 and 0.2 < (drawn > 0).mean() < 0.8
    assert np.array_equal(data(0).shapes, mine.shapes) and not np.isin(data(1).shapes[1:], drawn).any()
    half = Trainer(
        "snug",
        tube_dress(),
        [swaying(30)],
        steps=1,
        seed=0,
        recipe=replace(SHAPED, mixed=60.0, shape_share=0.5),
    ).data.shapes
    assert 8 <= (half == 0.0).all(1)[1:].sum() <= 22 and len(half) == 31
    clips = augment([swaying(30)], SHAPED, vertices=dressed.vertices, seed=0)
    windows = np.array([4, np.flatnonzero(mine.starts == mine.first[3] + 7)[0]])
    batch = mine.batch(windows)
    for row, (motion, betas, first) in enumerate([(swaying(30), None, 4), (clips[2], drawn[2], 7)]):
        now = slice(first, first + 3)
        assert torch.allclose(batch.rest[row, 0], dressed.rest(betas), atol=1e-6)
        assert torch.allclose(batch.transforms[row], dressed.transforms(motion.poses, betas)[now])
        assert torch.equal(batch.features[row], dressed.features(motion, SHAPED, betas)[now])


def test_a_shape_on_another_body_is_strained_as_the_simulator_has_it():
    """The rest state is the garment's own, whatever body it is on."""
    trainer = Trainer("snug", tube_dress(), [swaying(30)], steps=1, seed=0, recipe=SHAPED)
    dressed = trainer.dressed
    betas = trainer.data.shapes[2]
    batch = trainer.data.at(trainer.data.first[2] + np.arange(3)[None])
    x = skin(batch.rest, trainer.weights, batch.transforms)
    strain = trainer.loss(x, batch.ahead, None)["strain"][0]
    expected = [
        StretchStVK(dressed.garment.cloth()).value_and_gradient(own.double().numpy())[0] for own in x[0]
    ]
    assert strain.numpy() == pytest.approx(expected, rel=1e-3)
    unposed = dressed.garment.rest_for(dressed.body, betas)
    assert (
        StretchStVK(dressed.garment.cloth()).value_and_gradient(unposed)[0] > 0.01
    )  # [J]: not at rest there


def test_shapes_of_clips_want_clips():
    with pytest.raises(RecipeError, match="mixed above zero"):
        replace(SHAPED, mixed=0.0)
    assert Trainer("pbns", tube_dress(), [swaying(30)], steps=1, seed=0, recipe=SHAPED).data.shapes is None


def test_other_skeletons_pose_as_the_body_does():
    dressed, motion = tube_dress(), leaning(swaying(12))
    data = TrainingSet(dressed, [motion], PLAIN, features="motion", sequences=True)
    betas = np.random.default_rng(0).uniform(-3, 3, (2, 10))
    batch = data.batch(np.array([1, 5]), betas)
    assert torch.allclose(batch.transforms[1], dressed.transforms(motion.poses[5:8], betas[1]), atol=1e-5)
    assert torch.allclose(batch.rest[1, 0], dressed.rest(betas[1]))
    assert torch.allclose(batch.features[1], dressed.features(motion, PLAIN, betas[1])[5:8], atol=1e-6)


def test_windows_stay_within_a_motion_and_all_come_by():
    clips = [swaying(9, name="a"), swaying(7, name="b")]
    trainer = Trainer("snug", tube_dress(), clips, steps=1, seed=0, recipe=replace(PLAIN, batch=4))
    starts = set()
    for _ in range(3):
        frames = trainer.data.batch(trainer.draw(), None).frames
        assert ((frames < 9).all(axis=1) | (frames >= 9).all(axis=1)).all()
        starts |= set(frames[:, 0].tolist())
    assert starts == {*range(7), *range(9, 14)}
    assert trainer.data.where(9 + 3) == "motion 'b' frame 3"
    disjoint = TrainingSet(
        tube_dress(), clips, replace(PLAIN, window_stride=3), features="motion", sequences=True
    )
    assert disjoint.starts.tolist() == [0, 3, 6, 9, 12]


def test_impossible_trainings_are_refused():
    with pytest.raises(TrainingError, match="steps=0"):
        short(steps=0)
    with pytest.raises(TrainingError, match="has 3 frames"):
        short(motions=[swaying(2)])
    with pytest.raises(TrainingError, match="one frame rate"):
        short(motions=[swaying(30), swaying(30, fps=60.0)])
    with pytest.raises(ValueError, match=r"'gnn'.*snug, .*supervised, pbns"):
        short("gnn")
    with pytest.raises(TrainingError, match="no motions"):
        train_network("snug", tube_dress(), [], steps=1, seed=0)


def test_untrained_is_not_skinning_alone():
    dressed, motion = tube_dress(), swaying()
    model = untrained_model("snug", dressed, [motion], seed=0)
    gap = roll_out(model, dressed, motion).positions - dressed.skinned(motion, smoothing=20)
    assert 1e-3 < np.abs(gap).max() < 0.1 and model.steps == 0


def test_mirror_swaps_the_sides():
    motion = make_motion("kick")
    mirror = mirror_motion(motion)
    plain = joint_positions(motion.poses, motion.translations)
    other = joint_positions(mirror.poses, mirror.translations)
    assert np.abs(other[:, 1] - plain[:, 2] * [-1, 1, 1]).max() < 1e-9  # left hip, right hip
    assert np.abs(other[:, 20] - plain[:, 21] * [-1, 1, 1]).max() < 1e-9  # wrists
    assert np.abs(mirror_motion(mirror).poses - motion.poses).max() == 0


def test_mixed_motions_are_continuous_and_repeat():
    clips = [make_motion(name) for name in ("walk", "squat", "arm_raise")]
    mixed = make_mixed_clips(clips, 300, turn=0.1, lifted=0.25, seed=3)
    again = make_mixed_clips(clips, 300, turn=0.1, lifted=0.25, seed=3)
    assert len(mixed) == 5 and all((a.poses == b.poses).all() for a, b in zip(mixed, again))
    assert make_mixed_clips(clips, 0, turn=0.1, lifted=0.25, seed=3) == []
    from snug.motion.motion import joint_speeds

    fastest = max(joint_speeds(clip).max() for clip in clips)
    assert max(joint_speeds(clip).max() for clip in mixed) < 2 * fastest + 2.0


def test_mixed_arms_hang_each_at_a_distance_of_its_own_clear_of_the_torso():
    clips = [make_motion(name) for name in ("walk", "squat", "jumping_jack")]
    mixed = make_mixed_clips(clips, 3000, turn=0.1, lifted=0.25, seed=3)
    nearest = np.rad2deg([arm_clearance(clip).min(axis=0) for clip in mixed])
    assert nearest.min() > 24.0
    low, high = np.percentile(nearest, (10, 90))
    assert low < 30.0 < 42.0 < high < 60.0  # a clip of the library begins at 42
    assert abs(np.corrcoef(nearest.T)[0, 1]) < 0.4  # 50 clips


@pytest.mark.parametrize("left, right", [(25.0, 60.0), (70.0, 30.0)])
def test_arms_hang_as_near_as_told(left, right):
    poses = np.zeros((1, 24, 3))
    poses[:, [JOINT["left_shoulder"], JOINT["right_shoulder"]], 2] = [-0.9, 0.4]
    hung = hang_arms(Motion("hanging", poses, np.zeros((1, 3))), np.deg2rad([left, right]))
    assert np.rad2deg(arm_clearance(hung)) == pytest.approx(np.array([[left, right]]), abs=0.1)


def test_mixed_thighs_stay_off_the_belly():
    clips = [make_motion(name) for name in ("squat", "bow")]  # together: a squat's legs under a bowed spine
    mixed = make_mixed_clips(clips, 3000, turn=0.1, lifted=1.0, seed=3)
    nearest = [np.rad2deg(lap_clearance(clip).min()) for clip in [*clips, *mixed]]
    assert min(nearest) > 55.0 and max(nearest) > 70.0  # 3 where nothing opens the hips


def test_mixed_thighs_are_lifted_as_high_as_hips_bend():
    standing = Motion("standing", np.zeros((60, 24, 3)), np.zeros((60, 3)))

    def lifts(lifted):
        mixed = make_mixed_clips([standing], 6000, turn=0.0, lifted=lifted, seed=3)
        hips = [JOINT["left_hip"], JOINT["right_hip"]]
        forward = [-np.rad2deg(clip.poses[:, hips, 0]) for clip in mixed]
        assert np.min(forward) > -1e-9
        return np.max(forward, axis=1).ravel()

    assert lifts(0.0).max() == 0.0
    share = (lifts(0.25) > 0.0).mean()
    assert 0.15 < share < 0.35 and (lifts(0.25) > 0.0).reshape(-1, 2).any(1).mean() > share  # one leg alone
    assert 75.0 < lifts(1.0).max() <= 90.0


def test_mixed_legs_come_from_clips_of_their_own():
    standing = Motion("standing", np.zeros((60, 24, 3)), np.zeros((60, 3)))
    poses = standing.poses.copy()
    poses[:, [JOINT["left_hip"], JOINT["right_hip"]], 0] = -1.0
    clips = [standing, replace(standing, name="sitting", poses=poses)]
    mixed = make_mixed_clips(clips, 1200, turn=0.0, lifted=0.0, seed=1)
    lifted = np.array([clip.poses[0, [JOINT["left_hip"], JOINT["right_hip"]], 0] < -0.5 for clip in mixed])
    for legs in ([True, False], [False, True], [True, True], [False, False]):
        assert (lifted == legs).all(1).any(), legs


def test_mixed_frames_are_as_many_as_asked_for_and_as_memory_holds():
    clips = [make_motion("walk")]  # of 120 frames
    recipe = replace(DEFAULT, mixed=3.0)
    counts = {v: len(augment(clips, recipe, vertices=v, seed=0)) for v in (1000, 500_000, 2_000_000)}
    assert counts == {1000: 6, 500_000: 3, 2_000_000: 1}
    assert len(augment(clips, replace(DEFAULT, mixed=500.0), vertices=1000, seed=0)) == 333  # 20,000 frames


def test_mixed_motions_join_the_training_set():
    model = short(recipe=replace(DEFAULT, mixed=2.0), steps=2)
    assert model.summary["training_frames"] == 30 + 60


def test_command_line_answers_without_torch():
    code = "import sys, snug.train as t; t.parse_options([]); sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
    shown = subprocess.run([sys.executable, "-m", "snug.train", "--help"], capture_output=True, text=True)
    assert shown.returncode == 0 and "examples:" in shown.stdout


def test_command_line_refuses_a_wrong_path(capsys, tmp_path):
    from snug.train import main
    from snug.training.command.choices import choose_motions
    from snug.training.command.options import parse_options

    out = tmp_path / "model.safetensors"
    assert main(["--motions", str(tmp_path / "nowhere"), "-o", str(out)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "nowhere" in error and not out.exists()
    assert main(["--repair", "-o", str(out)]) == 2
    assert "say of which files by --motions" in capsys.readouterr().err
    np.savez(tmp_path / "a.npz", poses=np.zeros((9, 72)), trans=np.zeros((9, 3)))
    validating = ["--validation", "kick", "--validation", "bow"]
    training, validation = choose_motions(parse_options(validating), None)
    assert [motion.name for motion in validation] == ["bow", "kick"]
    assert {motion.name for motion in training} == set(TRAIN) - {"bow"}
    assert main(["--validation", "dance_turn", "-o", str(out)]) == 2  # a test motion
    assert "--validation dance_turn: no such motion among walk" in capsys.readouterr().err
    words = ["--motions", str(tmp_path), "--motion-fps", "30", "--hold-out", "b", "-o", str(out)]
    assert main(words) == 2  # the motion itself was read
    assert "--hold-out b: no such motion among a" in capsys.readouterr().err
    assert Recipe() == DEFAULT and isinstance(swaying(), Motion)


def test_command_line_refuses_what_it_could_not_do_before_any_work(capsys, tmp_path):
    from snug.train import main

    (tmp_path / "file").touch()
    assert main(["-o", str(tmp_path / "file" / "model.safetensors")]) == 2
    assert main(["--threads", "0", "-o", str(tmp_path / "model.safetensors")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 2 and "file" in error and "--threads 0: at least 1" in error
    for words, said in (
        (["-o", str(tmp_path)], "is a folder; name a file"),
        (["--seed", "-1"], "--seed -1: at least 0"),
        (["--checkpoint-minutes", "-1"], "--checkpoint-minutes -1.0: at least 0"),
        (["--patience", "3"], "--patience 3: add --validation NAME"),
        (["--garment", "a/shirt.obj", "--garment", "b/shirt.obj"], "model-shirt.safetensors: rename a file"),
        (["--motions", "nowhere", "-o", str(tmp_path / "new" / "sub" / "m.safetensors")], "nowhere"),
    ):
        assert main(["-o", str(tmp_path / "model.safetensors"), *words]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and said in error
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_each_model_has_a_file_of_its_own():
    from snug.training.command.options import parse_options

    assert parse_options([]).out == "snug.safetensors"
    assert parse_options(["--model", "pbns"]).out == "pbns.safetensors"
    assert parse_options(["--model", "pbns", "-o", "mine.safetensors"]).out == "mine.safetensors"


def test_a_neck_that_hardly_moved_in_training_does_not_drown_the_other_inputs_when_it_bends():
    trained, bent = swaying(30), np.zeros((1, 24, 3))
    trained.poses[:, JOINT["neck"], 0] += np.deg2rad(np.linspace(-2.0, 2.0, 30))
    bent[:, JOINT["neck"], 0] = np.deg2rad(40.0)
    dressed = tube_dress()
    mean, std = TrainingSet(dressed, [trained], PLAIN, features="pose", sequences=False).input_statistics()
    unseen = dressed.features(Motion("bent", bent, np.zeros((1, 3))), PLAIN, feature_set="pose").numpy()
    assert np.abs((unseen - mean) / std).max() < 4.0


def test_only_inputs_that_hold_a_shape_are_normalised_by_its_range():
    shaped = replace(PLAIN, shape_range=3.0)
    dressed, clips = tube_dress(), [swaying(30)]
    pose = TrainingSet(dressed, clips, shaped, features="pose", sequences=False)
    assert np.array_equal(pose.input_statistics()[0], pose.features.mean(0).numpy())
    motion = TrainingSet(dressed, clips, shaped, features="motion", sequences=True)
    assert np.allclose(motion.input_statistics()[1][-10:], np.sqrt(3.0))
