"""Pictures of garments: methods side by side at one frame.

They are drawn on the processor, by a depth buffer: no OpenGL is needed, whose drivers kill the process
where there is no display, and the same machine gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from reference_sim.trajectory import Trajectory
from reports.figures.plotting import DOTS, PAGE_WIDTH, Drawing, file_name, leading, new_figure, wrapped
from reports.finished_run import Run, shown_seeds
from reports.tables.table import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BODY_COLOUR = (0.80, 0.77, 0.74)
CLOTH_COLOUR = (0.72, 0.33, 0.22)  # mid-tone: folds show in both directions, in grey too
KEY, FILL = np.array([-0.78, 0.42, 0.46]), np.array([0.7, 0.1, 0.7])  # lights: right, up, towards
LIFT = 0.012  # [m] that cloth is nearer: a coarse triangle cuts through the skin between its corners
SAMPLES = 2  # of a pixel along each axis
ABOVE = 8.0  # [degrees] that the camera looks down


@dataclass(frozen=True)
class Camera:
    """An orthographic camera that looks a little from above; y is up and a body faces +z.

    centre (3,) [m] and height [m] are of what it sees, turn [degrees] is about the vertical.
    """

    centre: np.ndarray
    height: float
    turn: float = -25.0

    def seen(self, positions: np.ndarray) -> np.ndarray:
        """Return positions (V,3) [m] as right, up and towards the camera, from the picture's middle [m]."""
        return (positions - self.centre) @ camera_axes(self.turn)


def camera_axes(turn: float) -> np.ndarray:
    """Return (3,3): right, up and towards the camera as columns; turned from +z to -x [degrees]."""
    side, lift = np.radians(-turn), np.radians(ABOVE)
    towards = np.array([np.sin(side) * np.cos(lift), np.sin(lift), np.cos(side) * np.cos(lift)])
    right = np.array([np.cos(side), 0.0, -np.sin(side)])
    return np.stack([right, np.cross(towards, right), towards], axis=1)


def camera_for(positions: Sequence[np.ndarray], turn: float, tall: float) -> Camera:
    """Return a camera that just sees all of these (V,3) [m], in a picture `tall` times as high as wide."""
    seen = np.concatenate(positions) @ camera_axes(turn)
    low, high = seen.min(axis=0), seen.max(axis=0)
    width, height = (high - low)[:2]
    return Camera(camera_axes(turn) @ ((low + high) / 2.0), 1.06 * float(max(height, width * tall)), turn)


@dataclass(frozen=True)
class Surface:
    """A mesh to be painted: positions (V,3) [m], faces (F,3), a colour (3,) or one of each vertex (V,3)."""

    positions: np.ndarray
    faces: np.ndarray
    colour: np.ndarray | tuple[float, float, float]
    lift: float = 0.0


def views(
    body: Surface | None, cloths: Sequence[Surface], camera: Camera, width: int, height: int
) -> list[np.ndarray]:
    """Render each cloth on the same body (height,width,3): colours 0 to 1 on white."""
    w, h = width * SAMPLES, height * SAMPLES
    depth, image = np.full(h * w, -np.inf), np.ones((h * w, 3))
    if body is not None:
        _paint(body, camera, (w, h), depth, image)
    pictures = []
    for cloth in cloths:
        nearest, painted = depth.copy(), image.copy()
        _paint(cloth, camera, (w, h), nearest, painted)
        painted = np.clip(painted, 0.0, 1.0)
        pictures.append(painted.reshape(height, SAMPLES, width, SAMPLES, 3).mean(axis=(1, 3)))
    return pictures


