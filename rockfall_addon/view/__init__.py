# SPDX-License-Identifier: GPL-3.0-or-later
"""Between the screen, the pixels of a video and the world; what all steps draw, ask and report with."""

from . import arranging, job, loupe, parameters, strip, trail_lines

PARTS = (job, loupe, parameters, arranging, strip, trail_lines)
