# SPDX-License-Identifier: GPL-3.0-or-later
"""Cards: the title, the end, and the numbers of an impact while the picture stands still."""

import numpy as np

from ....opencv import opencv
from ....vectors import Array
from ..canvas import Box, Canvas, Picture, fitting_size, text_width, wrapped
from ..falls import Fall, Hits
from ..look import INK, PAPER, QUIET, STRONG
from ..material import Material
from ..shots import Shot
from ..sight import pixels
from ..stage import Seen
from ..texts import Texts

DARK = 0.55
TITLE_S, END_S = 2.6, 3.6
LEAST_TITLE = 12


def _dimmed(picture: Picture) -> Canvas:
    """A picture as the ground of a card: blurred and dark."""
    side = min(picture.shape[:2])
    soft = opencv().GaussianBlur(picture, (0, 0), max(side / 60, 1))
    return Canvas((soft * (1 - DARK)).astype(np.uint8))


def title_card(material: Material, behind: Picture, subtitle: str) -> Shot:
    """The site, and what the film is."""
    card = _dimmed(behind)
    look = card.look
    width = look.width - 2 * look.margin
    size = fitting_size(material.title, look.title, width, LEAST_TITLE, STRONG)
    y = 0.46 * look.height
    for line in wrapped(material.title, size, width, STRONG):
        card.text(line, look.margin, y, size, PAPER, weight=STRONG)
        y += 1.2 * size
    card.lines(
        [np.array([[look.margin, y - 0.7 * size], [look.margin + 0.12 * width, y - 0.7 * size]])], PAPER, look.line, 0.9
    )
    y += 0.35 * look.heading
    for text in (subtitle, material.project.site.description):
        for line in wrapped(text, look.body, width)[:4]:
            card.text(line, look.margin, y, look.body, PAPER if text == subtitle else QUIET)
            y += 1.45 * look.body
        y += 0.3 * look.body
    return Shot("title", TITLE_S, lambda _: Canvas.copied(card))


def end_card(material: Material, behind: Picture) -> Shot:
    """Credits, what is measured and what simulated, and by what it was made."""
    card, words = _dimmed(behind), material.words
    look = card.look
    width = look.width - 2 * look.margin
    y = 0.28 * look.height
    card.text(words.say("credits"), look.margin, y, look.heading, PAPER, weight=STRONG)
    y += 1.7 * look.heading
    spins = words.say("spin_known" if any(fall.has_known_spin for fall in material.falls) else "spin_rolling")
    lines = [material.title, *material.credit_lines]
    if material.footage is not None:
        frames = [material.footage.frame(moment) for moment in material.span_s]
        lines.append(words.say("frames_of", video=material.footage.video.path.name, first=frames[0], last=frames[1]))
    lines += [material.block_words(), spins]
    if material.request.dust:
        lines.append(words.say("dust"))
    lines.append(words.say("made_with"))
    for line in lines:
        for part in wrapped(line, look.body, width):
            card.text(part, look.margin, y, look.body, PAPER)
            y += 1.4 * look.body
        y += 0.25 * look.body
    return Shot("end", END_S, lambda _: Canvas.copied(card))


def draw_hit_card(seen: Seen, material: Material, fall: Fall, row: int) -> Box | None:
    """The numbers of an impact beside its place, with a line to it; None where it is not in the picture."""
    canvas, camera = seen
    hits, words, look = fall.hits, material.words, canvas.look
    if hits is None:
        return None
    at = pixels(camera, hits.position[row][None])[0]
    if not np.isfinite(at).all() or not (0 <= at[0] < look.width and 0 <= at[1] < look.height):
        return None
    lines = [words.say("impact", number=int(hits.number[row]))]
    if speeds := speeds_of(hits, row, words):
        lines.append(speeds)
    if np.isfinite([hits.energy1_j[row], hits.energy2_j[row]]).all():
        first = words.about_energy(float(hits.energy1_j[row]), float(hits.energy1_sigma_j[row]))
        second = words.about_energy(float(hits.energy2_j[row]), float(hits.energy2_sigma_j[row]))
        lines.append(f"{first} → {second}")
    if restitution := restitution_of(hits, row, words):
        lines.append(restitution)
    return beside(canvas, at, lines)


def speeds_of(hits: Hits, row: int, words: Texts) -> str:
    """The speeds before and after an impact, with their standard deviations; empty where they are not known."""
    before, after = float(hits.speed1_mps[row]), float(hits.speed2_mps[row])
    if not np.isfinite([before, after]).all():
        return ""
    first = words.about(before, float(hits.speed1_sigma_mps[row]))
    return f"{first} → {words.about(after, float(hits.speed2_sigma_mps[row]))} m/s"


def restitution_of(hits: Hits, row: int, words: Texts) -> str:
    """R_N of an impact with its 95 % interval; empty where it is not known."""
    value, (low, high) = float(hits.rn[row]), hits.rn_ends[row].tolist()
    if not np.isfinite(value):
        return ""
    if not np.isfinite(low):
        return f"R_N ≈ {words.number(value, 2)}"
    ends = f"{words.number(low, 2)}–{words.number(high, 2) if np.isfinite(high) else '∞'}"
    return f"R_N {words.number(value, 2)} ({ends}, 95 %)"


def beside(canvas: Canvas, at: Array, lines: list[str]) -> Box:
    """Lines on a panel beside a place, on the side where there is room, with a line to it."""
    look = canvas.look
    pad, step = look.gap, round(1.38 * look.body)
    width = max(text_width(line, look.body, STRONG if i == 0 else 400) for i, line in enumerate(lines)) + 2.5 * pad
    height, away = len(lines) * step + pad, 2.6 * look.body
    box = _free_box(canvas, at, width, height, away)
    side = box.left if box.left > at[0] else box.right if box.right < at[0] else (box.left + box.right) / 2
    end = np.array([side, np.clip(at[1], box.top + pad, box.bottom - pad)])
    canvas.lines([np.array([at, end])], INK, look.line + 2 * look.thin, 0.5)
    canvas.lines([np.array([at, end])], PAPER, max(look.thin, 1), 0.95)
    canvas.panel(box, opacity=0.78)
    for i, line in enumerate(lines):
        canvas.text(
            line,
            box.left + 1.25 * pad,
            box.top + pad / 2 + (i + 0.74) * step,
            look.body,
            weight=STRONG if i == 0 else 400,
        )
    return box


def _free_box(canvas: Canvas, at: Array, width: float, height: float, away: float) -> Box:
    """A box beside a place, inside the picture and where nothing is written yet, if there is such a place."""
    look = canvas.look
    taken = [one.box.grown(look.gap) for one in canvas.written]
    lefts = (at[0] + away, at[0] - away - width, at[0] - width / 2, look.margin, look.width - look.margin - width)
    tops = (
        at[1] - height - away / 2,
        at[1] + away / 2,
        at[1] - 1.6 * height,
        at[1] - 2.4 * height,
        at[1] - height / 2,
        look.margin,
        at[1] + 2 * away,
    )
    best, least = None, np.inf
    for left in lefts:
        for top in tops:
            x = float(np.clip(left, look.margin, max(look.width - look.margin - width, look.margin)))
            y = float(np.clip(top, look.margin, max(look.height - look.margin - height, look.margin)))
            box = Box(x, y, x + width, y + height)
            covers = box.left < at[0] < box.right and box.top < at[1] < box.bottom
            cost = (
                sum(box.meets(other) for other in taken) + 2 * covers + 0.01 * (abs(x - left) + abs(y - top)) / height
            )
            if cost < least:
                best, least = box, cost
    assert best is not None
    return best
