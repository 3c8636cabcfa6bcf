// Water over a picture of everything else, in two passes over the same rays.
//
//   LIGHT     half as many pixels each way, but in small pictures: where the surface is, how it leans, and Fresnel's mixture of what
//             is mirrored in it and seen through it. WAVES: with those of the field, else as still water. STANDING:
//             also what stands in it and reaches out, as the picture shows it. SHADE: shadows of what moves, MIRROR:
//             images of it, DIVE: what of it is under water. SUNK: the eye is under water.
//   PICTURE   every pixel: which of water and geom is nearer. STANDING: of waves, else of still water. Where it is known
//             without looking, SURE water, or a COPY of the rest.
//   DISTANCE  every pixel: how far the water is, for depth and segmentation.
//
// A processor that draws walks through both sides of every branch, so a picture is cut into tiles, and each is drawn
// by the program that has what it needs.
//
// Metres, world axes, z up, still water at z = 0. Rays are origin + t * direction with direction . forward = 1,
// so that t is the distance that a depth buffer holds.
//
//   Snell       n1 sin(a1) = n2 sin(a2)
//   Fresnel     R = (rs^2 + rp^2) / 2;  what is not reflected is refracted: T = 1 - R
//   Beer        light keeps exp(-absorption * length) of itself, the rest is the colour that water scatters
//   caustics    rays through x land at x + (1 - 1/n) depth grad(z): brightness 1 / |1 + (1 - 1/n) depth lap(z)|

const float INDEX = 1.333;     // of refraction of water
const float AWAY = 1e9;        // [m]: a distance that nothing is at
const float BLOCK = 16.0;      // cells a side of the blocks of which the greatest height is known
const float BLUNT = 0.1;       // square of the width of a focus, in units of unfocused light
const float FAR = 25.0;        // [m]: nothing is seen so far through water
const float BREATH = 2.56;     // [m] side of a tile of ripples
const float TEXEL = 0.01;      // [m] of it
const float SLOPE = 0.08;      // slopes that a tile of ripples can hold, from the least to the greatest
const float CURVED = 4.0;      // [1/m] and Laplacians
const int MOST = 32;           // bodies that move, as ellipsoids

layout(std140) uniform View {
    vec4 eye;        // position; +1 above the water, -1 below
    vec4 ahead;      // unit forward; 1 if rays are parallel (orthographic)
    vec4 right;      // scaled by the half width of what is seen a metre ahead; centre of the picture, in half widths
    vec4 up;         // scaled by the half height; width of a pixel of LIGHT a metre ahead [m]
    vec4 planes;     // 1 / far, 1 / near - 1 / far, near, far - near [m]
    vec4 field;      // offsets along x and y, and scales [1/m], of places in the texture of heights
    vec4 blocks;     // the same for the texture of their greatest
    vec4 cells;      // spacing, height of the deepest bottom [m]
    vec4 sun;        // unit, towards it; strength of the wind's ripples
    vec4 sunlight;   // its colour; share of the light on the bottom that comes straight from it
    vec4 absorption; // [1/m]; time [s]
    vec4 scattered;  // colour of deep water; 1 for linear colours, 0 for a tone curve
    vec4 ground;     // x, y of a corner of the map of the bottom, 1 / side, height of its camera
    vec4 depths;     // near, far - near of that camera [m], texel [m]
    vec4 place;      // where the surroundings were taken; 1 / far
    vec4 around;     // 1 / near - 1 / far of that camera; 1 if the model has a skybox; number of bodies
    vec4 bodies[4 * MOST]; // centre, reach; rows of the matrix that makes it a unit sphere, with its colour
};

