# SPDX-License-Identifier: GPL-3.0-or-later
"""Films that are composed of footage, reconstruction and models, picture by picture."""
