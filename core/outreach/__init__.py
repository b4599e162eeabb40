# SPDX-License-Identifier: GPL-3.0-or-later
"""What others look at without Rockfall: a web page of a site, and its animation for other programs."""
