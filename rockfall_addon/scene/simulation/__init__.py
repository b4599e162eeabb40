# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulated blocks: where they start, what they meet, what is shown of them, maps, screens and back-analysis."""
