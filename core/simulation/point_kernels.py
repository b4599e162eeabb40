# SPDX-License-Identifier: GPL-3.0-or-later
"""The first contact of a flying sphere with a terrain of points: compiled kernels, exact on the parabola.

The sphere touches when its centre is one radius from a point. There is no surface between points, so the normal comes
from the block and the points that it touches: those within `BAND` of the radius of the sphere, on the side of the first
of them (`FACING`). That patch is where a block that were pressed in by so much would meet the ground, 0.32 of the
radius wide on a plane. Each point counts by how deep it is in the band; the normal is their mean direction to the
centre, turned by the plane that is fitted to them.

A block rebounds off that normal, not off single points. So a flight can begin, or pass, nearer to a point than the
radius while the block moves away along the normal: that is no contact. Such points stop a block only at `CORE` of the
radius, in their own direction. No flight takes a point deeper than that into a block.
"""

from math import inf, sqrt

from ..compiled import kernel
from ..terrain.kernels import box_distance2
from ..terrain.point_kernels import nearest
from .contact_kernels import RESTING_S, STEPS, TOUCHING_M, enter_node, first_root, last_inside, prepared

BAND, MANY, WIDEST = 0.1, 2.0, 0.3
"""Points within this part of the radius of the sphere make the normal; on a plane those within 0.45 of the radius.
Where points are far apart, the band is so wide that the patch reaches `MANY` spacings, up to `WIDEST`."""
FACING = 0.7
"""Cosine between the directions of a point and of the first one below which it belongs to another face."""
HELD_LEVEL = 0.03
"""Points that spread less than this part of the radius about their middle do not tilt the plane."""
CORE, DEEPEST = 0.025, 0.1
"""No flight takes a point deeper into a block than this part of the radius; where points are far apart, than a sphere
sinks between them on a plane, up to `DEEPEST`."""
FARTHEST_BACK = 0.5
"""A contact is taken back along the flight by this part of the radius at most."""
BOX_STEPS = 3
MOST_PASSED = 1000
"""A flight may brush past so many contacts."""


@kernel
def band_of(radius, spacing):  # type: ignore[no-untyped-def]
    """Thickness of the shell about a sphere whose points make the normal [m]: a cap is √(2 r band) wide on a plane."""
    ratio = MANY * spacing / radius
    return radius * min(max(BAND, 0.5 * ratio * ratio), WIDEST)


@kernel
def core_of(radius, spacing):  # type: ignore[no-untyped-def]
    """How near a point may come to the centre of a sphere that passes it [m]."""
    ratio = spacing / radius
    return radius * (1.0 - min(max(CORE, 0.5 * ratio * ratio), DEEPEST))


@kernel
def touch_point(q, p, v, a, radius, core, start, limit, passed):  # type: ignore[no-untyped-def]
    """First time in start…limit at which the sphere comes as near to a point as it may.

    Parameters
    ----------
    core : distance at which the point stops a sphere that passes it.
    passed : whether the sphere is passing the point when the flight begins.

    Returns
    -------
    time, direction, passed : [s] inf for none, from the point to the centre, whether it is the core that is touched.
    """
    t, shell = start, core if passed else radius
    for _ in range(STEPS):
        x = p[0] + (v[0] + 0.5 * a[0] * t) * t - q[0]
        y = p[1] + (v[1] + 0.5 * a[1] * t) * t - q[1]
        z = p[2] + (v[2] + 0.5 * a[2] * t) * t - q[2]
        d = sqrt(x * x + y * y + z * z)
        if d == 0.0:
            return t, (0.0, 0.0, 1.0), passed
        x, y, z = x / d, y / d, z / d
        speed = (v[0] + a[0] * t) * x + (v[1] + a[1] * t) * y + (v[2] + a[2] * t) * z
        bend = a[0] * x + a[1] * y + a[2] * z
        gap = d - shell
        if passed and speed >= 0.0:
            # Up to the turn of the distance along its direction, the block is not nearer than now.
            if bend >= 0.0:
                return inf, (0.0, 0.0, 0.0), passed
            step = -speed / bend
            if step <= RESTING_S and gap <= TOUCHING_M:
                return t, (x, y, z), passed
            h = 0.5 * step
            x += ((v[0] + a[0] * (t + h)) * step) / d
            y += ((v[1] + a[1] * (t + h)) * step) / d
            z += ((v[2] + a[2] * (t + h)) * step) / d
            if d * sqrt(x * x + y * y + z * z) > radius + TOUCHING_M:
                passed, shell = False, radius
            step = max(step, RESTING_S)
        elif gap <= TOUCHING_M:
            if speed < 0.0:
                return t, (x, y, z), passed
            step = -2.0 * speed / bend if bend < 0.0 else inf
            if step <= RESTING_S:
                return t, (x, y, z), passed
        else:
            step = first_root(gap, speed, bend)
        t += step
        if t > limit or step == inf:
            return inf, (0.0, 0.0, 0.0), passed
    return t, (x, y, z), passed


