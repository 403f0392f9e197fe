"""Pictures of garments: methods side by side from one camera, as frames of a film and in the report.

They are drawn on the processor, by a depth buffer: no OpenGL is needed, whose drivers kill the process
where there is no display, and the same machine gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import uniform_filter1d

from reference_sim.trajectory import Trajectory
from reports.figures.plotting import DOTS, PAGE_WIDTH, Drawing, file_name, new_figure
from reports.finished_run import Run, pick_seeds, shown_frames
from reports.statistics.outcomes import LEARNED, leads
from reports.statistics.relative_excess import TOTAL
from reports.tables.table import name_scene

BODY_COLOUR = (0.80, 0.77, 0.74)
CLOTH_COLOUR = (0.72, 0.33, 0.22)  # mid-tone: folds show in both directions, in grey too
KEY, FILL = np.array([-0.78, 0.42, 0.46]), np.array([0.7, 0.1, 0.7])  # lights: right, up, towards
# Cloth is drawn as much nearer: a coarse triangle cuts through the skin between its corners.
LIFT = 0.012  # [m]
SAMPLES = 2  # of a pixel along each axis
ABOVE = 8.0  # [degrees] that the camera looks down


@dataclass(frozen=True)
class Camera:
    """An orthographic camera that looks a little from above; y is up and a body faces +z.

    centre (3,) [m] of the view, its height [m]; turn [degrees] about the vertical.
    """

    centre: np.ndarray
    height: float
    turn: float

    def project(self, positions: np.ndarray) -> np.ndarray:
        """Return positions (V,3) [m] as right, up and towards the camera, from the picture's middle [m]."""
        return (positions - self.centre) @ camera_axes(self.turn)


def camera_axes(turn: float) -> np.ndarray:
    """Return (3,3): right, up and towards the camera as columns; turned from +z to -x [degrees]."""
    side, lift = np.radians(-turn), np.radians(ABOVE)
    towards = np.array([np.sin(side) * np.cos(lift), np.sin(lift), np.cos(side) * np.cos(lift)])
    right = np.array([np.cos(side), 0.0, -np.sin(side)])
    return np.stack([right, np.cross(towards, right), towards], axis=1)


@dataclass(frozen=True)
class Surface:
    """A mesh to be painted: positions (V,3) [m], faces (F,3), its colour."""

    positions: np.ndarray
    faces: np.ndarray
    colour: tuple[float, float, float]
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
    view = camera.project(surface.positions)
    scale = h / camera.height
    points = np.stack([w / 2.0 + scale * view[:, 0], h / 2.0 - scale * view[:, 1]], axis=1)
    pixels, faces, weights = _rasterise(points[surface.faces], w, h)
    depths = np.einsum("pk,pk->p", weights, view[surface.faces[faces], 2]) + surface.lift
    np.maximum.at(depth, pixels, depths)
    front = depths == depth[pixels]
    pixels, corners, weights = pixels[front], surface.faces[faces[front]], weights[front, :, None]
    normals = (weights * vertex_normals(view, surface.faces)[corners]).sum(axis=1)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    normals *= np.where(normals[:, 2:] < 0.0, -1.0, 1.0)
    key, fill = (np.clip(normals @ (light / np.linalg.norm(light)), 0.0, 1.0) for light in (KEY, FILL))
    shade = 0.36 + 0.72 * key + 0.16 * fill
    image[pixels] = shade[:, None] * np.asarray(surface.colour)


