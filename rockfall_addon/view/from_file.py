# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators share that read a chosen file."""

from bpy.props import StringProperty
from bpy_extras.io_utils import ImportHelper


class FromFile(ImportHelper):
    """Mix-in: asks for a file each time."""

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