@kernel
def touch_box(bounds, node, p, v, a, radius, start, limit):  # type: ignore[no-untyped-def]
    """A time in start…limit before which the sphere does not touch a node's box, inf when it does not at all."""
    t = start
    for _ in range(BOX_STEPS):
        x = p[0] + (v[0] + 0.5 * a[0] * t) * t
        y = p[1] + (v[1] + 0.5 * a[1] * t) * t
        z = p[2] + (v[2] + 0.5 * a[2] * t) * t
        x -= min(max(x, bounds[node, 0]), bounds[node, 3])
        y -= min(max(y, bounds[node, 1]), bounds[node, 4])
        z -= min(max(z, bounds[node, 2]), bounds[node, 5])
        square = x * x + y * y + z * z
        if square <= radius * radius:
            return t
        d = sqrt(square)
        speed = ((v[0] + a[0] * t) * x + (v[1] + a[1] * t) * y + (v[2] + a[2] * t) * z) / d
        t += first_root(d - radius, speed, (a[0] * x + a[1] * y + a[2] * z) / d)
        if t > limit or t == inf:
            return inf
    return t


@kernel
def _next_touch(tree, stack, times, p, v, a, radius, band, axis, limit):  # type: ignore[no-untyped-def]
    """The next point that the sphere touches: (time, direction, place, whether its core), place −1 for none.

    band, axis : points within `band` of the sphere and towards `−axis` are being passed, as all within the sphere are.
    """
    bounds, first, count, points, spacing = tree
    grown, deepest = radius + 2.0 * TOUCHING_M, core_of(radius, spacing)
    inner, outer = (radius + TOUCHING_M) ** 2, (radius + band) ** 2
    best, found, hard = min(limit, last_inside(bounds, p, v, a, grown)), -1, False
    direction = (0.0, 0.0, 0.0)
    fast = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    strong = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    path = prepared(p, v, a, radius, best)
    stack[0], times[0] = 0, 0.0
    top = 1 if best >= 0.0 else 0
    while top:
        top -= 1
        node, begin = stack[top], times[top]
        if begin > best:
            continue
        if count[node]:
            begin = touch_box(bounds, node, p, v, a, grown, begin, best)
            if begin > best:
                continue
            # What the block can travel until the best contact so far: points beyond that are no better.
            window = best - begin
            x0 = p[0] + (v[0] + 0.5 * a[0] * begin) * begin
            y0 = p[1] + (v[1] + 0.5 * a[1] * begin) * begin
            z0 = p[2] + (v[2] + 0.5 * a[2] * begin) * begin
            reach = radius + (fast + strong * best) * window + TOUCHING_M
            for i in range(first[node], first[node] + count[node]):
                q = (points[i, 0], points[i, 1], points[i, 2])
                if (q[0] - x0) ** 2 + (q[1] - y0) ** 2 + (q[2] - z0) ** 2 > reach * reach:
                    continue
                core, passed = radius, False
                if begin == 0.0 or band > 0.0:
                    x, y, z = p[0] - q[0], p[1] - q[1], p[2] - q[2]
                    square = x * x + y * y + z * z
                    if square < outer:
                        d = sqrt(square)
                        passed = square < inner or x * axis[0] + y * axis[1] + z * axis[2] > FACING * d
                        core = min(deepest, d)
                t, e, deep = touch_point(q, p, v, a, radius, core, 0.0 if passed else begin, best, passed)
                if t < best or (t == best and found < 0):
                    best, found, direction, hard = t, i, e, deep
            continue
        left = first[node]
        near_left, _ = enter_node(bounds, left, p, v, a, path, best)
        near_right, _ = enter_node(bounds, left + 1, p, v, a, path, best)
        right = left + 1
        if near_left > near_right:
            left, right, near_left, near_right = right, left, near_right, near_left
        if near_right < inf:
            stack[top], times[top] = right, near_right
            top += 1
        if near_left < inf:
            stack[top], times[top] = left, near_left
            top += 1
    return best, direction, found, hard