uniform sampler2D picture;     // everything but the water
uniform sampler2D distances;   // its depth buffer: 1 near, 0 far
uniform sampler2D heights;     // [m], x along rows and y along columns
uniform sampler2D bends;       // Laplacians there [1/m]
uniform sampler2D tallest;     // [m], of the block and those around it
uniform sampler2D ripples;     // two slopes and the Laplacian
uniform sampler2D bottom;      // colours of what stands still under water, from above
uniform sampler2D soundings;   // its height [m]
uniform samplerCube scenery;   // colours of what stands still above water, all around
uniform samplerCube ranges;    // and how far it is
uniform sampler2D shape;       // LIGHT's height of the surface [m]
uniform sampler2D water;       // LIGHT's colours

in vec2 at;                    // 0 to 1 from the lower left corner of the picture

// The surface --------------------------------------------------------------------------------------

float height(vec2 p)
{
    return textureLod(heights, p.yx * field.wz + field.yx, 0.0).r;
}

float bend_at(vec2 p)
{
    return textureLod(bends, p.yx * field.wz + field.yx, 0.0).r;
}

// Greatest height or depth about a point.
float near_height(vec2 p)
{
    return textureLod(tallest, p.yx * blocks.wz + blocks.yx, 0.0).r;
}

// Where a ray meets the waves: marched through the layer that the waves near by fill, then the secant.
float strike(vec3 o, vec3 d)
{
    float t = -o.z / d.z;
#ifdef WAVES
    float per_metre = max(length(d.xy), 1e-6) / cells.x;
    float span = min(near_height(o.xy + t * d.xy) / abs(d.z), BLOCK / per_metre);
    int steps = clamp(int(2.0 * span * per_metre), 1, 16);
    float before = t - span, gap = o.z + before * d.z - height(o.xy + before * d.xy);
    for (int k = 1; k <= steps; ++k) {
        float now = t - span + 2.0 * span * float(k) / float(steps);
        float over = o.z + now * d.z - height(o.xy + now * d.xy);
        if (over * gap <= 0.0 || k == steps) {
            t = clamp(before - gap * (now - before) / (over - gap + 1e-12), before, now);
            break;
        }
        before = now;
        gap = over;
    }
#endif
    return t;
}

// Slopes as means over a pixel's footprint: a difference over its length is the mean slope along it.
vec2 slopes(vec3 p, vec2 along, float length_along, float length_across)
{
    float a = max(cells.x, length_along), b = max(cells.x, length_across);
    vec2 across = vec2(-along.y, along.x);
    return (height(p.xy + a * along) - p.z) / a * along + (height(p.xy + b * across) - p.z) / b * across;
}

// Slopes of a breath of wind, drawn only: two sheets of one tile drift over one another, the second turned by
// (cos, sin) = (0.8, 0.6) and larger.
vec2 wind(vec2 p, float width)
{
    float lod = log2(max(width / TEXEL, 1.0)), time = absorption.w;
    vec2 first = textureLod(ripples, p / BREATH + vec2(0.07, 0.03) * time, lod).rg - 0.5;
    vec2 turned = vec2(0.8 * p.x + 0.6 * p.y, 0.8 * p.y - 0.6 * p.x) / (1.37 * BREATH);
    vec2 second = textureLod(ripples, turned + vec2(-0.05, 0.04) * time, lod).rg - 0.5;
    return sun.w * SLOPE * (first + vec2(0.8 * second.x - 0.6 * second.y, 0.6 * second.x + 0.8 * second.y));
}

// Light --------------------------------------------------------------------------------------------

// Share that is reflected; ratio is n1 / n2, of the side that the light comes from over the other.
float fresnel(float cosine, float ratio)
{
    float sine2 = ratio * ratio * (1.0 - cosine * cosine);
    if (sine2 >= 1.0) return 1.0;
    float beyond = sqrt(1.0 - sine2);
    float s = (ratio * cosine - beyond) / (ratio * cosine + beyond);
    float p = (cosine - ratio * beyond) / (cosine + ratio * beyond);
    return 0.5 * (s * s + p * p);
}

