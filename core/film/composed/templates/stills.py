# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures for reports: the block at successive times in one picture, and its impacts side by side."""

import numpy as np
from numpy.typing import NDArray

from ....camera.model import project
from ....errors import InputError
from ....opencv import opencv
from ....vectors import Array
from ..blocks import block_pixels
from ..canvas import Box, Canvas, Picture, fitting_size
from ..falls import Fall
from ..filmed import Footage, warped
from ..ground import ground_picture
from ..look import PAPER, QUIET, STRONG
from ..material import Material
from ..scenery import draw_heading, draw_impacts, draw_keys, draw_paths, keys_of
from ..sight import Window, centred, whole
from ..stage import Stage
from .cards import restitution_of, speeds_of

STEPS_S = (0.02, 0.04, 0.05, 0.1, 0.2, 0.25, 0.5, 1.0)
MOST_BLOCKS, APART = 60, 1.6
"""In a stroboscopic picture: how many, and the least distance between them, in diameters."""
BACKGROUND_FRAMES = 21
AROUND = 0.12
"""Part of a stroboscopic picture that stays free at each side of the block's way."""
LEAST_SCALE, MOST_SCALE = 0.5, 3.0
ROUND = 1.7
"""How much of the frame about the block is taken, in its radii."""
SKY_M = 1e5
COARSE, FAR_PX = 4, -1e4
MOST_CELLS, LEAST_CELL_PX, LEAST_SMALL = 12, 16, 8
CELL_PX_OF_BLOCK = 7.0
"""Width of a picture of the contact sheet, in diameters of the block, at least."""


def stroboscopic(material: Material) -> Canvas:
    """The block at successive times, in one picture of what stood still; also of a camera that was held by hand.

    Notes
    -----
    All frames are brought into the view of the middle one through the terrain: a pixel is a place on it, and each
    frame is asked what it saw there.
    """
    footage, fall, words = material.filmed, material.falls[0], material.words
    begin, end = max(float(fall.time_s[0]), footage.span_s[0]), min(float(fall.time_s[-1]), footage.span_s[1])
    if not begin < end:
        raise InputError(
            f"The video {footage.name!r} does not show {fall.name}", advice="Name another one with --video"
        )
    middle = footage.frame((begin + end) / 2)
    mosaic = Mosaic(material, footage, _about(material, footage, fall, (begin, end), middle), middle)
    first, last = footage.frame(begin), footage.frame(end)
    frames = np.unique(np.linspace(first, last, min(BACKGROUND_FRAMES, last - first + 1)).astype(np.intp))
    picture = median_picture(np.array([mosaic.frame(int(frame)) for frame in frames]))
    if mosaic.beyond is not None:
        unknown = ~picture.any(axis=2)
        picture[unknown] = mosaic.beyond[unknown]
    step = _step(material, mosaic, fall, begin, end)
    for moment in np.arange(begin, end, step):
        frame = footage.frame(float(moment))
        state = fall.state(footage.moment(frame))
        if state is None:
            continue
        centre, radius = block_pixels(mosaic.camera, state[0], fall.radius_m)
        if np.isfinite(centre).all():
            _paste(picture, mosaic.frame(frame), centre, max(ROUND * radius, 3.0))
    canvas = Canvas(picture)
    scene = material.scene(material.falls)
    look = canvas.look
    draw_impacts(canvas, mosaic.camera, scene, np.inf)
    draw_heading(canvas, material.title, words.say("stroboscopic", step=words.number(step, 2)))
    draw_keys(canvas, keys_of(scene, words), look.margin, look.height - look.margin)
    Stage(material, scene, solids=False).draw_size(canvas, mosaic.camera)
    return canvas


