# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled kernels for the patch of surface inside a sphere: flooding over faces, and exact integrals over them.

A triangle meets a sphere in the part of it that lies in a disc of its plane. Area, first and second moments of that
part follow from its boundary (Green's theorem): pieces of edges inside the disc, arcs of the circle between them.
"""

import numpy as np

from ..compiled import kernel

SUMS = 14
"""Sums over a patch: area 0, first moments 1-3, second moments xx yy zz xy yz zx 4-9, area times normal 10-12, area
times squared angle between normal and axis 13; coordinates from the centre of the sphere."""
BENT = 6
"""Coefficients of a paraboloid: 1, x, y, xx, xy, yy."""
TERMS = BENT + 1
"""Of the products that are summed over the corners of a patch's faces: the paraboloid's, and the height; lengths in
radii."""


@kernel
def add_triangle(plane, ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Add the signed moments (1, x, y, xx, yy, xy) of the triangle origin, a, b."""
    c = ax * by - ay * bx
    plane[0] += c / 2.0
    plane[1] += c * (ax + bx) / 6.0
    plane[2] += c * (ay + by) / 6.0
    plane[3] += c * (ax * ax + ax * bx + bx * bx) / 12.0
    plane[4] += c * (ay * ay + ay * by + by * by) / 12.0
    plane[5] += c * (2.0 * ax * ay + ax * by + bx * ay + 2.0 * bx * by) / 24.0


@kernel
def add_sector(plane, ax, ay, bx, by, radius):  # type: ignore[no-untyped-def]
    """Add the signed moments of the sector of the circle between the directions of a and b, less than half a turn."""
    la, lb = np.hypot(ax, ay), np.hypot(bx, by)
    ca, sa, cb, sb = ax / la, ay / la, bx / lb, by / lb
    angle = np.arctan2(ca * sb - sa * cb, ca * cb + sa * sb)
    r2 = radius * radius
    r3, r4 = r2 * radius / 3.0, r2 * r2 / 8.0
    plane[0] += r2 * angle / 2.0
    plane[1] += r3 * (sb - sa)
    plane[2] += r3 * (ca - cb)
    plane[3] += r4 * (angle + sb * cb - sa * ca)
    plane[4] += r4 * (angle - sb * cb + sa * ca)
    plane[5] += r4 * (sb * sb - sa * sa)


@kernel
def add_edge(plane, ax, ay, bx, by, radius):  # type: ignore[no-untyped-def]
    """Add what the edge from a to b bounds together with the origin, inside the circle."""
    dx, dy = bx - ax, by - ay
    dd, ad = dx * dx + dy * dy, ax * dx + ay * dy
    outside = ax * ax + ay * ay - radius * radius
    root2 = ad * ad - dd * outside
    if outside <= 0.0 and bx * bx + by * by <= radius * radius:
        add_triangle(plane, ax, ay, bx, by)
        return
    if root2 <= 0.0:
        add_sector(plane, ax, ay, bx, by, radius)
        return
    root = np.sqrt(root2)
    enter, leave = (-ad - root) / dd, (-ad + root) / dd
    if leave <= 0.0 or enter >= 1.0:
        add_sector(plane, ax, ay, bx, by, radius)
        return
    px, py, qx, qy = ax, ay, bx, by
    if enter > 0.0:
        px, py = ax + enter * dx, ay + enter * dy
        add_sector(plane, ax, ay, px, py, radius)
    if leave < 1.0:
        qx, qy = ax + leave * dx, ay + leave * dy
        add_sector(plane, qx, qy, bx, by, radius)
    add_triangle(plane, px, py, qx, qy)


@kernel
def add_face(sums, plane, p, normal, axis, radius):  # type: ignore[no-untyped-def]
    """Add the part of a triangle p (3, 3), relative to the sphere's centre, that is inside the sphere."""
    height = p[0, 0] * normal[0] + p[0, 1] * normal[1] + p[0, 2] * normal[2]
    disc2 = radius * radius - height * height
    if disc2 <= 0.0:
        return
    ux, uy, uz = p[1, 0] - p[0, 0], p[1, 1] - p[0, 1], p[1, 2] - p[0, 2]
    length = np.sqrt(ux * ux + uy * uy + uz * uz)
    ux, uy, uz = ux / length, uy / length, uz / length
    vx, vy, vz = normal[1] * uz - normal[2] * uy, normal[2] * ux - normal[0] * uz, normal[0] * uy - normal[1] * ux
    disc = np.sqrt(disc2)
    plane[:] = 0.0
    for i in range(3):
        j = (i + 1) % 3
        add_edge(
            plane,
            p[i, 0] * ux + p[i, 1] * uy + p[i, 2] * uz,
            p[i, 0] * vx + p[i, 1] * vy + p[i, 2] * vz,
            p[j, 0] * ux + p[j, 1] * uy + p[j, 2] * uz,
            p[j, 0] * vx + p[j, 1] * vy + p[j, 2] * vz,
            disc,
        )
    area = plane[0]
    if not area > 0.0:
        return
    qx, qy, qz = height * normal[0], height * normal[1], height * normal[2]
    sx, sy, sz = plane[1] * ux + plane[2] * vx, plane[1] * uy + plane[2] * vy, plane[1] * uz + plane[2] * vz
    mu, mv, muv = plane[3], plane[4], plane[5]
    sums[0] += area
    sums[1] += area * qx + sx
    sums[2] += area * qy + sy
    sums[3] += area * qz + sz
    sums[4] += area * qx * qx + 2.0 * qx * sx + mu * ux * ux + mv * vx * vx + 2.0 * muv * ux * vx
    sums[5] += area * qy * qy + 2.0 * qy * sy + mu * uy * uy + mv * vy * vy + 2.0 * muv * uy * vy
    sums[6] += area * qz * qz + 2.0 * qz * sz + mu * uz * uz + mv * vz * vz + 2.0 * muv * uz * vz
    sums[7] += area * qx * qy + qx * sy + sx * qy + mu * ux * uy + mv * vx * vy + muv * (ux * vy + vx * uy)
    sums[8] += area * qy * qz + qy * sz + sy * qz + mu * uy * uz + mv * vy * vz + muv * (uy * vz + vy * uz)
    sums[9] += area * qz * qx + qz * sx + sz * qx + mu * uz * ux + mv * vz * vx + muv * (uz * vx + vz * ux)
    cosine, cross2 = 0.0, 0.0
    for a in range(3):
        sums[10 + a] += area * normal[a]
        cosine += normal[a] * axis[a]
        b, c = (a + 1) % 3, (a + 2) % 3
        cross2 += (normal[b] * axis[c] - normal[c] * axis[b]) ** 2
    sums[13] += area * np.arctan2(np.sqrt(cross2), cosine) ** 2


@kernel
def add_corners(products, terms, p, axis, first, second, radius):  # type: ignore[no-untyped-def]
    """Add the corners of a triangle p (3, 3) that are inside the sphere to the products (7, 7) of their terms (7,)."""
    for i in range(3):
        x = (p[i, 0] * first[0] + p[i, 1] * first[1] + p[i, 2] * first[2]) / radius
        y = (p[i, 0] * second[0] + p[i, 1] * second[1] + p[i, 2] * second[2]) / radius
        z = (p[i, 0] * axis[0] + p[i, 1] * axis[1] + p[i, 2] * axis[2]) / radius
        if x * x + y * y + z * z >= 1.0:
            continue
        terms[0], terms[1], terms[2], terms[3], terms[4], terms[5], terms[6] = 1.0, x, y, x * x, x * y, y * y, z
        for j in range(7):
            for k in range(j + 1):
                products[j, k] += terms[j] * terms[k]


@kernel
def segment_distance2(p, i, j):  # type: ignore[no-untyped-def]
    """Squared distance from the origin to the segment p[i], p[j]."""
    dx, dy, dz = p[j, 0] - p[i, 0], p[j, 1] - p[i, 1], p[j, 2] - p[i, 2]
    along = -(p[i, 0] * dx + p[i, 1] * dy + p[i, 2] * dz) / (dx * dx + dy * dy + dz * dz)
    along = min(max(along, 0.0), 1.0)
    return (p[i, 0] + along * dx) ** 2 + (p[i, 1] + along * dy) ** 2 + (p[i, 2] + along * dz) ** 2


@kernel
def integrate_patches(  # type: ignore[no-untyped-def]
    vertices,
    faces,
    normals,
    neighbours,
    centres,
    seeds,
    facing,
    least_cosine,
    axes,
    radius,
    across,
    stamp,
    sums,
    products,
    start,
    stop,
):
    """Sums over the patch of surface around each centre: from its seed face over edges within the sphere.

    A face belongs to the patch when the cosine between its normal and ``facing`` exceeds ``least_cosine``; the seed
    always does.
    ``stamp`` (m,) int32 zeros is private to the call. ``products`` (n, 7, 7), of which the lower triangle is filled, or
    (0, 7, 7) where they are not wanted; ``across`` (n, 2, 3) is at right angles to ``axes``.
    """
    queue = np.empty(64, np.int32)
    p, plane, terms = np.empty((3, 3)), np.empty(6), np.empty(7)
    for row in range(start, stop):
        sums[row] = 0.0
        if seeds[row] < 0:
            continue
        mark = row - start + 1
        queue[0], head, tail = seeds[row], 0, 1
        stamp[seeds[row]] = mark
        while head < tail:
            f = queue[head]
            head += 1
            for i in range(3):
                for a in range(3):
                    p[i, a] = vertices[faces[f, i], a] - centres[row, a]
            add_face(sums[row], plane, p, normals[f], axes[row], radius)
            if len(products) > 0:
                add_corners(products[row], terms, p, axes[row], across[row, 0], across[row, 1], radius)
            for e in range(3):
                g = neighbours[f, e]
                if g < 0 or stamp[g] == mark:
                    continue
                cosine = 0.0
                for a in range(3):
                    cosine += normals[g, a] * facing[row, a]
                if cosine <= least_cosine or segment_distance2(p, e, (e + 1) % 3) >= radius * radius:
                    continue
                stamp[g] = mark
                if tail == len(queue):
                    longer = np.empty(2 * tail, np.int32)
                    longer[:tail] = queue
                    queue = longer
                queue[tail] = g
                tail += 1