// Brightness under a surface of this curvature. The sun's width blunts the focus; well beyond it light is even.
float caustic(float depth, float curvature)
{
    float bend = (1.0 - 1.0 / INDEX) * depth * curvature;
    float light = sqrt((1.0 + BLUNT) / ((1.0 + bend) * (1.0 + bend) + BLUNT));
    return 1.0 + (light - 1.0) * exp(-0.15 * bend * bend);
}

float glint(float toward, float variance)
{
    float spread = 4.0 * variance + 2.5e-4; // a slope turns the ray twice; the sun and its aureole
    float off = 2.0 * (1.0 - toward);
    return off > 12.0 * spread ? 0.0 : 2.2e-3 / spread * exp(-0.5 * off / spread);
}

// Where a ray meets body k, AWAY if it does not; near: how near it comes ahead, in squares of its semi-axes.
float meet(int k, vec3 o, vec3 d, out float near)
{
    vec4 body = bodies[4 * k];
    vec3 to = o - body.xyz;
    float along = dot(to, d), reach = 1.3 * body.w;
    near = AWAY;
    if (along > reach || dot(to, to) * dot(d, d) - along * along > reach * reach * dot(d, d)) return AWAY;
    mat3 unit = transpose(mat3(bodies[4 * k + 1].xyz, bodies[4 * k + 2].xyz, bodies[4 * k + 3].xyz));
    vec3 u = unit * to, v = unit * d;
    float a = dot(v, v), b = dot(u, v), c = dot(u, u);
    near = b < 0.0 ? c - b * b / a : c;
    if (near >= 1.0 || b >= 0.0) return AWAY;
    float t = (-b - sqrt(b * b - a * (c - 1.0))) / a;
    return t > 0.0 ? t : AWAY;
}

// Sunlight that bodies let pass to a point: soft, for the sun is no point and the water no pane. Side: +1 for what of
// them is above the water, -1 for what is under it.
float shadow(vec3 p, vec3 toward, float side)
{
    float light = 1.0;
#ifdef SHADE
    float near;
    for (int k = 0; k < int(around.z); ++k) {
        meet(k, p, toward, near);
        bool there = side * bodies[4 * k].z > -0.5 * bodies[4 * k].w;
        light *= there ? smoothstep(0.6, 1.6, near) : 1.0;
    }
#endif
    return light;
}

// The model ----------------------------------------------------------------------------------------

vec3 origin(vec2 uv)
{
    return eye.xyz + ahead.w * ((2.0 * uv.x - 1.0 - right.w) * right.xyz + (2.0 * uv.y - 1.0) * up.xyz);
}

vec3 direction(vec2 uv)
{
    return ahead.xyz + (1.0 - ahead.w) * ((2.0 * uv.x - 1.0 - right.w) * right.xyz + (2.0 * uv.y - 1.0) * up.xyz);
}

// How far ahead what the picture shows is.
float range(vec2 uv)
{
    float stored = textureLod(distances, uv, 0.0).r;
    if (stored <= 0.0) return AWAY;
    return ahead.w == 1.0 ? planes.z + (1.0 - stored) * planes.w : 1.0 / (planes.x + stored * planes.y);
}

// Where a point is seen, and how far ahead it is.
vec3 project(vec3 p)
{
    vec3 to = p - eye.xyz;
    float far = dot(to, ahead.xyz), scale = ahead.w == 1.0 ? 1.0 : far;
    vec2 place_seen = vec2(dot(to, right.xyz) / dot(right.xyz, right.xyz), dot(to, up.xyz) / dot(up.xyz, up.xyz)) / scale;
    return vec3(0.5 * (place_seen + vec2(right.w, 0.0)) + 0.5, far);
}

