# SPDX-License-Identifier: GPL-3.0-or-later
"""What many runs mean for a place."""