def median_picture(shown: np.ndarray) -> Picture:
    """The median of pictures (k, h, w, 3), where a black pixel knows nothing."""
    known: NDArray[np.bool_] = np.asarray(shown.any(axis=3))
    picture: Picture = np.partition(shown, len(shown) // 2, axis=0)[len(shown) // 2]
    some = ~known.all(axis=0)
    if some.any():
        each = np.where(known[:, some][:, :, None], shown[:, some].astype(np.float32), np.nan)
        there = known[:, some].any(axis=0)
        values = np.zeros((each.shape[1], 3), np.uint8)
        values[there] = np.nanmedian(each[:, there], axis=0)
        picture[some] = values
    return picture


def _about(material: Material, footage: Footage, fall: Fall, span_s: tuple[float, float], middle: int) -> Window:
    """The window of the middle frame that shows all of the block's way, also what lies beyond that frame."""
    camera = footage.camera(footage.moment(middle))
    rows = (fall.time_s >= span_s[0]) & (fall.time_s <= span_s[1])
    where = project(camera, fall.position[rows])
    where = where[np.isfinite(where).all(axis=1)]
    size = np.array(material.size, dtype=np.float64)
    if not len(where):
        return whole(footage.size, material.size)
    low, high = where.min(axis=0), where.max(axis=0)
    scale = float(min((1 - 2 * AROUND) * size / np.maximum(high - low, 1.0)))
    fits = min(size[i] / footage.size[i] for i in range(2))
    scale = float(np.clip(scale, LEAST_SCALE * fits, MOST_SCALE * max(fits, 1.0)))
    corner = size / 2 - scale * (low + high) / 2
    return Window(scale, float(corner[0]), float(corner[1]), *material.size)


def contact_sheet(material: Material) -> Canvas:
    """Each impact as the video shows it, with its numbers."""
    footage, words = material.filmed, material.words
    rows = [(fall, row) for fall in material.falls if fall.hits is not None for row in range(len(fall.hits.time_s))]
    begin, end = footage.span_s
    rows = [(fall, row) for fall, row in rows if fall.hits is not None and begin <= fall.hits.time_s[row] <= end]
    if not rows:
        raise InputError("No impact happens while the video lasts", file=material.request.project,
                         advice="Pick impacts, or name another video with --video")  # fmt: skip
    if len(rows) > MOST_CELLS:
        material.remarks.append(f"The contact sheet shows the first {MOST_CELLS} of {len(rows)} impacts.")
    rows = rows[:MOST_CELLS]
    width, height = material.size
    sheet = Canvas(np.full((height, width, 3), 24, np.uint8))
    look = sheet.look
    top = look.margin + round(2.9 * look.heading)
    sheet.text(material.title, look.margin, look.margin + look.heading, look.heading, PAPER, weight=STRONG)
    sheet.text(f"{words.say('contact_sheet')}: {words.say('measured')}. {material.block_words()}", look.margin,
               look.margin + look.heading + 1.5 * look.body, look.body, QUIET)  # fmt: skip
    columns, lines = _grid(len(rows), width / max(height - top, 1))
    gap = 2 * look.gap
    caption = round(3 * 1.4 * look.small + look.gap)
    cell = (
        (width - 2 * look.margin - (columns - 1) * gap) // columns,
        (height - top - look.margin - (lines - 1) * gap) // lines,
    )
    if min(cell[0], cell[1] - caption) < LEAST_CELL_PX:
        raise InputError(
            f"A picture of {width} × {height} pixels is too small for {len(rows)} impacts",
            advice="Give --preset a larger one",
        )
    for i, (fall, row) in enumerate(rows):
        left, upper = look.margin + (i % columns) * (cell[0] + gap), top + (i // columns) * (cell[1] + gap)
        _cell(material, sheet, fall, row, Box(left, upper, left + cell[0], upper + cell[1]), caption)
    return sheet


def _cell(material: Material, sheet: Canvas, fall: Fall, row: int, box: Box, caption: int) -> None:
    footage, words, hits = material.filmed, material.words, fall.hits
    assert hits is not None
    size = round(box.width), round(box.height) - caption
    frame = footage.frame(float(hits.time_s[row]))
    moment = footage.moment(frame)
    camera = footage.camera(moment)
    centre, radius = block_pixels(camera, hits.position[row], fall.radius_m)
    if not np.isfinite(centre).all():
        return
    fits = max(size[i] / footage.size[i] for i in range(2))
    scale = max(fits, min(size[0] / (2 * radius * 2 * CELL_PX_OF_BLOCK), 3.0))
    window = centred(footage.size, size, scale, centre)
    canvas = Canvas(warped(footage.picture(frame), window.matrix, size))
    scene = material.scene((fall,))
    draw_paths(canvas, window.camera(camera), scene, np.inf)
    draw_impacts(canvas, window.camera(camera), scene, np.inf)
    sheet.paste(canvas, round(box.left), round(box.top))
    look = sheet.look
    y = box.top + size[1] + 1.2 * look.small
    name = words.say("impact", number=int(hits.number[row]))
    sheet.text(name, box.left, y, look.small, PAPER, weight=STRONG)
    energy = float(hits.energy1_j[row])
    lines = [
        speeds_of(hits, row, words),
        restitution_of(hits, row, words),
    ]
    if np.isfinite(energy):
        said = words.about_energy(energy, float(hits.energy1_sigma_j[row]))
        sheet.text(said, box.right, y, look.small, PAPER, anchor="right")
    for i, line in enumerate(filter(None, lines)):
        small = fitting_size(line, look.small, box.width, LEAST_SMALL)
        sheet.text(line, box.left, y + (i + 1) * 1.4 * look.small, small, QUIET)


class Mosaic:
    """Frames of a video in the view of one of them.

    Attributes
    ----------
    camera : of that view.
    beyond : the terrain in that view, for what no frame shows; None where each shows all.
    """

    def __init__(self, material: Material, footage: Footage, window: Window, reference: int) -> None:
        self.footage, self.window = footage, window
        moment = footage.moment(reference)
        self.camera = window.camera(footage.camera(moment))
        self.places: Array | None = None
        self.beyond: Picture | None = None
        if not footage.path.is_fixed:
            from ....camera.model import rays

            self.beyond, distance = ground_picture(material.ground, self.camera)
            # Cameras that are held by hand hardly change their place: what is between the samples is smooth.
            v, u = np.mgrid[0 : window.height : COARSE, 0 : window.width : COARSE]
            origin, direction = rays(self.camera, np.column_stack([u.ravel(), v.ravel()]) + 0.5)
            far = distance[v.ravel(), u.ravel()]
            self.places = origin + np.where(np.isfinite(far), far, SKY_M)[:, None] * direction
            self.shape = u.shape
            width, height = np.arange(window.width), np.arange(window.height)
            self.lookup = np.meshgrid((width / COARSE).astype(np.float32), (height / COARSE).astype(np.float32))

    def frame(self, frame: int) -> Picture:
        """A frame in that view; black where it saw nothing."""
        window, picture = self.window, self.footage.picture(frame)
        size = window.width, window.height
        if self.places is None:
            return warped(picture, window.matrix, size)
        cv2 = opencv()
        where = project(self.footage.camera(self.footage.moment(frame)), self.places).reshape(*self.shape, 2)
        coarse = np.nan_to_num(where - 0.5, nan=FAR_PX).astype(np.float32)
        grid = cv2.remap(coarse, *self.lookup, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        made: Picture = cv2.remap(picture, grid, None, cv2.INTER_LINEAR)
        inside = (grid > 0).all(axis=2) & (grid < np.array(self.footage.size) - 2.0).all(axis=2)
        made[~inside] = 0
        return made


def _step(material: Material, mosaic: Mosaic, fall: Fall, begin: float, end: float) -> float:
    """The shortest round step at which the blocks of a stroboscopic picture mostly stand apart."""
    for step in STEPS_S:
        if (end - begin) / step > MOST_BLOCKS:
            continue
        states = [fall.state(float(t)) for t in np.arange(begin, end, step)]
        places = [block_pixels(mosaic.camera, state[0], fall.radius_m) for state in states if state is not None]
        if len(places) < 2:
            continue
        centres, radii = np.array([c for c, _ in places]), np.array([r for _, r in places])
        apart = np.hypot(*np.diff(centres, axis=0).T) / (2 * radii[1:])
        seen = apart[np.isfinite(apart)]
        if seen.size and np.median(seen) > APART:
            return step
    return STEPS_S[-1]


def _paste(picture: Picture, frame: Picture, centre: Array, radius: float) -> None:
    """The surroundings of a block from its frame, with a soft edge."""
    height, width = picture.shape[:2]
    low = np.clip(np.floor(centre - radius), 0, (width, height)).astype(int)
    high = np.clip(np.ceil(centre + radius), 0, (width, height)).astype(int)
    if (high <= low).any():
        return
    x, y = np.arange(low[0], high[0]) + 0.5 - centre[0], np.arange(low[1], high[1]) + 0.5 - centre[1]
    away = np.hypot(x[None], y[:, None]) / radius
    share = np.clip((1 - away) / 0.25, 0, 1)[:, :, None]
    part, new = picture[low[1] : high[1], low[0] : high[0]], frame[low[1] : high[1], low[0] : high[0]]
    share = share * new.any(axis=2, keepdims=True)
    part[...] = (part + share * (new.astype(np.float32) - part) + 0.5).astype(np.uint8)


def _grid(count: int, aspect: float) -> tuple[int, int]:
    """Columns and lines for so many pictures of 4:3."""
    columns = max(1, min(count, round(np.sqrt(count * aspect * 3 / 4))))
    return columns, -(-count // columns)
