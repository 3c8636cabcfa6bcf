"""Water and air on the bodies of many worlds, in single precision: what `mjskip.hydro` does, for Warp.

One thread works out one body of one world; a second kernel takes the wrenches to the degrees of freedom, in the order of
the bodies, so that results do not depend on how threads are scheduled.

Everything is worked out in body axes about the centre of mass, where the mesh is constant and still water is a tilted
plane: h = z + u.r is the height of r above the surface, u the vertical.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})  # its loops would have wrong adjoints


@wp.struct
class WetBody:
    """What water and air know a body by; see `mjskip.hydro.wrench.pack`."""

    body: int
    centre: wp.vec3  # of mass of it and what is welded to it, in its frame
    first: int  # of its triangles
    count: int
    radius: float
    local: int  # gate: 1 faces that advance, 0 faces turned to the motion of the centre
    squared: float  # rho times the law's coefficients
    mixed: float
    plain: float
    friction: float
    weight: float  # rho if the water bears, or 0
    skin: float  # rho if the water rubs, or 0
    viscosity: float
    length: float
    air: float  # rho of the air times the disc's area
    disc_normal: wp.vec3
    disc_centre: wp.vec3


@wp.struct
class Motion:
    """Pose and motion of a wet body: turn to the world; height of its centre of mass, vertical, velocity and angular
    velocity in its own axes."""

    turn: wp.mat33
    height: float
    up: wp.vec3
    velocity: wp.vec3
    omega: wp.vec3


@wp.struct
class Wet:
    """Immersed part of a triangle: its share of the area and its centroid."""

    share: float
    centre: wp.vec3


@wp.struct
class Column:
    """Integrals of h and of r h over the immersed part of a triangle of unit area."""

    height: float
    moment: wp.vec3


@wp.struct
class Corners:
    """Corners of a triangle and their heights; of one that the surface cuts, the only wet or the only dry one is a."""

    below: int  # how many are under the surface
    a: wp.vec3
    b: wp.vec3
    c: wp.vec3
    ha: float
    hb: float
    hc: float


@wp.func
def ordered(a0: wp.vec3, ha0: float, b0: wp.vec3, hb0: float, c0: wp.vec3, hc0: float) -> Corners:
    """Corners in the order that `Corners` asks for."""
    a, b, c = a0, b0, c0
    ha, hb, hc = ha0, hb0, hc0
    below = wp.where(ha < 0.0, 1, 0) + wp.where(hb < 0.0, 1, 0) + wp.where(hc < 0.0, 1, 0)
    if below == 1 or below == 2:
        odd = below == 1
        if (hb < 0.0) == odd:
            a, b, c = b0, c0, a0
            ha, hb, hc = hb0, hc0, ha0
        elif (hc < 0.0) == odd:
            a, b, c = c0, a0, b0
            ha, hb, hc = hc0, ha0, hb0
    out = Corners()
    out.below = below
    out.a = a
    out.b = b
    out.c = c
    out.ha = ha
    out.hb = hb
    out.hc = hc
    return out


@wp.func
def immersed_part(a0: wp.vec3, ha0: float, b0: wp.vec3, hb0: float, c0: wp.vec3, hc0: float) -> Wet:
    """A quadrangle is taken as two triangles with positive weights, so that nothing cancels."""
    turned = ordered(a0, ha0, b0, hb0, c0, hc0)
    a, b, c = turned.a, turned.b, turned.c
    ha, hb, hc = turned.ha, turned.hb, turned.hc
    out = Wet()
    below = turned.below
    if below == 3:
        out.share = 1.0
        out.centre = (a + b + c) / 3.0
    elif below > 0:
        odd = below == 1
        if odd:  # the triangle a, a + s (b - a), a + t (c - a)
            s = ha / (ha - hb)
            t = ha / (ha - hc)
            out.share = s * t
            out.centre = a + (s * (b - a) + t * (c - a)) / 3.0
        else:  # the quadrangle b, c, p on ca, q on ab
            u = hc / (hc - ha)
            w = hb / (hb - ha)
            p = c + u * (a - c)
            q = b + w * (a - b)
            second = (1.0 - u) * w
            out.share = u + second
            if out.share > 0.0:
                out.centre = (u * (b + c + p) + second * (b + p + q)) / (3.0 * out.share)
    return out


@wp.func
def linear_column(
    a: wp.vec3, ha: float, b: wp.vec3, hb: float, c: wp.vec3, hc: float, area: float
) -> Column:
    """Over a triangle of this area on which h is linear."""
    total = ha + hb + hc
    out = Column()
    out.height = area / 3.0 * total
    out.moment = area / 12.0 * ((a + b + c) * total + a * ha + b * hb + c * hc)
    return out


@wp.func
def column(a0: wp.vec3, ha0: float, b0: wp.vec3, hb0: float, c0: wp.vec3, hc0: float) -> Column:
    """The water over the immersed part of a triangle, see `immersed_part`."""
    turned = ordered(a0, ha0, b0, hb0, c0, hc0)
    a, b, c = turned.a, turned.b, turned.c
    ha, hb, hc = turned.ha, turned.hb, turned.hc
    out = Column()
    below = turned.below
    if below == 3:
        out = linear_column(a, ha, b, hb, c, hc, 1.0)
    elif below > 0:
        odd = below == 1
        u = hc / (hc - ha)
        w = hb / (hb - ha)
        p = c + u * (a - c)
        q = b + w * (a - b)
        if odd:
            out = linear_column(a, ha, q, 0.0, p, 0.0, (1.0 - u) * (1.0 - w))
        else:
            one = linear_column(b, hb, c, hc, p, 0.0, u)
            two = linear_column(b, hb, p, 0.0, q, 0.0, (1.0 - u) * w)
            out.height = one.height + two.height
            out.moment = one.moment + two.moment
    return out


@wp.func
def motion_of(
    wet: WetBody, world: int, body_rootid: wp.array[int],
    xpos: wp.array2d[wp.vec3], xmat: wp.array2d[wp.mat33],
    cvel: wp.array2d[wp.spatial_vector], subtree_com: wp.array2d[wp.vec3],
) -> Motion:  # fmt: skip
    """How a body moves in a world: MuJoCo keeps velocities about the centre of mass of the whole tree."""
    body = wet.body
    turn = xmat[world, body]
    place = xpos[world, body] + turn * wet.centre
    motion = cvel[world, body]
    spin = wp.spatial_top(motion)
    centre_velocity = wp.spatial_bottom(motion) + wp.cross(
        spin, place - subtree_com[world, body_rootid[body]]
    )
    back = wp.transpose(turn)
    out = Motion()
    out.turn = turn
    out.height = place[2]
    out.up = wp.vec3(turn[2, 0], turn[2, 1], turn[2, 2])
    out.velocity = back * centre_velocity
    out.omega = back * spin
    return out


# Over 80 lines: Warp's functions return few values, so that the sums over faces stay where they are made.
@wp.kernel
def wet_wrench(
    # bodies and triangles
    bodies: wp.array[WetBody],
    corner_a: wp.array[wp.vec3],
    corner_b: wp.array[wp.vec3],
    corner_c: wp.array[wp.vec3],
    normals: wp.array[wp.vec3],
    areas: wp.array[float],
    body_rootid: wp.array[int],
    # worlds
    gravity: wp.array[wp.vec3],
    xpos: wp.array2d[wp.vec3],
    xmat: wp.array2d[wp.mat33],
    cvel: wp.array2d[wp.spatial_vector],
    subtree_com: wp.array2d[wp.vec3],
    # out
    force: wp.array2d[wp.vec3],
    torque: wp.array2d[wp.vec3],
    wetted_area: wp.array2d[float],
):
    """Force and torque of water and air about the centre of mass, world axes, and the wetted area.

    F_i = -S_im [ (a (V.n)^2 + b U (V.n) + c U^2) n + d U^2 t ],  tau_i = r_i x F_i
    dF  = rho g h n dS,  F_skin = -1/2 rho C_f |V_t| V_t S,  F_air = -rho_air (V.n) |V.n| S_disc n
    """
    world, k = wp.tid()
    wet = bodies[k]
    motion = motion_of(wet, world, body_rootid, xpos, xmat, cvel, subtree_com)
    turn = motion.turn
    velocity = motion.velocity
    omega = motion.omega
    up = motion.up
    z = motion.height

    # air, on the disc
    vn = wp.dot(velocity + wp.cross(omega, wet.disc_centre), wet.disc_normal)
    f = -wet.air * vn * wp.abs(vn) * wet.disc_normal
    t = wp.cross(wet.disc_centre, f)
    area_total = float(0.0)

    # water, on the mesh
    if z <= wet.radius * 1.00001:  # in single precision it may reach a little farther
        speed2 = wp.dot(velocity, velocity)
        speed = wp.sqrt(speed2)
        fall = -gravity[world % gravity.shape[0]][2]
        for j in range(wet.count):
            i = wet.first + j
            a = corner_a[i]
            b = corner_b[i]
            c = corner_c[i]
            ha = z + wp.dot(up, a)
            hb = z + wp.dot(up, b)
            hc = z + wp.dot(up, c)
            if ha < 0.0 or hb < 0.0 or hc < 0.0:
                n = normals[i]
                part = immersed_part(a, ha, b, hb, c, hc)
                area = part.share * areas[i]
                area_total += area
                r = part.centre

                # the law's load
                vn_centre = wp.dot(velocity, n)
                vn = vn_centre + wp.dot(wp.cross(omega, r), n)
                loaded = vn_centre >= 0.0
                if wet.local == 1:
                    loaded = vn > 0.0
                if loaded:
                    load = (
                        -area
                        * (wet.squared * vn * vn + wet.mixed * speed * vn + wet.plain * speed2)
                        * n
                    )
                    if wet.friction != 0.0:
                        along = velocity - vn_centre * n
                        length = wp.length(along)
                        if length > 0.0:
                            load -= area * wet.friction * speed2 / length * along
                    f += load
                    t += wp.cross(r, load)

                # hydrostatic pressure
                if wet.weight != 0.0:
                    water = column(a, ha, b, hb, c, hc)
                    weight = wet.weight * fall * areas[i]
                    f += weight * water.height * n
                    t += weight * wp.cross(water.moment, n)

                # skin friction
                if wet.skin != 0.0:
                    slip = velocity + wp.cross(omega, r)
                    slip -= wp.dot(slip, n) * n
                    rate = wp.length(slip)
                    reynolds = wp.max(rate * wet.length / wet.viscosity, 1000.0)
                    root = wp.log10(reynolds) - 2.0
                    rub = -0.5 * wet.skin * 0.075 / (root * root) * rate * area * slip
                    f += rub
                    t += wp.cross(r, rub)

    force[world, k] = turn * f
    torque[world, k] = turn * t
    wetted_area[world, k] = area_total


@wp.kernel
def add_to_passive(
    # bodies
    bodies: wp.array[WetBody],
    moves: wp.array2d[int],
    body_rootid: wp.array[int],
    # worlds
    xpos: wp.array2d[wp.vec3],
    xmat: wp.array2d[wp.mat33],
    subtree_com: wp.array2d[wp.vec3],
    cdof: wp.array2d[wp.spatial_vector],
    force: wp.array2d[wp.vec3],
    torque: wp.array2d[wp.vec3],
    # out
    qfrc_passive: wp.array2d[float],
):
    """qfrc_passive += J'w; moves[dof, k] says whether a degree of freedom moves wet body k."""
    world, dof = wp.tid()
    axis = cdof[world, dof]
    total = float(0.0)
    for k in range(bodies.shape[0]):
        if moves[dof, k] == 1:
            body = bodies[k].body
            place = xpos[world, body] + xmat[world, body] * bodies[k].centre
            arm = place - subtree_com[world, body_rootid[body]]
            about = torque[world, k] + wp.cross(arm, force[world, k])
            total += wp.dot(wp.spatial_top(axis), about)
            total += wp.dot(wp.spatial_bottom(axis), force[world, k])
    qfrc_passive[world, dof] += total
