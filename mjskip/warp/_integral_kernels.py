"""Loads of laws that are integrated over faces: what `mjskip.hydro._integral_kernels` and `_strip_kernels` do, for Warp.

In body axes about the centre of mass the normal speed over a plane face is v = V.n + (n x omega).r, and

    integral of (a v^2 + b U v + c U^2 + e U^2 pi v / (4 U + pi |v|)) {1, r} dA

has a closed form over a triangle. With `quadrature` it is taken over the wet part of every triangle. A law that acts
`forward` takes the wet part of a plane face as strips along the motion, each squeezed to its front part of length
(1 - 2 x / l) l with Rayleigh's x / l = 3/4 cos(theta) / (4 + pi sin(theta)).
"""

import math

import warp as wp

from mjskip.warp._kernels import Motion, WetBody, motion_of, ordered

wp.set_module_options({"enable_backward": False})  # its loops would have wrong adjoints

PI = wp.constant(math.pi)
FAR = wp.constant(1.0e30)


@wp.struct
class FaceLaw:
    """A law that is integrated over the faces of a wet body."""

    wet: int  # the body's number among the wet ones; -1: its law is taken at centroids
    forward: int
    local: int  # gate: 1 what advances, 0 faces turned to the motion of the centre
    squared: float  # rho times the law's coefficients
    mixed: float
    plain: float
    friction: float
    cavity: float
    first: int  # of its plane faces, if it acts forward
    count: int


@wp.struct
class PlaneFace:
    """A plane face and where the edges of its outline stand."""

    normal: wp.vec3
    distance: float  # from the centre of mass
    first: int
    count: int


@wp.struct
class Load:
    """Integrals over an area: of the load and of r times it; of the loaded area and of r over that."""

    load: float
    moment: wp.vec3
    area: float
    place: wp.vec3


@wp.struct
class Part:
    """A polygon of three or four points, or of none."""

    count: int
    a: wp.vec3
    b: wp.vec3
    c: wp.vec3
    d: wp.vec3


@wp.func
def part_below(a0: wp.vec3, ha0: float, b0: wp.vec3, hb0: float, c0: wp.vec3, hc0: float) -> Part:
    """The part of a triangle on which h, linear over it, is negative."""
    turned = ordered(a0, ha0, b0, hb0, c0, hc0)
    a, b, c = turned.a, turned.b, turned.c
    ha, hb, hc = turned.ha, turned.hb, turned.hc
    out = Part()
    below = turned.below
    if below == 3:
        out.count = 3
        out.a = a
        out.b = b
        out.c = c
    elif below > 0:
        odd = below == 1
        p = c + hc / (hc - ha) * (a - c)
        q = b + hb / (hb - ha) * (a - b)
        if odd:
            out.count = 3
            out.a = a
            out.b = q
            out.c = p
        else:
            out.count = 4
            out.a = b
            out.b = c
            out.c = p
            out.d = q
    return out


@wp.func
def levels(x: float) -> wp.vec2:
    """Integrals of l / (1 + x l) and of l^2 / (1 + x l) from 0 to 1, x > -1."""
    one = float(0.0)
    two = float(0.0)
    if wp.abs(x) < 0.4:  # the closed forms cancel: their series
        power = float(1.0)
        for n in range(20):
            one += power / float(n + 2)
            two += power / float(n + 3)
            power *= -x
    else:
        log = wp.log(1.0 + x)
        one = (x - log) / (x * x)
        two = (0.5 * x * x - x + log) / (x * x * x)
    return wp.vec2(one, two)


