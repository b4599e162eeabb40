# SPDX-License-Identifier: GPL-3.0-or-later
"""Render presets that every project has, and how seconds of a fall become frames of a film."""

from dataclasses import dataclass
from fractions import Fraction
from math import ceil

from ..errors import InputError
from ..exchange.project import Project, RenderPreset

PREVIEW = RenderPreset("preview", width=640, height=360, fps=25.0, stagger_s=0.25)
HD_720 = RenderPreset("720p", width=1280, height=720, fps=25.0, stagger_s=0.25)
HD = RenderPreset("hd", width=1920, height=1080, fps=25.0, stagger_s=0.25)
UHD = RenderPreset("4k", width=3840, height=2160, fps=25.0, stagger_s=0.25)
BUILT_IN = (PREVIEW, HD_720, HD, UHD)

AFTERGLOW_S = 1.0
"""How long the film stays on the finished picture."""

LARGEST_REMAP = 900
"""Blender's time stretching knows whole numbers up to this."""

LARGEST_RATE = 32767
SAME_RATE = 1e-9
HALVINGS = 4
"""Blender's writer of films keeps so many decimals of the number that the rate is divided by: 500.5, 250.25, …"""


def find_preset(project: Project, name: str) -> RenderPreset:
    """A preset by its name; one of the project wins over a built-in one.

    Raises
    ------
    InputError : there is no such preset; the message lists those that there are.
    """
    known = {preset.name: preset for preset in (*BUILT_IN, *project.render)}
    if name not in known:
        raise InputError(f"There is no render preset {name!r}", advice=f"Known presets: {', '.join(known)}")
    return known[name]


@dataclass(frozen=True)
class FilmTiming:
    """How the seconds of a fall become frames; frame 0 is second 0.

    Attributes
    ----------
    fps : frames per second of the film.
    time_scale : seconds of the fall in one second of film.
    """

    fps: float
    time_scale: float = 1.0

    @property
    def base(self) -> tuple[int, float]:
        """Blender's two numbers for the frame rate, see `blender_rate`."""
        return blender_rate(self.fps)

    @property
    def remap(self) -> tuple[int, int]:
        """Blender's "old" and "new" lengths, whose ratio is the time scale."""
        scale = Fraction(self.time_scale).limit_denominator(LARGEST_REMAP)
        if scale > 1:  # keep the numerator in range as well
            scale = 1 / Fraction(1 / self.time_scale).limit_denominator(LARGEST_REMAP)
        return max(1, min(scale.numerator, LARGEST_REMAP)), max(1, scale.denominator)

    @property
    def frame_s(self) -> float:
        """Seconds of the fall from one frame to the next."""
        (old, new), (whole, base) = self.remap, self.base
        return old / new * base / whole

    def last_frame(self, duration_s: float) -> int:
        """The film's last frame: the fall, and a moment to look at the finished picture."""
        return max(1, ceil(duration_s / self.frame_s - 1e-6) + round(AFTERGLOW_S * self.fps))


def blender_rate(rate: float) -> tuple[int, float]:
    """Blender's two numbers for a frame rate: a whole one, and what it is divided by, as in 30000 / 1001.

    The second one is whole, or has halves, quarters … where the first would be too large: 60000 / 1001 is
    30000 / 500.5, exact also in single precision, as Blender keeps it. A rate that is no such ratio is met closely.
    """
    rate, pairs = min(rate, LARGEST_RATE), []
    for parts in (2**halvings for halvings in range(HALVINGS + 1)):
        ratio = 1 / Fraction(parts / rate).limit_denominator(LARGEST_RATE)
        pairs.append((ratio.numerator, ratio.denominator / parts))
    error = [abs(whole / base / rate - 1) for whole, base in pairs]
    return next(
        (pair for pair, off in zip(pairs, error, strict=True) if off < SAME_RATE), pairs[error.index(min(error))]
    )


def parse_frames(text: str) -> tuple[int, int]:
    """ "A-B" or "A": the first and the last frame to render, both included.

    Raises
    ------
    ValueError : this is no range.
    """
    first, dash, last = text.partition("-")
    start, end = int(first), int(last if dash else first)
    if not 0 <= start <= end:
        raise ValueError(text)
    return start, end