def _paint(
    surface: Surface, camera: Camera, size: tuple[int, int], depth: np.ndarray, image: np.ndarray
) -> None:
    """Paint into the buffers (h*w,) and (h*w,3), where the surface is the nearest yet."""
    from reference_sim.geometry.surface import vertex_normals  # loads numba

    w, h = size
    seen = camera.seen(surface.positions)
    scale = h / camera.height
    points = np.stack([w / 2.0 + scale * seen[:, 0], h / 2.0 - scale * seen[:, 1]], axis=1)
    pixels, faces, weights = _covered(points[surface.faces], w, h)
    near = np.einsum("pk,pk->p", weights, seen[surface.faces[faces], 2]) + surface.lift
    np.maximum.at(depth, pixels, near)
    kept = near == depth[pixels]
    pixels, corners, weights = pixels[kept], surface.faces[faces[kept]], weights[kept, :, None]
    normals = (weights * vertex_normals(seen, surface.faces)[corners]).sum(axis=1)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    normals *= np.where(normals[:, 2:] < 0.0, -1.0, 1.0)
    key, fill = (np.clip(normals @ (light / np.linalg.norm(light)), 0.0, 1.0) for light in (KEY, FILL))
    colours = np.broadcast_to(np.asarray(surface.colour, dtype=float), (len(seen), 3))
    image[pixels] = (0.36 + 0.72 * key + 0.16 * fill)[:, None] * (weights * colours[corners]).sum(axis=1)


