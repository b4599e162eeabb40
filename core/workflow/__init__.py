# SPDX-License-Identifier: GPL-3.0-or-later
"""What Rockfall does, once: dataclasses in and out. Commands and Blender only ask and show."""
