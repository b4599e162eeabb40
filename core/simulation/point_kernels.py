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

from ..compiled import borrowing as kernel
from ..terrain.kernels import box_distance2, inverse
from ..terrain.point_kernels import inlined, middle, nearest
from .contact_kernels import RESTING_S, STEPS, TOUCHING_M, first_root, last_inside
from .near_point_kernels import is_about, knows, look_ahead, meet

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
DISC_STEPS = 4
NO_SUMS = (0.0,) * 10
FARTHEST_BACK = 0.5
"""A contact is taken back along the flight by this part of the radius at most."""
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


@inlined
def path_of(p, v, a, radius, limit):  # type: ignore[no-untyped-def]
    """What `enter` needs of a path: in plan it is a straight line, but for drag; its way along that, and its height."""
    fast = sqrt(v[0] * v[0] + v[1] * v[1])
    ux, uy = (v[0] / fast, v[1] / fast) if fast > 0.0 else (1.0, 0.0)
    brake, drift = 0.5 * (ux * a[0] + uy * a[1]), 0.5 * (ux * a[1] - uy * a[0])
    grown, square = radius + 2.0 * TOUCHING_M, limit * limit
    bent = abs(brake) * square if brake != 0.0 else 0.0
    aside = abs(drift) * square if drift != 0.0 else 0.0
    return ux, uy, fast, brake, v[2], 0.5 * a[2], inverse(fast), grown, bent, aside


@inlined
def enter(nodes, node, p, v, a, path, limit):  # type: ignore[no-untyped-def]
    """Between which times the sphere can touch the points in a node's box: (inf, …) when not before `limit`.

    path : of `path_of`. In plan the box is met between two lines across the way, and beside it not at all; then the
        height decides, and the chord of that part of the path: the path is above it, so that a box that is a radius
        below it is not touched. Ground that a block skims is so left out as a whole.
    """
    ux, uy, _, _, rise, fall, over, grown, bent, aside = path
    low_x, low_y = nodes[node, 0] - p[0], nodes[node, 1] - p[1]
    high_x, high_y = nodes[node, 3] - p[0], nodes[node, 4] - p[1]
    under, above = nodes[node, 2] - p[2], nodes[node, 5] - p[2]
    one, other, two, more = ux * low_x, ux * high_x, uy * low_y, uy * high_y
    low, high = min(one, other) + min(two, more), max(one, other) + max(two, more)
    near, far = max((low - grown - bent) * over, 0.0), min((high + grown + bent) * over, limit)
    one, other, two, more = uy * low_x, uy * high_x, ux * low_y, ux * high_y
    least, most = min(two, more) - max(one, other), max(two, more) - min(one, other)
    square = 0.25 * (far - near) * (far - near)
    begin, end = (rise + fall * near) * near, (rise + fall * far) * far
    sag = fall * square
    deep, top = min(begin, end) - max(sag, 0.0), max(begin, end) - min(sag, 0.0)
    nx, ny, nz = nodes[node, 6], nodes[node, 7], nodes[node, 8]
    height = nx * p[0] + ny * p[1] + nz * p[2]
    across, bend = nx * v[0] + ny * v[1] + nz * v[2], 0.5 * (nx * a[0] + ny * a[1] + nz * a[2])
    begin, end = (across + bend * near) * near, (across + bend * far) * far
    sag = bend * square
    meets = (
        (near <= far)
        & (least <= grown + aside)
        & (most >= -grown - aside)
        & (deep <= above + grown)
        & (top >= under - grown)
        & (min(begin, end) - max(sag, 0.0) <= nodes[node, 10] + grown - height)
        & (max(begin, end) - min(sag, 0.0) >= nodes[node, 9] - grown - height)
    )
    return near if meets else inf, far


@inlined
def chord(path, near, far):  # type: ignore[no-untyped-def]
    """The chord of a part of the path: `up` s − `along` z > `offset` below it and the path, s along the way in plan."""
    _, _, speed, brake, rise, fall, _, _, _, _ = path
    along, up = speed + brake * (near + far), rise + fall * (near + far)
    offset = up * (speed + brake * near) * near - along * (rise + fall * near) * near
    # Bent towards that side by drag alone, the path may be beyond its chord.
    return along, up, offset + 0.25 * max(fall * along - brake * up, 0.0) * (far - near) * (far - near)


