"""A scene as the public code of HOOD, ContourCraft and Neural Cloth Simulation (NCS) reads it.

Comments cite the lines that read: of HOOD's datasets/from_any_pose.py at commit a65f75b, ContourCraft's at
3095acd, and files of NCS at 8465ec5 (github.com/Dolorousrtur, github.com/hbertiche/NeuralClothSim).
"""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.results.run_folder import flat
from reference_sim.trajectory import write_obj

if TYPE_CHECKING:
    from benchmarks.scene import BuiltScene, Dressed
    from reference_sim.obstacle import Obstacle

THICKNESS = 4.7e-4  # [m], by which HOOD and ContourCraft multiply Lame's constants [Pa]
MESHES = """\
Scene {scene} for HOOD (commit a65f75b) and ContourCraft (3095acd).
{frames} frames at {fps:g} a second; metres, y up, as theirs.
The garment is that of frame 0, at rest; for them it is the rest shape.
garment.obj is to look at: HOOD would put its vertices in another order.

1. Copy these files to fromanypose/ of their data. Their reader cannot add
   the coarse edges (an argument too many), so do it with their code:
     import pickle; from utils.mesh_creation import GarmentCreator
     garment = pickle.load(open("garment.pkl", "rb"))
     GarmentCreator(None, None, None, None).add_coarse_edges(garment)
     pickle.dump(garment, open("garment.pkl", "wb"))
2. In configs/aux/from_any_pose.yaml, below the runner, set step and
   material (else sampled; ours in N/m over {thickness} m, in Pa):
     regular_ts: {dt:.9g}
     material:
       density_override {density:.6g}, bending_coeff_override {bending:.6g}
       lame_mu_override {mu:.6g}, lame_lambda_override {lame_lambda:.6g}
3. Run Inference_from_any_pose.ipynb (HOOD) or
   Inference_from_mesh_sequence.ipynb (ContourCraft) with both pickles and
   without n_steps. It writes temp/output_m.pkl.
4. With the --set, --garment, --body and --motions of the export:
   python -m benchmarks.score {method}=output_m.pkl --scene {scene}
"""
NCS = """\
Scene {scene} for Neural Cloth Simulation (commit 8465ec5).
{frames} frames at {fps:g} a second; metres, y up, as theirs.
The settings are what differs from their smpl.json: the rate; Lame's
constants, halved, for their areas of faces are doubled; bending, twice, for
they take no half. train.txt names this motion alone: for a fair comparison
list there the training motions of other exports.

1. cp -r body_models data ncs NeuralClothSim/; cd NeuralClothSim/ncs
   and in Python there:
     import json
     ours, theirs = (json.load(open(f"configs/{{n}}.json")) for n in ("{name}", "smpl"))
     whole = {{key: {{**theirs[key], **ours.get(key, {{}})}} for key in theirs}}
     json.dump(whole, open("configs/{name}.json", "w"))
2. python train.py --config configs/{name}.json --gpu_id 0
3. python predict.py --config configs/{name}.json --gpu_id 0
   writes ../results/{name}/garment.pc2
4. With the --set, --garment, --body and --motions of the export:
   python -m benchmarks.score authors-ncs=garment.pc2 --scene {scene}
"""


def write_for(method: str, part: Path, scene: BuiltScene) -> None:
    """Write what "hood", "contourcraft" or "ncs" reads of a scene, and a README, into a new folder.

    Raises ValueError for a scene that has not a posed body in each frame.
    """
    dressed, obstacle, material = scene.dressed, scene.obstacle, scene.cloth.material
    if dressed is None or obstacle is None or len(obstacle.positions) != scene.frames:
        raise ValueError(f"--for {method}: it reads a body in each frame, which {scene.name} has not")
    part.mkdir()
    name = flat(scene.name)
    if method == "ncs":
        _write_ncs(part, scene, dressed, name)
    else:
        _write_meshes(part, scene, obstacle)
    text = (NCS if method == "ncs" else MESHES).format(
        scene=scene.name, method=method, name=name, fps=1.0 / scene.dt, dt=scene.dt, frames=scene.frames,
        density=material.areal_density, mu=material.lame_mu / THICKNESS, thickness=THICKNESS,
        lame_lambda=material.lame_lambda / THICKNESS, bending=material.bending_stiffness,
    )  # fmt: skip
    (part / "README.txt").write_text(text, encoding="utf-8")


