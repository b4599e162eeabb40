# SPDX-License-Identifier: GPL-3.0-or-later
"""Bytes of file formats, read and written; nothing here knows what a rockfall is."""
