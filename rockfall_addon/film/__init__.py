# SPDX-License-Identifier: GPL-3.0-or-later
"""Films and pictures of a scene: camera, captions and growing trails, rendered with whatever engine the machine has."""
