# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion of one block from its release to its end: it flies, hits, rolls or slides, and stops. Compiled kernels.

Flight is the parabola (`contact_kernels`), or with drag a chain of parabolas. At a contact the impact model decides. A
block whose rebound would hop less than `HOP` of its radius stays on the ground. There a leg takes it over a triangle in
closed form (`leg_kernels`), and over gentle edges on to the next (`edge_kernels`). At other edges, in corners, and
where more triangles are near, it moves on in steps shorter than half its radius, each a free fall that the terrain
corrects to one radius above its closest point. A free fall that ends above that is followed to where it lands: when
that is a hop as well the block has stayed on the ground, else it has left it. So blocks fly off crests by themselves.

On the ground the direction follows gravity along the terrain, the speed follows the energy,

    v² ← v² − 2 A g (Δz + μ cosβ Δs)

which gives the same energy line for any step. A is 1 for sliding (Coulomb) and 1/(1 + c) for rolling (Azzoni et al.
1995), with the inertia c m r²; μ is the coefficient of friction of the zone. Drag takes exp(−2 A k Δs) of it, with k of
the flight: exact for drag alone, and legs are short enough for both.

A block whose three moments of inertia are not the same turns freely in flight (`rotation`): the spin that it hits with
is not the one that it left with. Its attitude is drawn at the release, kept at contacts and while it rolls.
"""

from math import exp, inf, sqrt

import numpy as np

from ..compiled import borrowing, kernel
from ..terrain.kernels import STACK_SIZE
from .chance_kernels import ATTITUDE, fill_uniform
from .contact_kernels import TOUCHING_M, inlined, last_root
from .corner_kernels import FREE, FUZZY, angle_between, between, beyond_noise, met, share_of_crease, share_of_wall
from .drag_kernels import DRAG_CHANGE, with_drag
from .edge_kernels import keeps, onto, over, turns_about
from .facet_kernels import NOWHERE
from .ground_kernels import box, first_contact
from .leg_kernels import AT_ANOTHER, ON_TRIANGLE, leg
from .near_kernels import MOST_NEAR, NEIGHBOURHOOD, closest_near, first_near, inside
from .near_point_kernels import KNOWN, MOST_CLOSE, forget
from .point_kernels import closest
from .record_kernels import ALL, ENDED, FLIES_OFF, IMPACT, IMPACTS, ON_GROUND, RELEASED, TREE, grown, write
from .rotation import drawn_axes, turn
from .tree_kernels import MOST_FALLEN, PARTS, against_stem, first_stem, let_fall, round_stem, stem_on_way

STOPPED, LEFT, LIMIT, NO_ROOM = 0, 1, 2, -2
"""How a run ends."""
NO_ROLLING, AZZONI, COULOMB = 0, 1, 2

HOP = 0.1
"""A rebound that rises less than this part of the radius above the ground is none."""
STEP, FALL = 0.5, 0.05
"""A step on the ground is shorter than these parts of the radius: along the ground, and in free fall."""
LEAST_STEP = 0.0025
"""Steps that turn the normal by more than `FREE` are shortened down to this part of the radius: what turns it then is
a corner, where the block touches two planes at once."""
HELD, MOST_HELD = 1e-4, 100
"""A block that moves less than this part of its radius in so many steps is held where it is."""
LINGERS = 0.3
"""So is one that rocks: that in so many short steps gets no further than this part of its radius.