@wp.func
def cavity_shares(q0: float, q1: float, q2: float) -> wp.vec3:
    """Integrals of pi q / (4 + pi q) times each barycentric coordinate, over the area; q >= 0.

    See `mjskip.hydro._integral_kernels._cavity_shares`.
    """
    c = 4.0 / PI
    third = 1.0 / 3.0
    w0 = q0 + c
    w1 = q1 + c
    w2 = q2 + c
    low = wp.min(w0, wp.min(w1, w2))
    high = wp.max(w0, wp.max(w1, w2))
    out = wp.vec3(third * (1.0 - c / w0), third * (1.0 - c / w0), third * (1.0 - c / w0))
    if high - low >= 1.0e-6 * high:
        i = wp.where(w0 <= w1 and w0 <= w2, 0, wp.where(w1 <= w2, 1, 2))
        k = wp.where(w2 >= w0 and w2 >= w1, 2, wp.where(w1 >= w0, 1, 0))
        middle = wp.max(wp.min(w0, w1), wp.min(wp.max(w0, w1), w2))
        t = (middle - low) / (high - low)
        # below the level of the middle corner, and above it
        under = levels((middle - low) / low)
        over = levels((middle - high) / high)
        f = 2.0 * c * t / low
        g = 2.0 * c * (1.0 - t) / high
        at_low = third - f * (under[0] - under[1] + 0.5 * under[1] * (1.0 - t))
        at_low -= g * 0.5 * over[1] * (1.0 - t)
        at_middle = third - f * 0.5 * under[1] - g * 0.5 * over[1]
        at_high = third - f * 0.5 * under[1] * t
        at_high -= g * (over[0] - over[1] + 0.5 * over[1] * t)
        out = wp.vec3(
            wp.where(i == 0, at_low, wp.where(k == 0, at_high, at_middle)),
            wp.where(i == 1, at_low, wp.where(k == 1, at_high, at_middle)),
            wp.where(i == 2, at_low, wp.where(k == 2, at_high, at_middle)),
        )
    return out


@wp.func
def share_of_square(v: float, total: float, squares: float) -> float:
    """Integral of v^2 times the barycentric coordinate of the corner with this v, over the area."""
    others = total - v
    rest = squares - v * v
    return v * v / 10.0 + v * others / 15.0 + rest / 30.0 + (others * others - rest) / 60.0


@wp.func
def over_triangle(
    law: FaceLaw, speed: float, weight: float,
    a: wp.vec3, va: float, b: wp.vec3, vb: float, c: wp.vec3, vc: float,
) -> Load:  # fmt: skip
    """Integrals over a triangle whose corners have these normal speeds, times a weight."""
    area = 0.5 * weight * wp.length(wp.cross(b - a, c - a))
    total = va + vb + vc
    squares = va * va + vb * vb + vc * vc
    mixed = law.mixed * speed / 12.0
    plain = law.plain * speed * speed / 3.0
    p = wp.vec3(
        law.squared * share_of_square(va, total, squares) + mixed * (total + va) + plain,
        law.squared * share_of_square(vb, total, squares) + mixed * (total + vb) + plain,
        law.squared * share_of_square(vc, total, squares) + mixed * (total + vc) + plain,
    )
    if law.cavity != 0.0 and speed > 0.0:
        p += law.cavity * speed * speed * cavity_shares(va / speed, vb / speed, vc / speed)
    out = Load()
    out.load = area * (p[0] + p[1] + p[2])
    out.moment = area * (p[0] * a + p[1] * b + p[2] * c)
    out.area = area
    out.place = area / 3.0 * (a + b + c)
    return out


@wp.func
def joined(one: Load, other: Load) -> Load:
    out = Load()
    out.load = one.load + other.load
    out.moment = one.moment + other.moment
    out.area = one.area + other.area
    out.place = one.place + other.place
    return out


