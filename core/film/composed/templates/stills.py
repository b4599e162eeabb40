# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures for reports: the block at successive times in one picture, and its impacts side by side."""

import numpy as np

from ....camera.model import project
from ....errors import InputError
from ....opencv import opencv
from ....vectors import Array
from ..blocks import block_pixels
from ..canvas import Box, Canvas, Picture
from ..falls import Fall
from ..filmed import Footage, warped
from ..ground import ground_picture
from ..look import PAPER, QUIET, STRONG
from ..material import Material
from ..scenery import draw_heading, draw_impacts, draw_keys, draw_paths, keys_of
from ..sight import Window, centred, whole
from ..stage import Stage

STEPS_S = (0.02, 0.04, 0.05, 0.1, 0.2, 0.25, 0.5, 1.0)
MOST_BLOCKS, APART = 60, 1.6
"""In a stroboscopic picture: how many, and the least distance between them, in diameters."""
BACKGROUND_FRAMES = 21
ROUND = 1.7
"""How much of the frame about the block is taken, in its radii."""
SKY_M = 1e5
MOST_CELLS = 12
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
    window = whole(footage.size, material.size)
    begin, end = max(float(fall.time_s[0]), footage.span_s[0]), min(float(fall.time_s[-1]), footage.span_s[1])
    if not begin < end:
        raise InputError(f"The video {footage.name!r} does not show {fall.name}", advice="Name another one with --video")
    middle = footage.frame((begin + end) / 2)
    mosaic = Mosaic(material, footage, window, middle)
    first, last = footage.frame(begin), footage.frame(end)
    frames = np.unique(np.linspace(first, last, min(BACKGROUND_FRAMES, last - first + 1)).astype(np.intp))
    shown = np.array([mosaic.frame(int(frame)) for frame in frames])
    known = shown.any(axis=3, keepdims=True)
    background = np.nanmedian(np.where(known, shown, np.nan).astype(np.float32), axis=0) if not known.all() else np.median(shown, axis=0)
    picture: Picture = np.nan_to_num(background).astype(np.uint8)
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
    Stage(material, scene, solids=False)._draw_scale(canvas, mosaic.camera)
    return canvas


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
    columns, lines = _grid(len(rows), width / (height - top))
    gap = look.gap
    caption = round(2 * 1.4 * look.small + look.gap)
    cell = (width - 2 * look.margin - (columns - 1) * gap) // columns, (height - top - look.margin - (lines - 1) * gap) // lines
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
    before, after = float(hits.speed1_mps[row]), float(hits.speed2_mps[row])
    sheet.text(name, box.left, y, look.small, PAPER, weight=STRONG)
    if np.isfinite([before, after]).all():
        sheet.text(f"{words.number(before, 2)} → {words.number(after, 2)} m/s", box.right, y, look.small, PAPER, anchor="right")
    second = words.energy(float(hits.energy1_j[row])) if np.isfinite(hits.energy1_j[row]) else ""
    restitution = f"R_N {words.number(float(hits.rn[row]), 2)}" if np.isfinite(hits.rn[row]) else ""
    sheet.text(second, box.left, y + 1.4 * look.small, look.small, QUIET)
    sheet.text(restitution, box.right, y + 1.4 * look.small, look.small, QUIET, anchor="right")


class Mosaic:
    """Frames of a video in the view of one of them.

    Attributes
    ----------
    camera : of that view.
    """

    def __init__(self, material: Material, footage: Footage, window: Window, reference: int) -> None:
        self.footage, self.window = footage, window
        moment = footage.moment(reference)
        self.camera = window.camera(footage.camera(moment))
        self.places: Array | None = None
        if not footage.path.is_fixed:
            from ....camera.model import rays

            distance = ground_picture(material.ground, self.camera)[1]
            v, u = np.mgrid[0 : window.height, 0 : window.width] + 0.5
            origin, direction = rays(self.camera, np.column_stack([u.ravel(), v.ravel()]))
            far = np.where(np.isfinite(distance.ravel()), distance.ravel(), SKY_M)
            self.places = origin + far[:, None] * direction

    def frame(self, frame: int) -> Picture:
        """A frame in that view; black where it saw nothing."""
        window, picture = self.window, self.footage.picture(frame)
        size = window.width, window.height
        if self.places is None:
            return warped(picture, window.matrix, size)
        where = project(self.footage.camera(self.footage.moment(frame)), self.places).reshape(size[1], size[0], 2)
        grid = np.nan_to_num(where - 0.5, nan=-1e4).astype(np.float32)
        made: Picture = opencv().remap(picture, grid[:, :, 0], grid[:, :, 1], opencv().INTER_LINEAR)
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
        apart = np.hypot(*np.diff(centres, axis=0).T)
        if np.nanmedian(apart / (2 * radii[1:])) > APART:
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