// A body that moves, along a ray: its picture where the camera sees the place that the ray meets, else an
// ellipsoid of its colour. The fourth part is the distance, AWAY if none is met.
vec4 moving(vec3 o, vec3 d, float reach)
{
    vec4 found = vec4(0.0, 0.0, 0.0, AWAY);
    float near;
    for (int k = 0; k < int(around.z); ++k) {
        float t = meet(k, o, d, near);
        if (near > 3.0) continue; // the corners of a box
        // march through the picture within the sphere about it
        float middle = dot(bodies[4 * k].xyz - o, d), half_length = bodies[4 * k].w;
        float step = half_length / 5.0;
        for (float s = max(middle - half_length, 0.0); s < middle + half_length; s += step) {
            vec3 seen = project(o + s * d);
            float shown = range(seen.xy), behind = seen.z - shown;
            vec3 point = origin(seen.xy) + shown * direction(seen.xy);
            if (behind > 0.0 && behind < 2.0 * step && distance(point, bodies[4 * k].xyz) < 1.1 * half_length) {
                if (s < min(found.w, reach)) found = vec4(textureLod(picture, seen.xy, 0.0).rgb, s);
                t = AWAY;
                break;
            }
        }
        if (t < min(found.w, reach)) {
            mat3 rows = mat3(bodies[4 * k + 1].xyz, bodies[4 * k + 2].xyz, bodies[4 * k + 3].xyz);
            vec3 normal = normalize(rows * (transpose(rows) * (o + t * d - bodies[4 * k].xyz)));
            // turned away from the camera: what it shows itself has been looked for above
            if (dot(normal, o + t * d - eye.xyz) > 0.0) {
                float light = 0.5 + 0.2 * normal.z + 0.6 * max(dot(normal, sun.xyz), 0.0);
                found = vec4(light * vec3(bodies[4 * k + 1].w, bodies[4 * k + 2].w, bodies[4 * k + 3].w), t);
            }
        }
    }
    return found;
}

vec3 sky(vec3 d)
{
    return mix(vec3(0.80, 0.87, 0.93), vec3(0.30, 0.52, 0.82), max(d.z, 0.0));
}

// What a ray above the water meets: bodies that move, the scenery that stands, the sky.
vec3 above(vec3 o, vec3 d)
{
#ifdef MIRROR
    vec4 body = moving(o, d, AWAY);
    if (body.w < AWAY) return body.rgb;
#endif
    vec3 look = d;
    float stored = 0.0;
    for (int k = 0; k < 2; ++k) {
        stored = textureLod(ranges, look, 0.0).r;
        if (stored <= 0.0) break;
        vec3 side = abs(look);
        float flat_range = 1.0 / (place.w + stored * around.x);
        look = o + d * (flat_range * length(look) / max(side.x, max(side.y, side.z))) - place.xyz;
    }
    vec3 colour = stored <= 0.0 && around.y == 0.0 ? sky(d) : textureLod(scenery, look, 0.0).rgb;
    float off = 1.0 - dot(d, sun.xyz);
    return colour + (off < 0.4 ? 0.35 * exp(-off / 0.05) : 0.0) * sunlight.rgb * (1.0 - scattered.w);
}

float sounding(vec2 p)
{
    return textureLod(soundings, (p - ground.xy) * ground.z, 0.0).r;
}

// Sunlight on the bottom over that under still water: caustics of waves and wind, shadows.
float light_at(vec3 q, float width)
{
    float k = inversesqrt(INDEX * INDEX - 1.0 + sun.z * sun.z); // (k x, k y, 1): the sun under water
    vec2 entry = q.xy - q.z * k * sun.xy;
    float bend = 1.4 * sun.w * CURVED * (textureLod(ripples, entry / BREATH + vec2(0.07, 0.03) * absorption.w,
                                                    log2(max(width / TEXEL, 1.0))).b - 0.5);
#ifdef WAVES
    bend += bend_at(entry);
#endif
    return caustic(max(-q.z, 0.0), bend) * shadow(vec3(entry, 0.0), sun.xyz, 1.0)
        * shadow(q, normalize(vec3(k * sun.xy, 1.0)), -1.0);
}

