"""Garments of other people: what comes out of their files, and what is said of those that cannot be used."""

from __future__ import annotations

from dataclasses import replace

import igl
import numpy as np
import pytest

from benchmarks.assets import make_motions, open_assets, read_inputs
from benchmarks.presets import find_preset
from benchmarks.scenes import GarmentScenes
from reference_sim.material import Material
from snug import check
from snug import train as train_command
from snug.body.skeleton import JOINT
from snug.file_options import GarmentFile, parse_garment_file
from snug.garments.garment import GarmentError, name_openings
from snug.garments.implicit_surface import skin_following
from snug.garments.reading import read_garment
from snug.networks.dressed_body import DressedBody
from tests.snug.garments.garment_files import doubled_along, own_chart, saved, z_up
from tests.snug.training.dressing import tailored, tube_dress


@pytest.fixture
def shirt():
    return tailored("tshirt", 300)


@pytest.fixture
def tube():
    """150 vertices, made in milliseconds."""
    return tube_dress().garment


def test_the_tshirt_written_and_read_is_the_tshirt(tmp_path, body, shirt):
    garment = read_garment(GarmentFile(path=saved(tmp_path, shirt)), body)
    np.testing.assert_array_equal(garment.rest_positions, shirt.rest_positions)
    np.testing.assert_array_equal(garment.faces, shirt.faces)
    assert garment.loops.keys() == shirt.loops.keys() and garment.name == "mine" and not len(garment.pins)
    for name, loop in shirt.loops.items():
        np.testing.assert_array_equal(garment.loops[name], loop)
    assert garment.cloth().material == shirt.cloth().material
    # Its weights are blended over the face below, so near those of the nearest vertex.
    np.testing.assert_allclose(garment.skinning_weights.sum(axis=1), 1.0)
    assert np.abs(garment.skinning_weights - shirt.skinning_weights).sum(axis=1).mean() < 0.1


def test_a_chart_with_seams_is_its_rest_shape(tmp_path, body, shirt):
    uv = own_chart(shirt.rest_positions, shirt.faces)
    path = saved(tmp_path, shirt, uv=uv)
    garment = read_garment(GarmentFile(path=path, rest="uv"), body)
    np.testing.assert_array_equal(garment.rest_uv, uv)
    assert read_garment(GarmentFile(path=str(path)), body).rest_uv is None


@pytest.mark.parametrize(
    ("units", "metres", "up"), [("cm", 0.01, "y"), ("mm", 0.001, "z"), ("in", 0.0254, "z")]
)
def test_units_and_axes_give_the_same_garment(tmp_path, body, tube, units, metres, up):
    positions = tube.rest_positions / metres
    path = saved(tmp_path, tube, positions=z_up(positions) if up == "z" else positions)
    garment = read_garment(GarmentFile(path=path, units=units, up=up), body)
    np.testing.assert_allclose(garment.rest_positions, tube.rest_positions, rtol=0, atol=1e-12)


def test_whatever_is_inside_out_is_turned(tmp_path, body, tube):
    """Two halves of a tube, above and below, of which one and the collar of the other are wound inward."""
    heights, middle = tube.rest_positions[tube.faces, 1], np.median(tube.rest_positions[:, 1])
    low, high = heights.max(axis=1) <= middle, heights.min(axis=1) > middle
    used, place = np.unique(tube.faces[low | high], return_inverse=True)
    faces, positions = place.reshape(-1, 3), tube.rest_positions[used]
    collar = heights.min(axis=1) > np.quantile(heights, 0.8)
    assert 0 < collar.sum() < high.sum()
    turned = (low | collar)[low | high][:, None]
    wound = np.where(turned, faces[:, ::-1], faces)
    chart = own_chart(positions, wound)
    path = saved(tmp_path, tube, positions=positions, faces=wound, uv=chart)
    garment = read_garment(GarmentFile(path=path, rest="uv", uv_scale=1.0), body)
    np.testing.assert_array_equal(garment.faces, faces)
    expected = np.where(turned[..., None], chart[:, ::-1], chart)
    np.testing.assert_allclose(garment.rest_uv, expected)