@wp.func
def over_part(
    law: FaceLaw, speed: float, weight: float, sign: float, vn: float, g: wp.vec3, part: Part
) -> Load:
    """Integrals over a polygon with the normal speed sign (vn + g.r), which is nowhere negative if it has a cavity."""
    out = Load()
    if part.count > 0:
        va = wp.max(sign * (vn + wp.dot(g, part.a)), wp.where(law.cavity != 0.0, 0.0, -FAR))
        vb = wp.max(sign * (vn + wp.dot(g, part.b)), wp.where(law.cavity != 0.0, 0.0, -FAR))
        vc = wp.max(sign * (vn + wp.dot(g, part.c)), wp.where(law.cavity != 0.0, 0.0, -FAR))
        out = over_triangle(law, speed, weight, part.a, va, part.b, vb, part.c, vc)
        if part.count == 4:
            vd = wp.max(sign * (vn + wp.dot(g, part.d)), wp.where(law.cavity != 0.0, 0.0, -FAR))
            out = joined(out, over_triangle(law, speed, weight, part.a, va, part.c, vc, part.d, vd))
    return out


@wp.func
def over_gated(
    law: FaceLaw, speed: float, weight: float, vn: float, g: wp.vec3,
    a: wp.vec3, b: wp.vec3, c: wp.vec3,
) -> Load:  # fmt: skip
    """Integrals over the loaded part of a triangle, v = vn + g.r; a cavity's load is odd in v."""
    va = vn + wp.dot(g, a)
    vb = vn + wp.dot(g, b)
    vc = vn + wp.dot(g, c)
    out = Load()
    if (va > 0.0 and vb > 0.0 and vc > 0.0) or (law.local == 0 and law.cavity == 0.0):
        out = over_triangle(law, speed, weight, a, va, b, vb, c, vc)
    else:
        out = over_part(law, speed, weight, 1.0, vn, g, part_below(a, -va, b, -vb, c, -vc))
        if law.local == 0:
            receding = part_below(a, va, b, vb, c, vc)
            out = joined(out, over_part(law, speed, -weight, -1.0, vn, g, receding))
    return out


@wp.func
def turned(law: FaceLaw, velocity: wp.vec3, n: wp.vec3, found: Load) -> wp.spatial_vector:
    """Torque and force of a face: F = -load n, and friction along the motion on the loaded area."""
    force = -found.load * n
    torque = -wp.cross(found.moment, n)
    if law.friction != 0.0 and found.area > 0.0:
        along = velocity - wp.dot(velocity, n) * n
        length = wp.length(along)
        if length > 0.0:
            pull = -law.friction * wp.dot(velocity, velocity) / length * along
            force += found.area * pull
            torque += wp.cross(found.place, pull)
    return wp.spatial_vector(torque, force)


@wp.func
def append(
    segments: wp.array[wp.vec4], found: int, x0: float, y0: float, x1: float, y1: float
) -> int:
    """Append a segment (y, x of its lower end, y, x of its upper end) unless it lies along the motion; how many."""
    count = found
    if y0 < y1:
        segments[count] = wp.vec4(y0, x0, y1, x1)
        count += 1
    elif y1 < y0:
        segments[count] = wp.vec4(y1, x1, y0, x0)
        count += 1
    return count


