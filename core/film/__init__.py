# SPDX-License-Identifier: GPL-3.0-or-later
"""Films and pictures, as far as they are numbers and words: the drawing is `rockfall_addon/steps/film`."""