def test_a_skirt_is_held_by_its_waist_and_follows_neither_leg(tmp_path, body):
    skirt = tailored("skirt", 300)
    garment = read_garment(GarmentFile(path=saved(tmp_path, skirt)), body)
    assert set(garment.loops) == {"waist", "hem"}
    np.testing.assert_array_equal(garment.pins, skirt.pins)
    middle = np.abs(garment.rest_positions[garment.hem, 0]) < 0.02
    left, right = (garment.skinning_weights[garment.hem][middle, JOINT[f"{side}_hip"]]
                   for side in ("left", "right"))  # fmt: skip
    assert np.abs(left - right).max() < 0.2 and min(left.min(), right.min()) > 0.2


def capped(garment, *names):
    """Faces of a garment with a fan over each of these openings."""
    loops = [garment.loops[name] for name in names]
    fans = [np.stack([np.full(len(loop) - 2, loop[0]), loop[2:], loop[1:-1]], axis=1) for loop in loops]
    return np.concatenate([garment.faces, *fans])


def test_legs_apart_are_no_sleeves_and_what_has_no_waist_does_not_hang(tmp_path, body):
    trousers = tailored("trousers", 300)
    x, y, z = trousers.rest_positions.T
    apart = np.stack([x + 0.6 * np.sign(x) * np.maximum(0.88 - y, 0.0), y, z], axis=1)
    assert set(name_openings(body, apart, trousers.faces)) == {"waist", "left_leg", "right_leg"}
    path = saved(tmp_path, trousers, faces=capped(trousers, "waist"))
    with pytest.raises(GarmentError, match=r"no waist among its openings \(left_leg, right_leg\)"):
        read_garment(path, body)


def test_tights_hang_from_their_waist_and_mittens_are_no_opening(tmp_path, body, shirt):
    """Tights are the skin below 1 m, arms left out, moved out by 8 mm."""
    arms = skin_following(body, ["left_wrist", "right_wrist", "left_hand", "right_hand"])
    kept_faces = body.faces[((body.template[:, 1] < 1.0) & ~arms)[body.faces].all(axis=1)]
    used, faces = np.unique(kept_faces, return_inverse=True)
    skin = body.template + 0.008 * igl.per_vertex_normals(body.template, np.asarray(body.faces))
    path = saved(tmp_path, shirt, positions=skin[used], faces=faces.reshape(-1, 3))
    tights = read_garment(path, body)
    assert set(tights.loops) == {"waist"} and not set(tights.hem) & set(tights.pins)
    np.testing.assert_array_equal(tights.pins, np.sort(tights.loops["waist"]))
    left = tights.rest_positions[:, 0] > 0.05
    assert tights.skinning_weights[left][:, JOINT["right_knee"]].max() < 0.01
    mittens = saved(tmp_path, shirt, faces=capped(shirt, "left_sleeve", "right_sleeve"))
    assert list(read_garment(mittens, body).loops) == ["neck", "hem"]


def test_each_piece_of_an_outfit_is_held_by_itself(tmp_path, body, shirt):
    skirt, count = tailored("skirt", 300), len(shirt.rest_positions)
    points = np.concatenate([shirt.rest_positions, skirt.rest_positions])
    faces = np.concatenate([shirt.faces, skirt.faces + count])
    garment = read_garment(saved(tmp_path, shirt, positions=points, faces=faces), body)
    np.testing.assert_array_equal(garment.pins, skirt.pins + count)


def test_its_material_is_that_of_simulator_and_training(tmp_path, body, tube):
    (tmp_path / "silk.toml").write_text("young_modulus = 5e4\nbending_stiffness = 1e-6\n")
    file = GarmentFile(path=saved(tmp_path, tube), material=tmp_path / "silk.toml")
    preset = replace(find_preset("smoke"), frames=8, clip_frames=4)
    assets = open_assets(preset, make_motions(["walk"]), ["mine"], inputs=read_inputs(garment=file))
    silk = Material(young_modulus=5e4, bending_stiffness=1e-6)
    scene = GarmentScenes("mine", "mine").scene("walk").at(preset).build(assets)
    assert scene.cloth.material == DressedBody(body, assets.garments["mine"]).cloth.material == silk
    assert {type(term).__name__: term.cloth.material for term in scene.energies}["StretchStVK"] == silk