@inlined
def touch_disc(nodes, node, p, v, a, radius, t, limit):  # type: ignore[no-untyped-def]
    """A time in t…limit before which the sphere does not touch the disc about a node's points, inf when not at all."""
    nx, ny, nz = nodes[node, 6], nodes[node, 7], nodes[node, 8]
    size = sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx / size, ny / size, nz / size
    cx, cy, cz = middle(nodes, node)
    level = nx * cx + ny * cy + nz * cz
    low, high, wide = nodes[node, 9] / size - level, nodes[node, 10] / size - level, nodes[node, 11]
    for _ in range(DISC_STEPS):
        x = p[0] + (v[0] + 0.5 * a[0] * t) * t - cx
        y = p[1] + (v[1] + 0.5 * a[1] * t) * t - cy
        z = p[2] + (v[2] + 0.5 * a[2] * t) * t - cz
        height = nx * x + ny * y + nz * z
        x, y, z = x - height * nx, y - height * ny, z - height * nz
        aside = sqrt(x * x + y * y + z * z)
        out = max(aside - wide, 0.0)
        over = height - min(max(height, low), high)
        square = out * out + over * over
        if square <= radius * radius:
            return t
        d = sqrt(square)
        f, over = out / (aside * d) if out > 0.0 else 0.0, over / d
        x, y, z = f * x + over * nx, f * y + over * ny, f * z + over * nz
        speed = (v[0] + a[0] * t) * x + (v[1] + a[1] * t) * y + (v[2] + a[2] * t) * z
        t += first_root(d - radius, speed, a[0] * x + a[1] * y + a[2] * z)
        if t > limit or t == inf:
            return inf
    return t


@inlined
def _next_touch(tree, stack, times, p, v, a, radius, band, axis, limit):  # type: ignore[no-untyped-def]
    """The next point that the sphere touches: (time, direction, place, whether its core), place −1 for none.

    band, axis : points within `band` of the sphere and towards `−axis` are being passed, as all within the sphere are.
    """
    bounds, first, count, points, spacing = tree
    deepest = core_of(radius, spacing)
    inner, outer = (radius + TOUCHING_M) ** 2, (radius + band) ** 2
    best, found, hard = min(limit, last_inside(bounds, p, v, a, radius + 2.0 * TOUCHING_M)), -1, False
    direction = (0.0, 0.0, 0.0)
    path = path_of(p, v, a, radius, best)
    ux, uy, over, grown, bent, aside = path[0], path[1], path[6], path[7], path[8], path[9]
    stack[0], times[0] = 0, 0.0
    top = 1 if best >= 0.0 else 0
    while top:
        top -= 1
        node = stack[top]
        if times[top] > best:
            continue
        if count[node]:
            near, far = enter(bounds, node, p, v, a, path, best)
            if near == inf:
                continue
            near = touch_disc(bounds, node, p, v, a, grown, near, far)
            if near == inf:
                continue
            along, up, offset = chord(path, near, far)
            size = along * along + up * up
            for i in range(first[node], first[node] + count[node]):
                x, y, z = points[i, 0] - p[0], points[i, 1] - p[1], points[i, 2] - p[2]
                s, beside = ux * x + uy * y, max(abs(ux * y - uy * x) - aside, 0.0)
                room, gap = grown * grown - beside * beside, up * s - along * z - offset
                if room < 0.0 or (gap > 0.0 and gap * gap > room * size):
                    continue
                half = sqrt(room) + bent
                begin, end = max((s - half) * over, near), min((s + half) * over, best)
                if begin > end:
                    continue
                core, passed = radius, False
                if near == 0.0 or band > 0.0:
                    square = x * x + y * y + z * z
                    if square < outer:
                        d = sqrt(square)
                        passed = square < inner or x * axis[0] + y * axis[1] + z * axis[2] < -FACING * d
                        core = min(deepest, d)
                if passed:
                    begin = 0.0
                q = (points[i, 0], points[i, 1], points[i, 2])
                t, e, deep = touch_point(q, p, v, a, radius, core, begin, end, passed)
                if t < best or (t == best and found < 0):
                    best, found, direction, hard = t, i, e, deep
            continue
        left = first[node]
        near_left, _ = enter(bounds, left, p, v, a, path, best)
        near_right, _ = enter(bounds, left + 1, p, v, a, path, best)
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


@inlined
def added(sums, x, y, z, square, reach, towards):  # type: ignore[no-untyped-def]
    """The sums of `gather` with one more point; x, y, z from it to the centre."""
    total, mx, my, mz, xx, yy, zz, xy, yz, zx = sums
    facing = x * towards[0] + y * towards[1] + z * towards[2]
    w = reach * reach - square if facing > 0.0 and facing * facing > FACING * FACING * square else 0.0
    ux, uy, uz = w * x, w * y, w * z
    return (
        total + w, mx + ux, my + uy, mz + uz,
        xx + ux * x, yy + uy * y, zz + uz * z, xy + ux * y, yz + uy * z, zx + uz * x,
    )  # fmt: skip


@kernel
def gather(tree, stack, p, radius, towards):  # type: ignore[no-untyped-def]
    """The points that a sphere at p touches.

    Returns
    -------
    sums : over those on the side of the direction `towards` (to the centre), each by how deep it is in the band (the
        squares of distances differ as depths do, in a thin band): their weights; differences to the centre; products of
        these.
    square, place : squared distance and place of the nearest point, on any side.
    """
    nodes, first, count, points, spacing = tree
    reach = radius + band_of(radius, spacing)
    best, place, sums = reach * reach, -1, NO_SUMS
    stack[0] = 0
    top = 1
    while top:
        top -= 1
        node = stack[top]
        if box_distance2(nodes, node, p[0], p[1], p[2]) >= reach * reach:
            continue
        height = nodes[node, 6] * p[0] + nodes[node, 7] * p[1] + nodes[node, 8] * p[2]
        if height - reach > nodes[node, 10] or height + reach < nodes[node, 9]:
            continue
        if count[node] == 0:
            stack[top], stack[top + 1] = first[node], first[node] + 1
            top += 2
            continue
        for i in range(first[node], first[node] + count[node]):
            x, y, z = p[0] - points[i, 0], p[1] - points[i, 1], p[2] - points[i, 2]
            square = x * x + y * y + z * z
            if square < reach * reach:
                if square < best:
                    best, place = square, i
                sums = added(sums, x, y, z, square, reach, towards)
    return sums, best, place