def _rasterise(corners: np.ndarray, w: int, h: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return for each pixel in each triangle (F,3,2) [pixels]: its number, the face, weights (P,3)."""
    low = np.clip(np.floor(corners.min(axis=1)).astype(int), 0, [w, h])
    high = np.clip(np.ceil(corners.max(axis=1)).astype(int), 0, [w, h])
    first, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    faces = np.flatnonzero((high > low).all(axis=1) & (area != 0.0))  # edge-on: covers nothing
    low, spans, first, area = low[faces], (high - low)[faces], first[faces], area[faces, None]
    # Weights of the second and third corner are linear in the pixel: slopes, value at the low corner.
    slopes = [
        np.stack([ac[faces, 1], -ac[faces, 0]], axis=1) / area,
        np.stack([-ab[faces, 1], ab[faces, 0]], axis=1) / area,
    ]
    starts = [(slope * (low + 0.5 - first)).sum(axis=1) for slope in slopes]
    counts = spans.prod(axis=1)
    triangle = np.repeat(np.arange(len(faces)), counts)
    place = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    y, x = np.divmod(place, spans[triangle, 0])
    weights: list[np.ndarray] = []
    for slope, start in zip(slopes, starts):
        weight = start[triangle] + slope[triangle, 0] * x + slope[triangle, 1] * y
        inside = weight >= 0.0
        triangle, x, y = triangle[inside], x[inside], y[inside]
        weights = [one[inside] for one in (*weights, weight)]
    weights.insert(0, 1.0 - weights[0] - weights[1])
    inside = weights[0] >= 0.0
    triangle = triangle[inside]
    x, y = x[inside] + low[triangle, 0], y[inside] + low[triangle, 1]
    return y * w + x, faces[triangle], np.stack([weight[inside] for weight in weights], axis=1)


INERTIA = "energy/inertia"
PAPER, INK = (255, 255, 255), (40, 40, 40)
PER_ROW = 4
TALL = 1.25  # height of a view over its width
SMOOTHED = 0.6  # [s] over which the camera's path is smoothed
MARGIN = 1.25  # around the garment
WIDEST = 1.3  # inches of a view in the report
AZIMUTH = 25.0  # of the camera, from the front to the body's left [degrees]


@dataclass(frozen=True)
class SceneRollOuts:
    """Roll-outs of one scene: method -> cloth, the body where there is one, and method -> label."""

    scene: str
    series: Mapping[str, Trajectory]
    body: Trajectory | None = None
    labels: Mapping[str, str] = field(default_factory=dict)

    @property
    def longest(self) -> Trajectory:
        """The roll-out with the most frames; its dt is nan where it has one."""
        return max(self.series.values(), key=lambda cloth: cloth.frames)

    def lively_frame(self) -> tuple[int, str]:
        """Choose a frame that all methods have, and say why.

        It is where the first method's inertia is largest, else the middle. The first fifth is left out,
        in which a method may still be settling.
        """
        frames = min(cloth.frames for cloth in self.series.values())
        inertia = next(iter(self.series.values())).frame_fields.get(INERTIA)
        if inertia is None:
            return frames // 2, "the middle"
        first = frames // 5
        lively = np.nan_to_num(inertia[first:frames])
        return first + int(np.argmax(lively)), "where the first one's inertia term is largest"


def camera_path(group: SceneRollOuts, axes: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the camera's target in each frame (T,3) [m], smoothed, and half the height that it sees [m]."""
    frames, dt = group.longest.frames, group.longest.dt
    paths = [cloth.positions @ axes for cloth in group.series.values()]
    low, high = (
        [np.pad(ends, ((0, frames - len(ends)), (0, 0)), mode="edge") for ends in corners]
        for corners in ([x.min(axis=1) for x in paths], [x.max(axis=1) for x in paths])
    )
    lowest, highest = np.min(low, axis=0), np.max(high, axis=0)
    reach = 0 if np.isnan(dt) else int(SMOOTHED / dt / 2.0)
    centres = uniform_filter1d((lowest + highest) / 2.0, 2 * reach + 1, axis=0, mode="nearest")
    right, up, _ = np.maximum(highest - centres, centres - lowest).max(axis=0)
    return centres @ axes.T, MARGIN * float(max(up, TALL * right))


def freeze(
    mesh: Trajectory, frame: int, colour: tuple[float, float, float], lift: float = 0.0
) -> Surface:
    """Return a roll-out at that frame, past its end at its last, as it is painted."""
    return Surface(mesh.positions[min(frame, mesh.frames - 1)], mesh.faces, colour, lift)


def draw_frames(
    group: SceneRollOuts, width: int, azimuth: float, frames: Iterable[int] | None = None
) -> Iterator[np.ndarray]:
    """Yield these frames of the film, or all: views of `width` [pixels] with their names, and the time."""
    width, height = width - width % 2, round(width * TALL / 2) * 2
    centres, half = camera_path(group, camera_axes(-azimuth))
    for frame in range(group.longest.frames) if frames is None else frames:
        body = freeze(group.body, frame, BODY_COLOUR) if group.body else None
        cloths = [freeze(cloth, frame, CLOTH_COLOUR, LIFT) for cloth in group.series.values()]
        camera = Camera(centres[frame], 2.0 * half, -azimuth)
        pictures = (255.0 * np.array(views(body, cloths, camera, width, height))).astype(np.uint8)
        yield _compose(group, pictures, frame, float(group.longest.times[frame]))


def _compose(group: SceneRollOuts, pictures: np.ndarray, frame: int, time: float) -> np.ndarray:
    """Compose pictures (N,H,W,3) in rows, each under its method's name, with the time [s] below them."""
    from matplotlib import get_data_path
    from PIL import Image, ImageDraw, ImageFont

    count, height, width, _ = pictures.shape
    letter = max(12, width // 15)
    font = ImageFont.truetype(f"{get_data_path()}/fonts/ttf/DejaVuSans.ttf", letter)
    rows = -(-count // PER_ROW)
    columns = -(-count // rows)
    room = 2 * letter
    image = Image.new("RGB", (columns * width, rows * (height + room) + room), PAPER)
    draw = ImageDraw.Draw(image)
    for place, (method, cloth) in enumerate(group.series.items()):
        x, y = place % columns * width, place // columns * (height + room)
        image.paste(Image.fromarray(pictures[place]), (x, y + room))
        texts = {y + room / 2: group.labels[method]}
        if frame >= cloth.frames:
            texts[y + room + height - letter] = f"ended at {cloth.times[-1]:.2f} s: {cloth.status}"
        for line, text in texts.items():
            while draw.textlength(text, font) > 0.96 * width and len(text) > 1:
                text = text.rstrip("…")[:-1] + "…"
            draw.text((x + width / 2, line), text, INK, font, anchor="mm")
    draw.text((image.width / 2, image.height - room / 2), f"{time:.2f} s", INK, font, anchor="mm")
    return np.asarray(image)


def draw_methods(run: Run) -> Drawing | None:
    """Draw the methods of page one at one frame of the first whole motion that kept their roll-outs.

    Those that ended early are left out.
    """
    rows = run.garment_rows
    for scene in [scene for scenes in run.garments(rows).values() for scene in scenes]:
        if group := _gather(run, scene):
            return _draw_still(group, *group.lively_frame())
    return None


def worst_frame(run: Run) -> Drawing | None:
    """Draw the methods of page one in the frame, of all motions, in which its network is worst.

    It has most energy above the reference there.
    """
    rows = run.garment_rows
    network = next((name for name in leads(run, rows) if run.methods[name].role in LEARNED), "")
    frames = shown_frames(run, rows[rows["metric"] == TOTAL])
    if "total" not in frames:
        return None
    totals = frames.pivot_table("total", ["scene", "seconds"], "method", "first")
    if not {network, run.reference} <= set(totals):
        return None
    above = (totals[network] - totals[run.reference]).dropna()
    if above.empty:
        return None
    scene, seconds = above.idxmax()
    if not (group := _gather(run, scene)):
        return None
    frame = int(np.argmin(np.abs(group.longest.times - seconds)))
    reason = f"where {run.label(network)} has most energy above the reference"
    return _draw_still(group, frame, f"{reason}, {above.max():.2g} J", "worst_frame")


def _gather(run: Run, scene: str) -> SceneRollOuts | None:
    """Return page one's methods that came to the scene's end; None without any."""
    rows = run.garment_rows
    rows = rows[(rows["metric"] == TOTAL) & (rows["scene"] == scene)]
    seeds = pick_seeds(rows).get(scene, {})
    cloths = {name: run.roll_outs.cloth(scene, name, int(seeds[name])) for name in leads(run, rows)}
    frames = max((cloth.frames for cloth in cloths.values() if cloth), default=0)
    series = {name: cloth for name, cloth in cloths.items() if cloth and cloth.frames == frames}
    labels = {name: run.label(name) for name in series}
    return SceneRollOuts(scene, series, run.roll_outs.body(scene), labels) if series else None


def _draw_still(group: SceneRollOuts, frame: int, reason: str, name: str = "") -> Drawing:
    width = PAGE_WIDTH / min(len(group.series), PER_ROW) * DOTS
    (image,) = draw_frames(group, round(min(width, WIDEST * DOTS)), AZIMUTH, [frame])
    high, wide = image.shape[:2]
    figure = new_figure(wide / DOTS, high / DOTS)
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.imshow(image, interpolation="none")
    axes.set_axis_off()
    caption = f"{name_scene(group.scene)}: frame {frame}, {reason}."
    return Drawing(figure, name or f"frames_{file_name(group.scene)}", caption, vector=False)