From 0.05 to 1, with 600 blocks and two models each: on the demo site's triangles no run depends on it; on two scanned
clouds at most 15 runs, by 0.7 m below 0.3 and by 1.5 m above, and mean run-outs by 0.005 m. Up to 0.1 some blocks, 9 at
most, rock on to the limit of time, from 0.2 on none: the value is among those, and far from either end.
"""
MOST_LEANT = 20
"""So is one that meets stems so often without getting further."""
SAME_MOMENT_S, MOST_AT_ONCE = 1e-7, 12
"""Contacts nearer in time than this are one moment; so many are taken one after the other."""
DRIFTS = 1e-6
"""A block that flies more slowly than this in plan [m/s] meets no stem: it falls."""
UNTURNED = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@borrowing
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@borrowing
def _at(p, v, a, t):  # type: ignore[no-untyped-def]
    """Place and velocity on a parabola."""
    h = 0.5 * t
    return (
        (p[0] + (v[0] + a[0] * h) * t, p[1] + (v[1] + a[1] * h) * t, p[2] + (v[2] + a[2] * h) * t),
        (v[0] + a[0] * t, v[1] + a[1] * t, v[2] + a[2] * t),
    )


@borrowing
def _along(v, n):  # type: ignore[no-untyped-def]
    """The part of a vector along the ground."""
    s = _dot(v, n)
    return v[0] - s * n[0], v[1] - s * n[1], v[2] - s * n[2]


@borrowing
def _in_corner(v, n, m):  # type: ignore[no-untyped-def]
    """The part of a vector along the corner of two planes of other normals."""
    x, y, z = n[1] * m[2] - n[2] * m[1], n[2] * m[0] - n[0] * m[2], n[0] * m[1] - n[1] * m[0]
    s = (x * v[0] + y * v[1] + z * v[2]) / (x * x + y * y + z * z)
    return s * x, s * y, s * z


@borrowing
def _rolling(n, v, radius):  # type: ignore[no-untyped-def]
    """The spin that rolls: (n × v)/r."""
    return (
        (n[1] * v[2] - n[2] * v[1]) / radius,
        (n[2] * v[0] - n[0] * v[2]) / radius,
        (n[0] * v[1] - n[1] * v[0]) / radius,
    )


@inlined
def _closest(tree, stack, p, v, radius, nearby, close, towards, again):  # type: ignore[no-untyped-def]
    """The closest of the ground to a block: see `closest_near` and `point_kernels.closest`."""
    if len(tree) == 5:
        return closest(tree, stack, close, p, v, radius, towards, again)
    if len(tree) == 6:
        return closest_near(tree, stack, p, radius, nearby)
    x, y, z, square, place = closest_near(tree[0], stack, p, radius, nearby)
    qx, qy, qz, other, found = closest(tree[1], stack, close, p, v, radius, towards, again)
    if found >= 0 and other < square:
        return qx, qy, qz, other, tree[0][3].shape[0] + found
    return x, y, z, square, place


@inlined
def _touching(tree, stack, p, v, radius, nearby, close, towards):  # type: ignore[no-untyped-def]
    """The centre moved out of the ground, and the contacts that moved it.

    Parameters
    ----------
    towards : the normal of the ground where the block was.

    Returns
    -------
    p : where the sphere only touches.
    support, place : the normal that points up most, and where.
    against, other : the normal that the velocity runs against most, and where.
    distance : of p from the ground as it was given.
    """
    distance, support, place, against, other, most = inf, (0.0, 0.0, -2.0), -1, (0.0, 0.0, 1.0), -1, -inf
    for k in range(MOST_AT_ONCE):
        qx, qy, qz, square, found = _closest(tree, stack, p, v, radius, nearby, close, towards, k > 0)
        if found < 0:
            break
        d = sqrt(square)
        if k == 0:
            distance = d
            if d > radius + TOUCHING_M:
                break
        elif d >= radius - TOUCHING_M:
            break
        if d == 0.0:
            break
        n = ((p[0] - qx) / d, (p[1] - qy) / d, (p[2] - qz) / d)
        p = (qx + radius * n[0], qy + radius * n[1], qz + radius * n[2])
        if n[2] > support[2]:
            support, place = n, found
        if -_dot(v, n) > most:
            against, other, most = n, found, -_dot(v, n)
    return p, support, place, against, other, distance


@borrowing
def _moved(p, q, v, towards, gravity, mu):  # type: ignore[no-untyped-def]
    """A way on the ground, or as much of it as the energy lasts for.

    Parameters
    ----------
    p, q : the centre before and after. v : before. towards : the direction of the velocity after.
    gravity : the part of it that accelerates. mu : friction, as a part of the weight.

    Returns
    -------
    part : of the way that is gone. p, v : after it. ds : length of the whole way.
    """
    way = (q[0] - p[0], q[1] - p[1], q[2] - p[2])
    ds, size, square = sqrt(_dot(way, way)), sqrt(_dot(towards, towards)), _dot(v, v)
    loss = 2.0 * gravity * (way[2] + mu * ds)
    left = square - loss
    if left > 1e-12 * square and size > 0.0:
        now = sqrt(left) / size
        return 1.0, q, (now * towards[0], now * towards[1], now * towards[2]), ds
    part = min(max(square / loss, 0.0), 1.0) if loss > 0.0 and size > 0.0 else 1.0
    return part, (p[0] + part * way[0], p[1] + part * way[1], p[2] + part * way[2]), (0.0, 0.0, 0.0), ds


@borrowing
def _on_ground(v, n):  # type: ignore[no-untyped-def]
    """A velocity along the ground in the same direction in plan, as fast as it was."""
    z = -(n[0] * v[0] + n[1] * v[1]) / max(n[2], 1e-6)
    size, speed = sqrt(v[0] * v[0] + v[1] * v[1] + z * z), sqrt(_dot(v, v))
    s = speed / size if size > 0.0 else 0.0
    return s * v[0], s * v[1], s * z


@borrowing
def _dragged(v, drag, ds):  # type: ignore[no-untyped-def]
    """What drag leaves of a velocity on the way ds: drag [1/m] is that of the mass that moves."""
    kept = exp(-drag * ds)
    return kept * v[0], kept * v[1], kept * v[2]


@borrowing
def _lands(tree, stack, times, nearby, p, v, gravity, radius):  # type: ignore[no-untyped-def]
    """Where a block that hops on the ground lands: `first_contact`, looked for nearby first."""
    a = (0.0, 0.0, -gravity)
    if len(tree) == 6 and nearby[2][0] >= 0.0:
        limit = inside(nearby, p, sqrt(_dot(v, v)), gravity, radius)
        t, e, hit = first_near(tree[3], nearby, p, v, a, radius, NOWHERE, limit)
        if hit >= 0:
            return t, e, hit
    return first_contact(tree, stack, times, p, v, a, radius, inf)


@borrowing
def _leaves(bounds, p, v, a, radius):  # type: ignore[no-untyped-def]
    """When a flight that meets nothing is gone from the box of the terrain."""
    leave = 0.0
    low = bounds[2] - radius
    if a[2] < 0.0 and p[2] > low:
        leave = max(last_root(p[2] - low, v[2], a[2]), 0.0)
    for axis in range(2):
        if v[axis] > 0.0:
            leave = min(leave, max((bounds[axis + 3] + radius - p[axis]) / v[axis], 0.0))
        elif v[axis] < 0.0:
            leave = min(leave, max((bounds[axis] - radius - p[axis]) / v[axis], 0.0))
    return leave


@borrowing
def run_block(  # type: ignore[no-untyped-def]
    tree, facets, zone, rebound, parameters, friction, own, draws, stack, times, nearby, close, rows, count,
    run, seed, p, v, w, radius, mass, inertia, moments, drag, gravity, law, most_impacts, most_s, record, stems,
    fallen, uniform,
):  # fmt: skip
    """Fill `rows` from `count` on; returns (count, end, time, impacts, length, v_max, trees), the end `NO_ROOM` if they
    are too short.

    Parameters
    ----------
    zone : (m,) of each triangle in the order of the leaves.
    parameters, friction : (s·z, k), (s·z,) of each zone, in one set after the other.
    own : the row of the first zone in this run's set.
    rebound : a model's compiled function.
    draws : (d,) work space for the uniform numbers of one impact.
    inertia : c of c m r², for rolling. moments : three, of inertia, for flight. drag : ½ρC_D A/m [1/m].
    law : `NO_ROLLING`, `AZZONI` or `COULOMB`.
    record : `ENDS_ONLY`, `IMPACTS` or `ALL`.
    stems : see `tree_kernels`; empty for none. fallen : work space, those that gave way to this block.
    uniform : (3,) work space.
    """
    zero = (0.0, 0.0, 0.0)
    bounds = box(tree)
    factor = 1.0 / (1.0 + inertia) if law == AZZONI else 1.0
    rolls, stride = inertia if law == AZZONI else 0.0, STEP
    shortest = sqrt(2.0 * FALL * radius / gravity)
    time, length, impacts, at_once, held, end = 0.0, 0.0, 0, 0, 0, -1
    v_max = sqrt(_dot(v, v))
    grounded, n, place = False, (0.0, 0.0, 1.0), NOWHERE
    nearby[2][0], nearby[2][5] = -1.0, NEIGHBOURHOOD  # nothing of another block
    forget(close)
    known, t, e, hit, edge, marked = False, 0.0, zero, NOWHERE, ON_TRIANGLE, False
    anchor, lingers, trees = p, 0, 0
    fallen[0], leant, stem_met = 0, -inf, -1
    tumbles, axes, spun = moments[0] != moments[1] or moments[1] != moments[2], UNTURNED, 0.0
    if tumbles:
        fill_uniform(seed, run, ATTITUDE, uniform)
        axes = drawn_axes(uniform)
    if count + 2 >= rows.shape[0]:
        return count, NO_ROOM, time, impacts, length, v_max, trees
    write(rows, count, run, RELEASED, time, p, v, w, v, w, n, -1)
    count += 1
    while end < 0:
        if count + 2 >= rows.shape[0]:
            return count, NO_ROOM, time, impacts, length, v_max, trees
        if impacts + trees >= most_impacts or time >= most_s:
            end = LIMIT
            break
        speed = sqrt(_dot(v, v))
        if grounded:
            spun = time
        else:
            a, horizon, then = (0.0, 0.0, -gravity), inf, zero
            if drag > 0.0:
                horizon = DRAG_CHANGE / (drag * speed + 1e-3)
                moved, then = with_drag(v, drag, gravity, horizon)
                f = 2.0 / (horizon * horizon)
                a = (
                    f * (moved[0] - v[0] * horizon),
                    f * (moved[1] - v[1] * horizon),
                    f * (moved[2] - v[2] * horizon),
                )  # the parabola through both ends
            if not known:
                t, e, hit = first_contact(tree, stack, times, p, v, a, radius, horizon)
            known = False
            if len(stems) == PARTS and v[0] * v[0] + v[1] * v[1] > DRIFTS * DRIFTS:
                until = t if hit >= 0 else min(horizon, _leaves(bounds, p, v, a, radius))
                until, struck = first_stem(stems, fallen, p, v, a, radius, until)
                if struck >= 0:
                    before, start = p, v
                    p, v = _at(p, v, a, until)
                    if drag > 0.0:
                        v = with_drag(start, drag, gravity, until)[1]
                    time += until
                    chord = (p[0] - before[0], p[1] - before[1], p[2] - before[2])
                    length += sqrt(_dot(chord, chord))
                    if tumbles:
                        axes, w = turn(moments, axes, w, time - spun)
                        spun = time
                    v1, w1 = v, w
                    v_max = max(v_max, sqrt(_dot(v, v)))
                    v, w, away, stands = against_stem(stems[3], struck, p, v1, w1, radius, mass)
                    if struck != stem_met and time - leant < SAME_MOMENT_S:
                        v, w = zero, zero  # wedged between two stems
                    leant, stem_met, trees = time, struck, trees + 1
                    if not stands:
                        let_fall(fallen, stems[4][struck])
                    if record >= IMPACTS:
                        write(rows, count, run, TREE, time, p, v, w, v1, w1, away, stems[4][struck])
                        count += 1
                    continue
            if hit < 0:
                gone = _leaves(bounds, p, v, a, radius)
                t = min(horizon, gone)
                if gone <= horizon:
                    end = LEFT
                start = v
                p, v = _at(p, v, a, t)
                if drag > 0.0 and t == horizon:
                    v = then
                length += 0.5 * t * (sqrt(_dot(start, start)) + sqrt(_dot(v, v)))
                time += t
                v_max = max(v_max, sqrt(_dot(v, v)))
                continue
            at_once = at_once + 1 if t < SAME_MOMENT_S else 0
            before, start = p, v
            p, v = _at(p, v, a, t)
            if drag > 0.0:
                v = with_drag(start, drag, gravity, t)[1]
            time += t
            chord = (p[0] - before[0], p[1] - before[1], p[2] - before[2])
            length += sqrt(_dot(chord, chord))
            n, place = e, hit
            if tumbles:
                axes, w = turn(moments, axes, w, time - spun)
                spun = time
            v1, w1 = v, w
            v_max = max(v_max, sqrt(_dot(v, v)))
            if _dot(v, n) < 0.0 and at_once < MOST_AT_ONCE:
                z = own + zone[place]
                fill_uniform(seed, run, impacts, draws)
                v, w = rebound(v1, n, w1, radius, mass, parameters[z], draws)
                impacts += 1
                if record >= IMPACTS:
                    write(rows, count, run, IMPACT, time, p, v, w, v1, w1, n, place)
                    count += 1
                v_max = max(v_max, sqrt(_dot(v, v)))
            rises = _dot(v, n)
            if n[2] > 0.0 and rises * rises < 2.0 * gravity * n[2] * HOP * radius:
                grounded, v, edge, marked = True, _along(v, n), ON_TRIANGLE, False
                if law == NO_ROLLING:
                    end = STOPPED
            elif at_once >= MOST_AT_ONCE:
                end = STOPPED  # held between walls
            elif rises <= 0.0:
                v = _along(v, n)  # a model that sends a block into the ground, or an overhang: it slides off
            continue

        mu = friction[own + zone[place]]
        dt = shortest
        if speed > 0.0:
            dt = min(dt, stride * radius / speed)
        cosine = n[2]
        steep = sqrt(max(1.0 - cosine * cosine, 0.0))
        if speed < 1e-6 and steep <= mu * cosine:
            end = STOPPED
            break
        moves, leaves, bent = False, False, False
        p0, v0, n0, place0, time0, length0 = p, v, n, place, time, length
        if len(tree) == 6:
            if edge == ON_TRIANGLE:
                e, hit, longest = n, place, most_s - time
                if drag > 0.0:
                    k = drag * speed
                    longest = min(longest, 2.0 * DRAG_CHANGE / (k + sqrt(k * k + 2.0 * DRAG_CHANGE * drag * gravity)))
                t, q, turned, edge = leg(
                    tree, facets, stack, nearby, p, v, n, place, radius, gravity, factor, mu, longest
                )
                moves = bent = t > 0.0
                if moves and edge == AT_ANOTHER:
                    q = _touching(tree, stack, q, turned, radius, nearby, close, n)[0]
            elif edge != AT_ANOTHER:
                t, q, turned, e, hit = over(
                    tree, facets, stack, p, v, n, place, edge, radius, gravity, factor, mu, HOP * radius
                )
                moves, leaves, edge = hit >= 0, hit < 0 and t > 0.0, ON_TRIANGLE
                if leaves:
                    p, v = q, turned
        if not moves:
            dt = t if leaves else dt
            free, falling = _at(p, v, (0.0, 0.0, -gravity), dt)
            pull = -gravity * factor * dt
            away, e, hit, against, other, distance = p, n, place, n, place, inf
            if not leaves:
                ahead = _along((v[0], v[1], v[2] + pull), n)
                away, e, hit, against, other, distance = _touching(tree, stack, free, ahead, radius, nearby, close, n)
            if distance > radius + TOUCHING_M:
                drop = inf
                if len(tree) == 6 and not leaves:
                    down = (-n[0], -n[1], -n[2])
                    drop, e, hit = first_contact(tree, stack, times, free, down, zero, radius, radius)
                if (
                    drop < inf
                    and keeps(facets, tree[3], place, hit, v, n, e, radius, gravity, HOP * radius)
                    and turns_about(tree, facets, hit, e, v, radius, gravity)
                ):
                    q, turned, t, moves = _at(free, down, zero, drop)[0], v, dt, True
                else:
                    t, e, hit = _lands(tree, stack, times, nearby, free, falling, gravity, radius)
                    q, turned = _at(free, falling, (0.0, 0.0, -gravity), t if hit >= 0 else 0.0)
                    t, lands = t + dt, _dot(turned, e)
                    moves = hit >= 0 and e[2] > 0.0 and lands * lands < 2.0 * gravity * e[2] * HOP * radius
                if not moves:
                    grounded, known, at_once = False, drag == 0.0, 0
                    if record >= IMPACTS:
                        write(rows, count, run, FLIES_OFF, time, p, v, w, v, w, n, place)
                        count += 1
                    if drag > 0.0:  # from off the ground: where it touches, its flight would end at once
                        p, v, time, length = free, falling, time + dt, length + speed * dt
                    continue
                turned, edge = _along(turned, e), ON_TRIANGLE
        if moves:
            part, p, v, ds = _moved(p, q, v, turned, factor * gravity, mu * max(cosine, 0.0))
            time, length = time + part * t, length + part * ds
            if drag > 0.0:
                v = _dragged(v, factor * drag, part * ds)
            n, place, came = e, hit, v
            if len(tree) == 6 and part == 1.0 and 0 <= edge < AT_ANOTHER and facets[1][place, edge] > 0.0:
                v, n, place, edge = onto(tree, facets, p, v, n, place, edge, radius, gravity, factor, mu, rolls, dt)
            held = held + 1 if ds < HELD * radius else 0
            if held > MOST_HELD:
                end = STOPPED
        else:
            if hit < 0:
                end = STOPPED  # the centre is on the ground itself: there is no way out
                break
            way = (away[0] - p[0], away[1] - p[1], away[2] - p[2])
            ds = sqrt(_dot(way, way))
            towards, angle = -_dot(v, against), angle_between(n, against)
            meets = towards > 0.0 and angle > FREE
            if meets and stride > LEAST_STEP and len(tree) == 6:
                stride = max(0.25 * stride, LEAST_STEP)
                continue
            held = held + 1 if ds < HELD * radius else 0
            gone = (away[0] - anchor[0], away[1] - anchor[1], away[2] - anchor[2])
            lingers += 1
            if _dot(gone, gone) > (LINGERS * radius) ** 2:
                anchor, lingers = away, 0
            if held > MOST_HELD or lingers > MOST_HELD:
                end = STOPPED
                break
            stride = min(4.0 * stride, STEP)
            turned, square, blocked = _along((v[0], v[1], v[2] + pull), e), speed * speed, False
            if meets:
                share = 1.0
                if len(tree) == 6:
                    share = share_of_crease(facets, tree[3], place, other, v, n, angle)
                else:
                    share = beyond_noise(angle, FUZZY)
                after, wall = met(v, n, against, rolls, share * share), share_of_wall(angle)
                if wall > 0.0 and towards * towards > 2.0 * gravity * HOP * radius:
                    fill_uniform(seed, run, impacts, draws)
                    v1, w1 = v, w
                    v, w = rebound(v1, against, w1, radius, mass, parameters[own + zone[other]], draws)
                    v, w = between(after, v, wall), between(_rolling(against, after, radius), w, wall)
                    impacts += 1
                    if record >= IMPACTS:
                        write(rows, count, run, IMPACT, time, p, v, w, v1, w1, against, other)
                        count += 1
                    marked = False
                    rises = _dot(v, against)
                    if against[2] <= 0.0 or rises * rises >= 2.0 * gravity * against[2] * HOP * radius:
                        grounded = False
                    else:
                        v, n, place = _along(v, against), against, other
                    continue
                back = -gravity * factor * (n[2] - against[2] * _dot(against, n))
                if 2.0 * _dot(after, n) > -back * shortest:
                    turned, square, e, hit = after, _dot(after, after), against, other
                else:
                    blocked = True
            back = _dot(turned, against)
            if blocked or (back < 0.0 and angle_between(against, e) > FREE):
                blocked = True
                turned = _in_corner(turned, e if angle_between(against, e) > FREE else n, against)
            size = sqrt(_dot(turned, turned))
            if blocked:
                square = min(square, size * size)
            loss = 2.0 * factor * gravity * (way[2] + mu * max(cosine, 0.0) * ds)
            left = square - loss
            n, place, edge = e, hit, AT_ANOTHER if blocked else ON_TRIANGLE
            if speed < 1e-6:
                # From rest: what friction leaves of gravity along the ground, and along a wall that the block leans on.
                pulls = size - mu * (factor * gravity * cosine * dt + (-back if blocked else 0.0))
                if pulls <= 0.0:
                    end = STOPPED
                    break
                v = (turned[0] / size * pulls, turned[1] / size * pulls, turned[2] / size * pulls)
                p, time, length = away, time + dt, length + ds
            elif left <= 0.0 or size == 0.0:
                # It comes to rest within this step, where the energy is spent.
                part = min(max(square / loss, 0.0), 1.0) if loss > 0.0 and size > 0.0 else 0.0
                p = (p[0] + part * way[0], p[1] + part * way[1], p[2] + part * way[2])
                time += 2.0 * part * ds / speed
                length += part * ds
                v = zero
            else:
                now = sqrt(left)
                v = (turned[0] / size * now, turned[1] / size * now, turned[2] / size * now)
                time += 2.0 * ds / (speed + now)
                p, length = away, length + ds
                if drag > 0.0:
                    v = _dragged(v, factor * drag, ds)
        if len(stems) == PARTS:
            half = 0.5 * t if bent and part == 1.0 else 0.0
            middle = (p0[0] + half * v0[0], p0[1] + half * v0[1], p0[2] + half * v0[2])
            if half == 0.0:
                middle = (0.5 * (p0[0] + p[0]), 0.5 * (p0[1] + p[1]), 0.5 * (p0[2] + p[2]))
            struck, there, ahead = stem_on_way(stems, fallen, p0, middle, p, radius)
            if struck >= 0:
                way, goes_round = (there[0] - p0[0], there[1] - p0[1], there[2] - p0[2]), False
                if struck == stem_met and _dot(way, way) < (HELD * radius) ** 2:
                    goes_round, there, ahead = round_stem(stems[3], struck, p0, p, radius)
                    if not goes_round:
                        n, place, p, time, length = n0, place0, p0, time0, length0
                        v, w, end = zero, zero, STOPPED
                        break  # it leans on the stem
                    ahead = _on_ground(ahead, n)
                else:
                    n, place = n0, place0
                part, p, v, ds = _moved(p0, there, v0, ahead, factor * gravity, mu * max(cosine, 0.0))
                if drag > 0.0:
                    v = _dragged(v, factor * drag, part * ds)
                both = speed + sqrt(_dot(v, v))
                time = time0 + (2.0 * part * ds / both if both > 0.0 else 0.0)
                length, end, held, edge = length0 + part * ds, -1, 0, AT_ANOTHER
                w = _rolling(n, v, radius)
                v_max = max(v_max, sqrt(_dot(v, v)))
                if record == ALL or (record == IMPACTS and not marked):
                    write(rows, count, run, ON_GROUND, time, p, v, w, v, w, n, place)
                    count, marked = count + 1, True
                if not goes_round:
                    v1, w1 = v, w
                    v, w, away, stands = against_stem(stems[3], struck, p, v1, w1, radius, mass)
                    v, marked = _on_ground(v, n), False
                    if struck != stem_met and time - leant < SAME_MOMENT_S:
                        v = zero  # wedged between two stems
                    leant, stem_met, trees = time, struck, trees + 1
                    if not stands:
                        let_fall(fallen, stems[4][struck])
                    if record >= IMPACTS:
                        write(rows, count, run, TREE, time, p, v, w, v1, w1, away, stems[4][struck])
                        count += 1
                gone = (p[0] - anchor[0], p[1] - anchor[1], p[2] - anchor[2])
                lingers += 1
                if _dot(gone, gone) > (LINGERS * radius) ** 2:
                    anchor, lingers = p, 0
                if lingers > MOST_LEANT or (goes_round and part * ds < HELD * radius):
                    end = STOPPED
                continue
        w = _rolling(n, v, radius)
        v_max = max(v_max, sqrt(_dot(v, v)))
        if record == ALL or (record == IMPACTS and not marked):
            write(rows, count, run, ON_GROUND, time, p, v, w, came if moves else v, w, n, place)
            count, marked = count + 1, True
    if tumbles and not grounded:
        axes, w = turn(moments, axes, w, time - spun)
    if count + 2 >= rows.shape[0]:
        return count, NO_ROOM, time, impacts, length, v_max, trees
    write(rows, count, run, ENDED, time, p, v, w, v, w, n, place)
    return count + 1, end, time, impacts, length, v_max, trees


@kernel
def run_blocks(  # type: ignore[no-untyped-def]
    tree, facets, scale, zone, rebound, parameters, friction, own, draw_count, among, runs, seed, place, velocity, spin,
    radius, mass, inertia, moments, drag, gravity, law, most_impacts, most_s, record, stems, results, rows,
):  # fmt: skip
    """Simulate n blocks, `own` (n,) their sets; returns their records, in `rows` or in a longer array, and how many.

    Parameters
    ----------
    facets : see `facet_kernels`, with curvature and crease of k scales; scale : (n,) which of them is each block's.
    among : (n,) the place of each, which its records have; runs : (n,) its number.
    results : (n, 7) to be filled: end, time, impacts, length, v_max, hits of trees, records.
    """
    stack, times = np.empty(STACK_SIZE, np.int64), np.empty(STACK_SIZE)
    nearby = np.empty(MOST_NEAR, np.int64), np.empty((MOST_NEAR, 6)), np.empty(6)
    close = np.empty((2, MOST_CLOSE), np.int64), np.empty((3, MOST_CLOSE)), np.empty(KNOWN)
    draws, fallen, count = np.empty(draw_count), np.empty(1 + MOST_FALLEN, np.int64), np.int64(0)
    uniform = np.empty(3)
    for i in range(len(runs)):
        first, end = count, NO_ROOM
        about = facets[0], facets[1], facets[2], facets[3][scale[i]], facets[4][scale[i]], facets[5]
        while end == NO_ROOM:  # with longer records it begins again: to make them there costs all of it each turn
            count, end, time, impacts, length, v_max, trees = run_block(
                tree, about, zone, rebound, parameters, friction, own[i], draws, stack, times, nearby, close, rows,
                first, runs[i], seed, (place[i, 0], place[i, 1], place[i, 2]),
                (velocity[i, 0], velocity[i, 1], velocity[i, 2]),
                (spin[i, 0], spin[i, 1], spin[i, 2]), radius[i], mass[i], inertia[i],
                (moments[i, 0], moments[i, 1], moments[i, 2]), drag[i], gravity, law, most_impacts, most_s, record,
                stems, fallen, uniform,
            )  # fmt: skip
            if end == NO_ROOM:
                rows = grown(rows)
        rows[first:count, 0] = among[i]
        results[i, 0], results[i, 1], results[i, 2] = end, time, impacts
        results[i, 3], results[i, 4], results[i, 5], results[i, 6] = length, v_max, trees, count - first
    return rows, count
