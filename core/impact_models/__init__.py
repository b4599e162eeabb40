# SPDX-License-Identifier: GPL-3.0-or-later
"""Impact models: what a block does after an impact, as published. One file each, found by `registry`."""
