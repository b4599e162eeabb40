# SPDX-License-Identifier: GPL-3.0-or-later
"""The look of composed films: one set of sizes and colours, measured from the shorter side of the picture.

Text is at least a thirty-third of the shorter side high: 2 mm on a phone that is 65 mm wide.
"""

from dataclasses import dataclass

from ...colours import MEASURED_COLOUR

type Colour = tuple[float, float, float]
"""sRGB, 0…1."""

INK: Colour = (0.07, 0.08, 0.09)
PAPER: Colour = (0.98, 0.98, 0.98)
QUIET: Colour = (0.78, 0.80, 0.82)
MEASURED: Colour = MEASURED_COLOUR
BELOW_GROUND: Colour = (0.90, 0.10, 0.10)
"""The only red."""
REGULAR, STRONG = 400, 600
"""Weights of the type, which is Rubik, as OpenCV brings it."""
PANEL_OPACITY = 0.62


@dataclass(frozen=True)
class Look:
    """Sizes [px] for a picture of a width and a height.

    Attributes
    ----------
    width, height : of the picture [px].
    """

    width: int
    height: int

    def size(self, share: float, least: float = 1.0) -> int:
        """A share of the shorter side, at least so many pixels."""
        return max(round(share * min(self.width, self.height)), round(least))

    @property
    def title(self) -> int:
        """Height of the type of title cards [px]."""
        return self.size(0.075, 18)

    @property
    def heading(self) -> int:
        """Of chapters [px]."""
        return self.size(0.048, 13)

    @property
    def body(self) -> int:
        """Of numbers and sentences [px]."""
        return self.size(0.037, 11)

    @property
    def small(self) -> int:
        """Of notes [px]."""
        return self.size(0.0304, 10)

    @property
    def margin(self) -> int:
        """Between the edge of the picture and what is written [px]."""
        return self.size(0.045, 8)

    @property
    def gap(self) -> int:
        """Between two things that belong together [px]."""
        return self.size(0.016, 3)

    @property
    def line(self) -> int:
        """Width of the path of a measured block [px]."""
        return self.size(0.0042, 1)

    @property
    def thin(self) -> int:
        """Of the path of a simulated one [px]."""
        return self.size(0.0021, 1)

    @property
    def least_mark(self) -> float:
        """Radius of the ring about a block that is smaller [px]."""
        return float(self.size(0.018, 6))
