# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors as three floats, for functions that are plain Python and compile as they stand."""

from math import cos, sin, sqrt

Vector = tuple[float, float, float]
Motion = tuple[Vector, Vector]
"""A velocity [m/s] and an angular velocity [rad/s]."""


def dot(a: Vector, b: Vector) -> float:
    """a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """a × b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def add(a: Vector, b: Vector) -> Vector:
    """a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def scaled(a: Vector, factor: float) -> Vector:
    """factor · a."""
    return (factor * a[0], factor * a[1], factor * a[2])


def length(a: Vector) -> float:
    """|a|."""
    return sqrt(dot(a, a))


def turned(a: Vector, axis: Vector, angle: float) -> Vector:
    """`a` turned about the unit vector `axis` by `angle` [rad], right-handed (Rodrigues)."""
    c, s = cos(angle), sin(angle)
    along = (1.0 - c) * dot(axis, a)
    return add(add(scaled(a, c), scaled(cross(axis, a), s)), scaled(axis, along))