@kernel
def first_contact(tree, stack, times, p, v, a, radius, limit):  # type: ignore[no-untyped-def]
    """The first contact of a sphere with the terrain before `limit`, as `contact_kernels.first_contact` for triangles.

    Returns
    -------
    time, normal, place : [s], from the contact to the centre, in the order of the leaves; (inf, zeros, −1) for none.
    """
    elapsed, band, n = 0.0, 0.0, (0.0, 0.0, 1.0)
    place = -1
    for _ in range(MOST_PASSED):
        t, n, place, hard = _next_touch(tree, stack, times, p, v, a, radius, band, n, limit - elapsed)
        if place < 0:
            return inf, (0.0, 0.0, 0.0), -1
        h = 0.5 * t
        p = (p[0] + (v[0] + a[0] * h) * t, p[1] + (v[1] + a[1] * h) * t, p[2] + (v[2] + a[2] * h) * t)
        v = (v[0] + a[0] * t, v[1] + a[1] * t, v[2] + a[2] * t)
        elapsed += t
        if hard:
            break
        n, height = patch(tree, stack, p, radius, n)
        speed = v[0] * n[0] + v[1] * n[1] + v[2] * n[2]
        bend = a[0] * n[0] + a[1] * n[1] + a[2] * n[2]
        if speed < 0.0:
            if height < radius:
                # Back to where it was tangent to their plane.
                size = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
                elapsed -= min(first_root(height - radius, -speed, bend), min(t, FARTHEST_BACK * radius / size))
            break
        if bend < 0.0 and -2.0 * speed <= -bend * RESTING_S:
            break
        band = band_of(radius, tree[4])
    return elapsed, n, place


@kernel
def gather(tree, stack, p, radius, towards):  # type: ignore[no-untyped-def]
    """The points that a sphere at p touches.

    Returns
    -------
    sums : over those on the side of the direction `towards` (to the centre), each by how deep it is in the band: their
        weights; directions to the centre; differences to it; products of these.
    square, place : squared distance and place of the nearest point, on any side.
    """
    bounds, first, count, points, spacing = tree
    reach = radius + band_of(radius, spacing)
    best, place = reach * reach, -1
    total, mx, my, mz = 0.0, 0.0, 0.0, 0.0
    sx, sy, sz = 0.0, 0.0, 0.0
    xx, yy, zz, xy, yz, zx = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    stack[0] = 0
    top = 1
    while top:
        top -= 1
        node = stack[top]
        if box_distance2(bounds, node, p[0], p[1], p[2]) >= reach * reach:
            continue
        if count[node] == 0:
            stack[top], stack[top + 1] = first[node], first[node] + 1
            top += 2
            continue
        for i in range(first[node], first[node] + count[node]):
            x, y, z = p[0] - points[i, 0], p[1] - points[i, 1], p[2] - points[i, 2]
            square = x * x + y * y + z * z
            if square >= reach * reach:
                continue
            if square < best:
                best, place = square, i
            d = sqrt(square)
            if x * towards[0] + y * towards[1] + z * towards[2] <= FACING * d:
                continue
            w = reach - d
            u = w / d
            total += w
            mx, my, mz = mx + u * x, my + u * y, mz + u * z
            sx, sy, sz = sx + w * x, sy + w * y, sz + w * z
            xx, yy, zz = xx + w * x * x, yy + w * y * y, zz + w * z * z
            xy, yz, zx = xy + w * x * y, yz + w * y * z, zx + w * z * x
    return (total, mx, my, mz, sx, sy, sz, xx, yy, zz, xy, yz, zx), best, place


