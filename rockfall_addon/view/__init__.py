# SPDX-License-Identifier: GPL-3.0-or-later
"""Between the screen, the pixels of a video and the world; what all steps draw, ask and report with."""

from . import arranging, job, loupe, parameters, strip

PARTS = (job, loupe, parameters, arranging, strip)