@wp.func
def wet_outline(
    plane: PlaneFace, edge_a: wp.array[wp.vec3], edge_b: wp.array[wp.vec3],
    z: float, up: wp.vec3, t: wp.vec3, s: wp.vec3,
    segments: wp.array[wp.vec4], crossings: wp.array[wp.vec3],
) -> int:  # fmt: skip
    """Outline of the part of a plane face that is under water, as segments; how many there are."""
    found = int(0)
    crossed = int(0)
    lx = -wp.dot(up, s)  # along the waterline: across the slope of the face
    ly = wp.dot(up, t)
    for i in range(plane.count):
        a = edge_a[plane.first + i]
        b = edge_b[plane.first + i]
        ha = z + wp.dot(up, a)
        hb = z + wp.dot(up, b)
        if ha < 0.0 or hb < 0.0:
            x0 = wp.dot(a, t)
            y0 = wp.dot(a, s)
            x1 = wp.dot(b, t)
            y1 = wp.dot(b, s)
            if ha >= 0.0 or hb >= 0.0:
                w = ha / (ha - hb)
                x = x0 + w * (x1 - x0)
                y = y0 + w * (y1 - y0)
                if ha >= 0.0:
                    x0 = x
                    y0 = y
                else:
                    x1 = x
                    y1 = y
                # into the row of crossings, in order along the waterline
                place = lx * x + ly * y
                j = int(crossed)
                while j > 0:
                    if crossings[j - 1][0] <= place:
                        break
                    crossings[j] = crossings[j - 1]
                    j -= 1
                crossings[j] = wp.vec3(place, x, y)
                crossed += 1
            found = append(segments, found, x0, y0, x1, y1)
    for i in range(crossed // 2):
        one = crossings[2 * i]
        two = crossings[2 * i + 1]
        found = append(segments, found, one[1], one[2], two[1], two[2])
    return found


@wp.func
def place_at(segment: wp.vec4, y: float) -> float:
    """x of a segment at y; its own end at its upper end."""
    x = segment[1] + (y - segment[0]) / (segment[2] - segment[0]) * (segment[3] - segment[1])
    return wp.where(y >= segment[2], segment[3], x)


@wp.func
def over_strips(
    law: FaceLaw, speed: float, front: float, vn: float, g: wp.vec3,
    t: wp.vec3, s: wp.vec3, offset: wp.vec3, segments: wp.array[wp.vec4], count: int,
) -> Load:  # fmt: skip
    """Integrals over the strips between the segments, squeezed to their front parts.

    Between two places across the motion at which segments begin or end, those that are met bound the strips in pairs,
    in the order of x.
    """
    out = Load()
    y = float(FAR)
    for i in range(count):
        y = wp.min(y, segments[i][0])
    while y < FAR:
        top = float(FAR)
        for i in range(count):
            top = wp.min(top, wp.where(segments[i][0] > y, segments[i][0], FAR))
            top = wp.min(top, wp.where(segments[i][2] > y, segments[i][2], FAR))
        if top == FAR:
            break
        middle = 0.5 * (y + top)
        for i in range(count):
            back = segments[i]
            if back[0] <= y and back[2] > y:
                # how many segments lie behind this one, and which is the next ahead
                x = place_at(back, middle)
                behind = int(0)
                following = int(-1)
                nearest = float(FAR)
                for j in range(count):
                    other = segments[j]
                    if j != i and other[0] <= y and other[2] > y:
                        x_other = place_at(other, middle)
                        if x_other < x or (x_other == x and j < i):
                            behind += 1
                        elif x_other < nearest:
                            nearest = x_other
                            following = j
                if behind % 2 == 0 and following >= 0:
                    ahead = segments[following]
                    x1 = place_at(ahead, y)
                    x0 = x1 - front * (x1 - place_at(back, y))
                    x3 = place_at(ahead, top)
                    x2 = x3 - front * (x3 - place_at(back, top))
                    a = offset + x0 * t + y * s
                    b = offset + x1 * t + y * s
                    c = offset + x3 * t + top * s
                    d = offset + x2 * t + top * s
                    out = joined(out, over_gated(law, speed, 1.0 / front, vn, g, a, b, c))
                    out = joined(out, over_gated(law, speed, 1.0 / front, vn, g, a, c, d))
        y = top
    return out


@wp.func
def load_on_plane(
    law: FaceLaw, plane: PlaneFace, motion: Motion,
    edge_a: wp.array[wp.vec3], edge_b: wp.array[wp.vec3],
    segments: wp.array[wp.vec4], crossings: wp.array[wp.vec3],
) -> wp.spatial_vector:  # fmt: skip
    """Torque and force on a plane face by a law that acts forward."""
    n = plane.normal
    velocity = motion.velocity
    speed = wp.length(velocity)
    vn = wp.dot(velocity, n)
    out = wp.spatial_vector()
    if law.local == 1 or vn >= 0.0:
        # axes of the face: t along the motion, or any where there is none along it; s = n x t
        t = velocity - vn * n
        along = wp.length(t)
        shift = 0.75 * along / wp.max(4.0 * speed + PI * wp.abs(vn), 1.0e-30)
        if along <= 1.0e-6 * speed or along == 0.0:
            t = wp.vec3(n[1] - n[2], n[2] - n[0], n[0] - n[1])
            if wp.dot(t, t) < 0.1:
                t = wp.vec3(n[1], -n[0], 0.0)
        t = wp.normalize(t)
        s = wp.cross(n, t)
        count = wet_outline(
            plane, edge_a, edge_b, motion.height, motion.up, t, s, segments, crossings
        )
        if count >= 2:
            found = over_strips(
                law, speed, 1.0 - 2.0 * shift, vn, wp.cross(n, motion.omega), t, s,
                plane.distance * n, segments, count,
            )  # fmt: skip
            out = turned(law, velocity, n, found)
    return out


@wp.func
def load_on_triangle(
    law: FaceLaw, motion: Motion, n: wp.vec3, a: wp.vec3, b: wp.vec3, c: wp.vec3
) -> wp.spatial_vector:
    """Torque and force on the wet part of a triangle."""
    ha = motion.height + wp.dot(motion.up, a)
    hb = motion.height + wp.dot(motion.up, b)
    hc = motion.height + wp.dot(motion.up, c)
    vn = wp.dot(motion.velocity, n)
    out = wp.spatial_vector()
    if (ha < 0.0 or hb < 0.0 or hc < 0.0) and (law.local == 1 or vn >= 0.0):
        speed = wp.length(motion.velocity)
        g = wp.cross(n, motion.omega)
        part = part_below(a, ha, b, hb, c, hc)
        found = over_gated(law, speed, 1.0, vn, g, part.a, part.b, part.c)
        if part.count == 4:
            more = over_gated(law, speed, 1.0, vn, g, part.a, part.c, part.d)
            found = joined(found, more)
        out = turned(law, motion.velocity, n, found)
    return out


@wp.kernel
def add_face_laws(
    # bodies, triangles and plane faces
    laws: wp.array[FaceLaw],
    bodies: wp.array[WetBody],
    corner_a: wp.array[wp.vec3],
    corner_b: wp.array[wp.vec3],
    corner_c: wp.array[wp.vec3],
    normals: wp.array[wp.vec3],
    planes: wp.array[PlaneFace],
    edge_a: wp.array[wp.vec3],
    edge_b: wp.array[wp.vec3],
    body_rootid: wp.array[int],
    # worlds
    xpos: wp.array2d[wp.vec3],
    xmat: wp.array2d[wp.mat33],
    cvel: wp.array2d[wp.spatial_vector],
    subtree_com: wp.array2d[wp.vec3],
    # scratch
    segments: wp.array3d[wp.vec4],
    crossings: wp.array3d[wp.vec3],
    # out
    force: wp.array2d[wp.vec3],
    torque: wp.array2d[wp.vec3],
):
    """Add the loads of laws that are integrated over faces, world axes, about the centres of mass."""
    world, k = wp.tid()
    law = laws[k]
    wet = bodies[law.wet]
    motion = motion_of(wet, world, body_rootid, xpos, xmat, cvel, subtree_com)
    total = wp.spatial_vector()
    if motion.height <= wet.radius * 1.00001:
        if law.forward == 1:
            for j in range(law.count):
                total += load_on_plane(
                    law, planes[law.first + j], motion, edge_a, edge_b,
                    segments[world, k], crossings[world, k],
                )  # fmt: skip
        else:
            for j in range(wet.count):
                i = wet.first + j
                total += load_on_triangle(
                    law, motion, normals[i], corner_a[i], corner_b[i], corner_c[i]
                )
    force[world, law.wet] += motion.turn * wp.spatial_bottom(total)
    torque[world, law.wet] += motion.turn * wp.spatial_top(total)