@kernel
def patch(tree, stack, p, radius, towards):  # type: ignore[no-untyped-def]
    """The plane of the points that a sphere at p touches, on the side of the direction `towards` (to its centre).

    Returns
    -------
    normal, height : of the centre above it [m].
    """
    return fitted(gather(tree, stack, p, radius, towards)[0], radius, towards)


@kernel
def fitted(sums, radius, towards):  # type: ignore[no-untyped-def]
    """The plane of points from the sums of `gather`: see `patch`."""
    total, mx, my, mz, sx, sy, sz, xx, yy, zz, xy, yz, zx = sums
    size = sqrt(mx * mx + my * my + mz * mz)
    if size == 0.0:
        return towards, radius
    mx, my, mz = mx / size, my / size, mz / size
    sx, sy, sz = sx / total, sy / total, sz / total
    xx, yy, zz = xx / total - sx * sx, yy / total - sy * sy, zz / total - sz * sz
    xy, yz, zx = xy / total - sx * sy, yz / total - sy * sz, zx / total - sz * sx
    # Two directions across the mean one: heights along m over them, by weighted least squares.
    if abs(mx) < 0.6:
        ax, ay, az = 0.0, mz, -my
    else:
        ax, ay, az = -mz, 0.0, mx
    size = sqrt(ax * ax + ay * ay + az * az)
    ax, ay, az = ax / size, ay / size, az / size
    bx, by, bz = my * az - mz * ay, mz * ax - mx * az, mx * ay - my * ax
    cax, cay, caz = xx * ax + xy * ay + zx * az, xy * ax + yy * ay + yz * az, zx * ax + yz * ay + zz * az
    cbx, cby, cbz = xx * bx + xy * by + zx * bz, xy * bx + yy * by + yz * bz, zx * bx + yz * by + zz * bz
    held = (HELD_LEVEL * radius) ** 2
    aa, ab = cax * ax + cay * ay + caz * az + held, cax * bx + cay * by + caz * bz
    bb = cbx * bx + cby * by + cbz * bz + held
    am, bm = cax * mx + cay * my + caz * mz, cbx * mx + cby * my + cbz * mz
    det = aa * bb - ab * ab
    one, other = (am * bb - bm * ab) / det, (bm * aa - am * ab) / det
    x, y, z = mx - one * ax - other * bx, my - one * ay - other * by, mz - one * az - other * bz
    size = sqrt(x * x + y * y + z * z)
    x, y, z = x / size, y / size, z / size
    return (x, y, z), x * sx + y * sy + z * sz


@kernel
def closest(tree, stack, p, radius, towards, again):  # type: ignore[no-untyped-def]
    """The ground below a sphere that touches points, or nearly: (x, y, z, squared distance, place), place −1 when none.

    It is the place below the centre in the plane of the points that the sphere touches, or higher where the nearest
    point stands out of that plane.

    Parameters
    ----------
    towards : where the ground was, as its normal.
    again : asks for what else there is when the sphere was moved out of that: points that are deeper in it than they
        may be.
    """
    points = tree[3]
    if again:
        square, place = nearest(tree, stack, p, core_of(radius, tree[4]))
        sums = (0.0,) * 13
    else:
        sums, square, place = gather(tree, stack, p, radius, towards)
    if place < 0:
        return 0.0, 0.0, 0.0, inf, -1
    d = sqrt(square)
    if d == 0.0:
        return p[0], p[1], p[2], 0.0, place
    x, y, z = p[0] - points[place, 0], p[1] - points[place, 1], p[2] - points[place, 2]
    if again or x * towards[0] + y * towards[1] + z * towards[2] <= FACING * d:
        n, height = patch(tree, stack, p, radius, (x / d, y / d, z / d))
    else:
        n, height = fitted(sums, radius, towards)
    along = x * n[0] + y * n[1] + z * n[2]
    d = min(height, radius + along - sqrt(max(radius * radius - square + along * along, 0.0)))
    return p[0] - d * n[0], p[1] - d * n[1], p[2] - d * n[2], d * d, place