@inlined
def gather_close(close, p, reach, towards):  # type: ignore[no-untyped-def]
    """`gather` of the points about a block on the ground."""
    places, coordinates, _ = close
    best, place, sums = reach * reach, -1, NO_SUMS
    for k in range(meet(p, reach, close)):
        i = places[1, k]
        x, y, z = p[0] - coordinates[0, i], p[1] - coordinates[1, i], p[2] - coordinates[2, i]
        square = x * x + y * y + z * z
        if square < best:
            best, place = square, places[0, i]
        sums = added(sums, x, y, z, square, reach, towards)
    return sums, best, place


@inlined
def nearest_close(close, p, limit):  # type: ignore[no-untyped-def]
    """`nearest` of the points that a block met last, where those nearer than `limit` are among them."""
    places, coordinates, known = close
    best, place = limit * limit, -1
    for k in range(int(known[7])):
        i = places[1, k]
        x, y, z = p[0] - coordinates[0, i], p[1] - coordinates[1, i], p[2] - coordinates[2, i]
        square = x * x + y * y + z * z
        if square < best:
            best, place = square, places[0, i]
    return best, place


@inlined
def patch(tree, stack, p, radius, towards):  # type: ignore[no-untyped-def]
    """The plane of the points that a sphere at p touches, on the side of the direction `towards` (to its centre).

    Returns
    -------
    normal, height : of the centre above it [m].
    """
    return fitted(gather(tree, stack, p, radius, towards)[0], radius, towards)


@inlined
def fitted(sums, radius, towards):  # type: ignore[no-untyped-def]
    """The plane of points from the sums of `gather`: see `patch`."""
    total, sx, sy, sz, xx, yy, zz, xy, yz, zx = sums
    size = sqrt(sx * sx + sy * sy + sz * sz)
    if size == 0.0:
        return towards, radius
    mx, my, mz, over = sx / size, sy / size, sz / size, 1.0 / total
    sx, sy, sz = sx * over, sy * over, sz * over
    xx, yy, zz = xx * over - sx * sx, yy * over - sy * sy, zz * over - sz * sz
    xy, yz, zx = xy * over - sx * sy, yz * over - sy * sz, zx * over - sz * sx
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


@inlined
def closest(tree, stack, close, p, v, radius, towards, again):  # type: ignore[no-untyped-def]
    """The ground below a sphere that touches points, or nearly: (x, y, z, squared distance, place), place −1 when none.

    It is the place below the centre in the plane of the points that the sphere touches, or higher where the nearest
    point stands out of that plane.

    Parameters
    ----------
    close : see `near_point_kernels`.
    v : velocity, on whose way points are looked up.
    towards : where the ground was, as its normal.
    again : asks for what else there is when the sphere was moved out of that: points that are deeper in it than they
        may be.
    """
    points, core = tree[3], core_of(radius, tree[4])
    reach = radius + band_of(radius, tree[4])
    if again:
        if knows(close, p, reach - core):
            square, place = nearest_close(close, p, core)
        else:
            square, place = nearest(tree, stack, p, core)
        sums = NO_SUMS
    else:
        look_ahead(tree, stack, p, v, radius, reach, close)
        sums, square, place = _gathered(tree, stack, close, p, radius, reach, towards)
    if place < 0:
        return 0.0, 0.0, 0.0, inf, -1
    d = sqrt(square)
    if d == 0.0:
        return p[0], p[1], p[2], 0.0, place
    x, y, z = p[0] - points[place, 0], p[1] - points[place, 1], p[2] - points[place, 2]
    if again or x * towards[0] + y * towards[1] + z * towards[2] <= FACING * d:
        towards = (x / d, y / d, z / d)
        sums, _, _ = _gathered(tree, stack, close, p, radius, reach, towards)
    n, height = fitted(sums, radius, towards)
    along = x * n[0] + y * n[1] + z * n[2]
    d = min(height, radius + along - sqrt(max(radius * radius - square + along * along, 0.0)))
    return p[0] - d * n[0], p[1] - d * n[1], p[2] - d * n[2], d * d, place


@inlined
def _gathered(tree, stack, close, p, radius, reach, towards):  # type: ignore[no-untyped-def]
    """`gather`, of the points that are known where they are all that count."""
    if is_about(p, radius, close):
        return gather_close(close, p, reach, towards)
    return gather(tree, stack, p, radius, towards)