// What a ray under water meets, bodies that move, what stands in the water or the bottom; and how far away.
// Screen: how far ahead the picture shows something here, along the straight line.
vec3 below(vec3 o, vec3 d, float screen, float width, float lit)
{
    float floor_height = cells.y, span = AWAY;
    if (d.z < -1e-3)
        for (int k = 0; k < 2; ++k) {
            span = max((floor_height - o.z) / d.z, 0.0);
            if (span > FAR) break;
            floor_height = sounding(o.xy + span * d.xy);
        }
    vec4 body = vec4(0.0, 0.0, 0.0, AWAY);
#ifdef DIVE
    body = moving(o, d, span);
#endif
    vec3 colour = body.rgb;
    if (body.w < AWAY) {
        span = body.w;
    } else if (span < FAR) {
        vec3 q = o + span * d;
        colour = textureLod(bottom, (q.xy - ground.xy) * ground.z, floor(log2(max(width / depths.z, 1.0)) + 0.5)).rgb;
#ifdef STANDING
        {
            // a post, a wall, a bank: where the bent ray meets what the straight one sees, by steps along it
            float length_now = distance(origin(at) + screen * direction(at), o);
            vec3 seen, shown;
            for (int k = 0; k < 2; ++k) {
                seen = project(o + length_now * d);
                shown = origin(seen.xy) + range(seen.xy) * direction(seen.xy);
                length_now = clamp(dot(shown - o, d), 0.0, span);
            }
            // what lies on the bottom is on its map
            if (screen < AWAY && abs(range(seen.xy) - seen.z) < 0.03 * seen.z && shown.z > sounding(shown.xy) + 0.03
                && all(greaterThan(seen.xy, vec2(0.0))) && all(lessThan(seen.xy, vec2(1.0)))) {
                span = length_now;
                q = o + span * d;
                colour = textureLod(picture, seen.xy, 0.0).rgb;
            }
        }
#endif
        colour *= 1.0 + sunlight.w * (light_at(q, width) - 1.0);
    }
    vec3 deep = scattered.rgb * (0.35 + 0.65 * lit);
    vec3 kept = exp(-absorption.rgb * min(span, 1e3));
    return kept * colour + (1.0 - kept) * deep;
}

// The normal on the side of the eye; the far side of a wave is seen edge on: as much of it as leans to the eye.
vec3 normal_of(vec2 slope, vec3 d)
{
    vec3 n = eye.w * normalize(vec3(-slope, 1.0));
    float lean = 0.03 + dot(d, n);
    return lean > 0.0 ? normalize(n - lean * d) : n;
}

// Leaves the dark and the middle as they are, and bends highlights so that they do not burn out.
vec3 toned(vec3 c)
{
    return scattered.w == 1.0 ? c : min(c, 0.7) + 0.3 * (1.0 - exp(-max(c - 0.7, 0.0) / 0.3));
}

// Passes -------------------------------------------------------------------------------------------

#ifdef LIGHT
layout(location = 0) out vec4 out_shape;
layout(location = 1) out vec4 out_water;

