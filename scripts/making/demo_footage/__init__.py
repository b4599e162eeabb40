# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of ``scripts/making/demo_footage/make.py``."""