def _write_pickle(path: Path, **arrays: np.ndarray) -> None:
    """Write a dict that NumPy 1 reads as well: NumPy 2 writes the new name of its module."""
    path.write_bytes(pickle.dumps(arrays, protocol=3).replace(b"cnumpy._core.", b"cnumpy.core."))


def _write_meshes(part: Path, scene: BuiltScene, obstacle: Obstacle) -> None:
    """Write what both read; what they return: runners/from_any_pose.py:96 and runners/ccraft.py:201."""
    cloth, start = scene.cloth, scene.start.astype(np.float32)
    types = np.zeros((cloth.vertex_count, 1), dtype=np.int64)
    types[cloth.pins] = 3  # fixed to the body: NodeType.HANDLE in utils/common.py
    # Lines 651 and 660 of HOOD, 574 and 583 to 588 of ContourCraft: (N,B,3) and (G,3).
    verts = obstacle.positions.astype(np.float32)
    _write_pickle(part / "mesh_sequence.pkl", verts=verts, faces=obstacle.faces)
    # Lines 175 to 186, 208, and 276 with an argument too many; 101 to 113, 134, and 200.
    garment = {"vertices": start, "rest_pos": start, "faces": cloth.faces, "node_type": types}
    _write_pickle(part / "garment.pkl", **garment)
    write_obj(part / "garment.obj", scene.start, cloth.faces)


def _write_ncs(part: Path, scene: BuiltScene, dressed: Dressed, name: str) -> None:
    body, motion, garment, material = dressed.body, dressed.motion, dressed.garment, scene.cloth.material
    models, data = part / "body_models" / name, part / "data" / name
    configs, lists = part / "ncs" / "configs", part / "ncs" / "dataset" / "txt" / name
    for folder in (models, data, lists, configs):
        folder.mkdir(parents=True)
    single: dict[str, Any] = {  # ncs/model/body.py:18-23; vertices and rest pose: float32
        "vertices": body.rest_vertices(dressed.betas), "blend_weights": body.skinning_weights,
        "joints": body.joints(dressed.betas), "rest_pose": np.zeros((len(body.parents), 3)),
    }  # fmt: skip
    single = {key: array.astype(np.float32) for key, array in single.items()}
    np.savez(models / "body.npz", faces=body.faces, parents=body.parents, **single)
    # ncs/utils/IO.py:26-36; ncs/model/cloth.py:52-54.
    write_obj(models / "garment.obj", garment.rest_for(body, dressed.betas), scene.cloth.faces)
    if len(scene.cloth.pins):
        np.save(models / "garment_pin.npy", scene.cloth.pins)
    # ncs/dataset/sequence.py:9-12; ncs/dataset/data.py:22-24, 36-39; rate of answers: 91-96.
    np.savez(data / f"{name}.npz", poses=motion.poses, trans=motion.translations, fps=motion.fps,
        source=scene.name)  # fmt: skip
    for file in ("train.txt", "test.txt"):
        (lists / file).write_text(f"{name}.npz", encoding="utf-8")
    # Joints of their T-shirt: ncs/configs/smpl.json:15. Areas: ncs/utils/mesh.py:128.
    bearing = np.flatnonzero(garment.skinning_weights.any(axis=0)).tolist()
    joints = {*range(7), 9, 12, 13, 14, *range(16, 20), *bearing}
    files = {"train": "train.txt", "validation": "test.txt", "test": "test.txt"}
    loss = {"type": "stvk", "lambda_": material.lame_lambda / 2, "mu": material.lame_mu / 2}
    terms = {"bending": 2 * material.bending_stiffness, "density": material.areal_density}
    settings = {
        "body": {"model": name, "input_joints": sorted(joints)}, "garment": {"name": "garment"},
        "data": {"dataset": name, **files, "fps": 1.0 / scene.dt}, "loss": {"cloth": loss, **terms},
    }  # fmt: skip
    (configs / f"{name}.json").write_text(json.dumps(settings, indent=1), encoding="utf-8")
