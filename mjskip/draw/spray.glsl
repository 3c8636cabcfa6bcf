// Spray over a finished picture: drops as little discs, the sheet as triangles. Hidden by what is nearer.

#ifdef VERTEX
layout(location = 0) in vec4 place; // and for the sheet its opacity
layout(location = 1) in vec2 drop;  // radius [m] and opacity
uniform vec4 eye, ahead, right, up; // as in water.glsl's View; up.w is the height of the picture in pixels
out float far, opacity;
void main()
{
    vec3 to = place.xyz - eye.xyz;
    // what is under water is seen higher, by its index of refraction
    if (eye.w > 0.0 && place.z < 0.0) to.z = place.z / 1.333 - eye.z;
    far = dot(to, ahead.xyz);
    vec2 seen = vec2(dot(to, right.xyz) / dot(right.xyz, right.xyz), dot(to, up.xyz) / dot(up.xyz, up.xyz));
    gl_Position = vec4(seen.x + far * right.w, -seen.y, 0.0, far);
#ifdef DROPS
    float size = drop.x / far / length(up.xyz) * up.w; // of its diameter [pixels]
    gl_PointSize = clamp(size, 1.5, 24.0);
    opacity = drop.y * min(size / 1.5, 1.0) * (place.z < 0.0 ? 0.6 : 1.0);
#else
    opacity = place.w;
#endif
    // from below, what flies above the water is bent and broken by it: it is left out
    if (eye.w < 0.0 && place.z > 0.0) opacity = 0.0;
}
#else
uniform sampler2D distances;
uniform vec4 planes;               // as in water.glsl
uniform vec2 size;                 // of the picture [pixels]
in float far, opacity;
out vec4 colour;
void main()
{
    vec2 uv = gl_FragCoord.xy / size;
    float stored = texture(distances, vec2(uv.x, 1.0 - uv.y)).r;
    if (stored > 0.0 && 1.0 / (planes.x + stored * planes.y) < far) discard;
    float a = opacity;
#ifdef DROPS
    vec2 off = 2.0 * gl_PointCoord - 1.0;
    a *= clamp(1.5 - 1.5 * dot(off, off), 0.0, 1.0);
#endif
    colour = vec4(0.88, 0.93, 0.95, a);
}
#endif
