# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines and points in a region or a view, with a colour for each end."""

import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader


def segments(places: np.ndarray, colours: np.ndarray, width: float) -> None:
    """Lines (k, 2, 2 or 3) with colours (k, 2, 4)."""
    if not len(places):
        return
    points = np.zeros((2 * len(places), 3), dtype=np.float32)
    points[:, : places.shape[2]] = places.reshape(-1, places.shape[2])
    shader = gpu.shader.from_builtin("POLYLINE_SMOOTH_COLOR")
    values = {"pos": points, "color": np.ascontiguousarray(colours, dtype=np.float32).reshape(-1, 4)}
    batch = batch_for_shader(shader, "LINES", values)
    shader.uniform_float("lineWidth", width)
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    batch.draw(shader)


def dots(places: np.ndarray, colours: np.ndarray, size: float) -> None:
    """Points (n, 2) with colours (n, 4)."""
    if not len(places):
        return
    shader = gpu.shader.from_builtin("POINT_FLAT_COLOR")
    points = np.zeros((len(places), 3), dtype=np.float32)
    points[:, :2] = places
    gpu.state.point_size_set(size)
    values = {"pos": points, "color": np.ascontiguousarray(colours, dtype=np.float32)}
    batch_for_shader(shader, "POINTS", values).draw(shader)
    gpu.state.point_size_set(1.0)