def moved(garment, change):
    return {"positions": change(garment.rest_positions)}


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (
            lambda s: moved(s, lambda x: 100 * x),
            "not lie on the body .*: give units=cm,up=y behind its",
        ),
        (lambda s: moved(s, lambda x: z_up(x) / 0.0254), "give units=in,up=z behind"),
        (
            lambda s: moved(s, lambda x: np.add(x, (0.03, -0.1, 0.02))),
            "mm deep in the body.*: move it onto",
        ),
        (lambda s: moved(s, lambda x: np.add(x, (0, 0, 0.5))), "mm from the body.*: move it onto"),
        (lambda s: {"faces": np.concatenate([s.faces, s.faces[5:6]])}, "a surface is manifold"),
    ],
)
def test_what_cannot_be_worn_is_refused_with_its_remedy(tmp_path, body, shirt, spoil, words):
    file = saved(tmp_path, shirt, **spoil(shirt))
    with pytest.raises(GarmentError, match=words) as refused:
        read_garment(file, body)
    assert "mine." in str(refused.value) and "\n" not in str(refused.value)


def test_a_material_in_other_units_is_refused(tmp_path, body, tube):
    (tmp_path / "cotton.toml").write_text("thickness = 0.47\n")
    with pytest.raises(GarmentError, match=r"its material is .* mm thick: give thickness in m"):
        read_garment(GarmentFile(path=saved(tmp_path, tube), material=tmp_path / "cotton.toml"), body)


def test_a_seam_is_joined_but_refused_where_a_program_left_it_open(tmp_path, body, tube, gap=1e-5):
    """Cut along x = 0 in front from neck to hem: a tube that one long opening splits, its sides apart."""
    front = np.flatnonzero((np.abs(tube.rest_positions[:, 0]) < 0.02) & (tube.rest_positions[:, 2] > 0))
    positions, faces = doubled_along(tube.rest_positions, tube.faces, front)
    garment = read_garment(saved(tmp_path, tube, positions=positions, faces=faces), body)
    np.testing.assert_array_equal(garment.faces, tube.faces)
    assert len(front) and len(garment.rest_positions) == len(tube.rest_positions)
    positions[len(tube.rest_positions) :, 0] -= gap
    path = saved(tmp_path, tube, positions=positions, faces=faces)
    says = (
        rf"{2 * len(front)} vertices of a seam lie up to {1e3 * gap:.2g} mm apart, one at \(.*\) m: merge"
    )
    with pytest.raises(GarmentError, match=says):
        read_garment(path, body)
    np.testing.assert_array_equal(
        read_garment(GarmentFile(path=path, weld=2 * gap), body).faces, tube.faces
    )
    positions[len(tube.rest_positions) :, 0] -= 0.02  # a slit, along which it falls off
    with pytest.raises(GarmentError, match="nothing holds it"):
        read_garment(saved(tmp_path, tube, positions=positions, faces=faces), body)


def test_a_word_that_means_nothing_is_refused():
    for words, expected in (
        ("uv_scale=2", "add rest=uv"),
        ("rest=uv,uv_scale=-1", "a number above 0"),
        ("path=other.obj", "no word is called 'path'"),
        ("units=km", "units=km: choose from m, cm, mm"),
        ("weld=0", "give a distance above 0"),
    ):
        with pytest.raises(ValueError, match=expected):
            parse_garment_file(f"a.obj,{words}")


def test_check_says_what_was_found_and_how_to_mend_it(tmp_path, capsys, tube):
    good = saved(tmp_path, tube, faces=tube.faces[:, ::-1], name="good.obj")
    assert check.main([str(good)]) == 0
    output = capsys.readouterr().out
    assert "good.obj: can be used" in output and "neck (15 vertices), hem (15 vertices)" in output
    bad = saved(tmp_path, tube, positions=1000 * tube.rest_positions, name="bad.obj")
    (tmp_path / "broken.obj").write_text("v 0 0\n")
    assert check.main([str(tmp_path / "broken.obj"), str(bad), str(good)]) == 1
    printed = capsys.readouterr()
    assert "line 1 is not understood" in printed.err and "give units=mm" in printed.err
    assert "good.obj: can be used" in printed.out


def test_training_by_a_command_takes_the_file_with_its_chart_and_material(tmp_path, body, tube):
    path = saved(tmp_path, tube, uv=100 * own_chart(tube.rest_positions, tube.faces))
    (tmp_path / "silk.toml").write_text("density = 300.0\n")
    words = f"{path},rest=uv,uv-scale=0.01,material={tmp_path / 'silk.toml'}"
    garment = train_command.choose_garment(train_command.parse_options(["--garment", words]), body)
    assert garment.cloth().material == Material(density=300.0) and len(garment.rest_positions) == 150
    np.testing.assert_allclose(garment.cloth().rest_uv, own_chart(tube.rest_positions, tube.faces))
    assert train_command.main(["--garment", "tshirt,up=z"]) == 2