def _covered(corners: np.ndarray, w: int, h: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return for each pixel in each triangle (F,3,2) [pixels]: its number, the face, weights (P,3)."""
    low = np.clip(np.floor(corners.min(axis=1)).astype(int), 0, [w, h])
    high = np.clip(np.ceil(corners.max(axis=1)).astype(int), 0, [w, h])
    first, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    seen = np.flatnonzero((high > low).all(axis=1) & (area != 0.0))  # from its edge one covers nothing
    low, spans, first, area = low[seen], (high - low)[seen], first[seen], area[seen, None]
    # Weights of the second and third corner are linear in the pixel: slopes and the value at the low
    # corner.
    slopes = [
        np.stack([ac[seen, 1], -ac[seen, 0]], axis=1) / area,
        np.stack([-ab[seen, 1], ab[seen, 0]], axis=1) / area,
    ]
    starts = [(slope * (low + 0.5 - first)).sum(axis=1) for slope in slopes]
    counts = spans.prod(axis=1)
    triangle = np.repeat(np.arange(len(seen)), counts)
    place = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    y, x = np.divmod(place, spans[triangle, 0])
    weights: list[np.ndarray] = []
    for slope, start in zip(slopes, starts):
        weight = start[triangle] + slope[triangle, 0] * x + slope[triangle, 1] * y
        kept = weight >= 0.0
        triangle, x, y = triangle[kept], x[kept], y[kept]
        weights = [one[kept] for one in (*weights, weight)]
    weights.insert(0, 1.0 - weights[0] - weights[1])
    kept = weights[0] >= 0.0
    triangle, x, y = triangle[kept], x[kept] + low[triangle[kept], 0], y[kept] + low[triangle[kept], 1]
    return y * w + x, seen[triangle], np.stack([weight[kept] for weight in weights], axis=1)


INERTIA = "energy/inertia"
MOST_SIDE_BY_SIDE = 6  # methods side by side
FRONT = -25.0  # turn of the camera [degrees]
LINE = 0.18  # inches for a line of text


@dataclass(frozen=True)
class SceneRollOuts:
    """Roll-outs of one scene: method -> cloth, the body where there is one, and method -> label in a film."""

    scene: str
    series: Mapping[str, Trajectory]
    body: Trajectory | None = None
    labels: Mapping[str, str] = field(default_factory=dict)

    @property
    def longest(self) -> Trajectory:
        """The roll-out with the most frames; its dt is nan where it has one."""
        return max(self.series.values(), key=lambda cloth: cloth.frames)

    def chosen_frame(self, methods: Sequence[str], reference: str) -> tuple[int, str]:
        """Choose a frame that these methods have, and say why.

        It is where the reference's inertia is largest, else the middle. The first fifth is left out, in
        which a method may still be settling.
        """
        frames = min(self.series[method].frames for method in methods)
        inertia = self.series[reference].frame_fields.get(INERTIA) if reference in self.series else None
        if inertia is None:
            return frames // 2, "the middle"
        first = frames // 5
        lively = np.nan_to_num(inertia[first:frames])
        return first + int(np.argmax(lively)), "where the simulation's inertia term is largest"


def read_scene(run: Run, rows: pd.DataFrame, methods: Iterable[str]) -> SceneRollOuts:
    """Read the first good seed of each method, or else its first, in the one scene of these rows."""
    scene = str(rows["scene"].iloc[0])
    seeds = shown_seeds(rows).loc[scene]
    cloths = {method: run.roll_outs.cloth(scene, method, int(seeds[method])) for method in methods}
    series = {method: cloth for method, cloth in cloths.items() if cloth is not None}
    return SceneRollOuts(scene, series, run.roll_outs.body(scene) if series else None)


def side_by_side(run: Run) -> Iterator[Drawing]:
    """Draw methods that came to the end of the first whole motion that kept roll-outs, at one frame."""
    rows = run.garment_rows[run.garment_rows["metric"] == "energy/total"]
    for scene in [scene for scenes in run.garments(rows).values() for scene in scenes]:
        of_scene = rows[rows["scene"] == scene]
        roll_outs = read_scene(run, of_scene, leading(run, of_scene["method"]))
        if roll_outs.series:
            most = roll_outs.longest.frames
            whole = [method for method, cloth in roll_outs.series.items() if cloth.frames == most]
            yield draw_side_by_side(run, roll_outs, run.ordered(whole)[:MOST_SIDE_BY_SIDE])
            return


def draw_side_by_side(run: Run, roll_outs: SceneRollOuts, methods: Sequence[str]) -> Drawing:
    """Draw these methods; the caption names the others."""
    frame, why = roll_outs.chosen_frame(methods, run.reference)
    wide = min(PAGE_WIDTH / len(methods), 1.5)
    tile = (wide, 1.12 * wide)
    heads = [wrapped(run.label(method), round(15 * wide)) for method in methods]
    figure = sheet(shots(roll_outs, methods, frame, tile), tile, heads)
    time = float(roll_outs.series[methods[0]].times[frame])
    caption = f"{roll_outs.scene}: frame {frame} (t = {number(time)} s), {why}."
    if others := set(roll_outs.series) - set(methods):
        names = ", ".join(map(run.label, run.ordered(others)))
        caption += f" Not shown, for they ended before it or for want of room: {names}."
    return Drawing(figure, f"frames_{file_name(roll_outs.scene)}", caption, vector=False)


def sheet(images: Sequence[np.ndarray], tile: tuple[float, float], heads: Sequence[str]) -> Figure:
    """Compose pictures in a row, each of `tile` [inches], with texts over them."""
    wide, high = tile
    width = wide * len(images)
    height = LINE * max(text.count("\n") + 1 for text in heads) + high
    figure = new_figure(width, height)
    figure.set_layout_engine("none")
    for place, image in enumerate(images):
        axes = figure.add_axes((place * wide / width, 0.0, wide / width, high / height))
        axes.imshow(image, interpolation="none")
        axes.set_axis_off()
        middle = (place + 0.5) * wide / width
        figure.text(middle, 1.0 - 0.02 / height, heads[place], ha="center", va="top", fontsize=8.5)
    return figure


def shots(
    roll_outs: SceneRollOuts, methods: Sequence[str], frame: int, tile: tuple[float, float]
) -> list[np.ndarray]:
    """Render each method at that frame from the same place."""
    cloths = [roll_outs.series[method] for method in methods]
    surfaces = [Surface(cloth.positions[frame], cloth.faces, CLOTH_COLOUR, LIFT) for cloth in cloths]
    body = roll_outs.body
    skin = (
        Surface(body.positions[frame], body.faces, BODY_COLOUR) if body and frame < body.frames else None
    )
    # A torn cloth would make all others small: the camera is the first one's.
    camera = camera_for([surfaces[0].positions], FRONT, tile[1] / tile[0])
    return views(skin, surfaces, camera, round(DOTS * tile[0]), round(DOTS * tile[1]))
