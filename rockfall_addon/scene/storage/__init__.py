# SPDX-License-Identifier: GPL-3.0-or-later
"""What the .blend stores: all stored keys, fingerprints, undo, copies, earlier versions, what cannot be used."""