void main()
{
    vec3 o = origin(at), ray = direction(at);
    bool dips = ray.z * eye.w < -1e-4;
    if (!dips) ray.z = -1e-4 * eye.w; // the horizon, so that what is between pixels has both its ends
    vec3 d = normalize(ray);
    float t = min(strike(o, ray), 1e4);
    vec3 p = o + t * ray;
    p.z = dips && t < 1e3 ? p.z : 0.0;
    float pixel = up.w * (ahead.w == 1.0 ? 1.0 : t), slant = max(abs(d.z), 0.02);
    float width = pixel * inversesqrt(slant);
    vec2 slope = wind(p.xy, width);
#ifdef WAVES
    slope += slopes(p, normalize(d.xy + 1e-9), pixel / slant, pixel);
#endif
    vec3 n = normal_of(slope, d), bent = refract(d, n, eye.w > 0.0 ? 1.0 / INDEX : INDEX), back = reflect(d, n);
    float lit = shadow(p, sun.xyz, 1.0), part = fresnel(-dot(d, n), eye.w > 0.0 ? 1.0 / INDEX : INDEX);
#ifdef SUNK
    bent = part < 1.0 ? normalize(vec3(bent.xy, max(bent.z, 0.01))) : vec3(0.0, 0.0, 1.0);
    vec3 through = above(p, bent);
    vec3 mirrored = below(p, normalize(vec3(back.xy, min(back.z, -0.01))), AWAY, width, 1.0);
#else
    float screen = AWAY;
#ifdef STANDING
    screen = range(at);
    if (screen < t) screen = AWAY;
#endif
    // a slope towards the sun takes in more of its light, which the water scatters
    vec3 through = below(p, bent, screen, width, lit * clamp(dot(n, sun.xyz) / sun.z, 0.2, 2.0));
    vec3 mirrored = above(p, normalize(vec3(back.xy, max(back.z, 0.01))));
#endif
    vec3 mixed = (1.0 - part) * through + part * mirrored;
#ifndef SUNK
    float variance = sun.w * sun.w * 7e-5 * clamp(log2(max(width / TEXEL, 1.0)), 0.0, 3.0);
    mixed += lit * part * (1.0 - scattered.w) * glint(dot(back, sun.xyz), variance) * sunlight.rgb;
#endif
    out_water = vec4(toned(mixed), 1.0);
    out_shape = vec4(p.z, 0.0, 0.0, 1.0);
}
#endif

#ifdef PICTURE
layout(location = 0) out vec4 colour;

void main()
{
    vec3 o = origin(at), ray = direction(at), c = textureLod(picture, at, 0.0).rgb;
    float h = 0.0;
#ifdef STANDING
    h = textureLod(shape, at, 0.0).r;
#endif
    float reach = range(at), t = ray.z * eye.w < -1e-6 ? (h - o.z) / ray.z : AWAY;
    // what is just above the water is wet, and darker; the bank goes on into the water as it is drawn
    float over = abs(o.z + reach * ray.z - h);
    c *= 1.0 - 0.35 * (1.0 - scattered.w) * (1.0 - min(over / 0.03, 1.0));
    float wet = t > 0.0 && t < reach ? min((reach - t) * abs(ray.z) / 0.02, 1.0) : 0.0;
    c = mix(c, textureLod(water, at, 0.0).rgb, wet);
#ifdef SUNK
    vec3 kept = exp(-absorption.rgb * min(min(t, reach) * length(ray), 1e3));
    c = kept * c + (1.0 - kept) * scattered.rgb;
#endif
    colour = vec4(c, 1.0);
}
#endif

#ifdef SURE
layout(location = 0) out vec4 colour;

void main()
{
    colour = textureLod(water, at, 0.0);
}
#endif

#ifdef COPY
layout(location = 0) out vec4 colour;

void main()
{
    colour = textureLod(picture, at, 0.0);
}
#endif

#ifdef DISTANCE
layout(location = 0) out vec4 far;

void main()
{
    vec3 o = origin(at), ray = direction(at);
    float t = AWAY, reach = range(at);
    if (ray.z * eye.w < -1e-6) t = strike(o, ray);
    far = vec4(t > 0.0 && t < reach ? t : -1.0, 0.0, 0.0, 1.0);
}
#endif

#ifdef RANGE
layout(location = 0) out vec4 found;

void main()
{
    found = vec4(textureLod(distances, at, 0.0).r, 0.0, 0.0, 1.0);
}
#endif

#ifdef SOUNDING
layout(location = 0) out vec4 found;

// From the depth buffer of parallel rays to heights.
void main()
{
    found = vec4(ground.w - depths.x - (1.0 - textureLod(distances, at, 0.0).r) * depths.y, 0.0, 0.0, 1.0);
}
#endif
