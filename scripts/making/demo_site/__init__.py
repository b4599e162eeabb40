# SPDX-License-Identifier: GPL-3.0-or-later
"""How the synthetic demo site is made: the terrain, the falling blocks, the campaign that observes them."""
