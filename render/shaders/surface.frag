// The surface's shade, with the triangles' edges drawn over it (WIREFRAME). DISPLAY: for displays, opaque
// and, with ENCODE_SRGB, encoded here because the framebuffer does not do it. CUT_OUT: only where texels are there; BLENDS:
// by shares of the samples that are their alpha. RELIEF: lit by the normals of a normal map. EMISSION: with light of its own.
// DEPTH: no colours. SHARE: instead of it, which share of its light shadows leave it.
#ifdef FLAT
layout(location = 0) flat in vec4 surface_shade;
#else
layout(location = 0) in vec4 surface_shade;
#endif
#ifdef WIREFRAME
layout(location = 1) in vec3 corner_weights;
#endif

layout(location = 0) out vec4 pixel; // linear RGB; relative luminance in a

#ifdef MASK
layout(location = 1) out vec4 mask; // how much of each light that casts shadows comes here; 1 of others
#endif

// The least and the largest shade of any vertex. Interpolation in triangles seen edge-on extrapolates, to anything and
// even to NaN.
layout(location = 1) uniform vec4 lowest_shade;
layout(location = 2) uniform vec4 highest_shade;

vec4 bounded(vec4 shade) {
    shade = mix(lowest_shade, shade, greaterThanEqual(shade, lowest_shade)); // false for NaN
    return mix(highest_shade, shade, lessThanEqual(shade, highest_shade));
}

#if defined(CASTING) || defined(RELIEF)
layout(location = 4) in vec3 surface_place; // in the unit frame
#endif

#ifdef CASTING
#ifdef RELIEF
// lit_luminance() knows what each light that casts shadows adds
#elif defined(FLAT)
layout(location = 5) flat in vec4 surface_cast[CASTING];
#else
layout(location = 5) in vec4 surface_cast[CASTING];
#endif
#if defined(TEXTURED) && !defined(RELIEF)
layout(location = 9) in vec4 surface_cast_highlights;
#endif
layout(location = 62) uniform vec4 whitest_shade; // what the sum is cut off at
// A layer a directional light or spot, and six a point light: from the unit frame to where the layer's window is from -1
// to 1, depth is 1 near the light and falls to 0, and w is above 0 before the light.
layout(location = 64) uniform mat4 layer_from_unit[24];
layout(location = 96) uniform vec4 shadow_lights[CASTING]; // position in the unit frame; the first layer
// x: 1 for six layers; y: 1 where light comes from a place; z: by how much depth changes over the window's coordinate
// where it changes by as much as the place, times the depth itself where light comes from a place.
layout(location = 100) uniform vec4 shadow_kinds[CASTING];
layout(location = 104) uniform mat4 world_from_unit;       // rotation alone
layout(binding = 2) uniform sampler2DArray shadow_maps;    // depth; 0 outside

// What is nearer to the light than the triangle's plane by less than this hides nothing, in texels, on slopes times the
// slope: that much rounding, the grid that rasterisers put corners on, and surfaces that curve up beside the triangle come
// to. From there on it takes another `fading_texels` until it hides all, so that where it is by a little does not matter.
const float bias_texels = 0.5;
const float fading_texels = 0.5;
// Steeper slopes, as depth over width, are of triangles that the light grazes, which it hardly lights.
const float steepest = 64.0;

// The layer of six that looks this way: -x, +x, -y, ...
int side_of(vec3 direction) {
    vec3 size = abs(direction);
    int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    return 2 * axis + (direction[axis] > 0.0 ? 1 : 0);
}

// How much of a light comes here. Sixteen texels are compared with the depth that the triangle's own plane has at each
// of them, so that no plane ever hides itself, and no shadow has to be moved for that. Weighted with the mean of nine
// interpolated looks a texel apart.
float visibility_of(int light, vec3 across, vec3 along) {
    int layer = int(shadow_lights[light].w);
    if (shadow_kinds[light].x > 0.5)
        layer += side_of(mat3(world_from_unit) * (surface_place - shadow_lights[light].xyz));
    mat4 m = layer_from_unit[layer];
    vec4 at = m * vec4(surface_place, 1.0);
    if (!(at.w > 0.0))
        return 1.0;
    vec3 here = at.xyz / at.w;

    // Depth is a linear function of the window's coordinates on a plane: its gradient from two directions on it.
    vec4 m_across = m * vec4(across, 0.0), m_along = m * vec4(along, 0.0);
    vec3 a = (m_across.xyz - here * m_across.w) / at.w, b = (m_along.xyz - here * m_along.w) / at.w;
    float determinant = a.x * b.y - a.y * b.x;
    vec2 gradient = vec2(a.z * b.y - b.z * a.y, b.z * a.x - a.z * b.x) / determinant;
    float size = float(textureSize(shadow_maps, 0).x);
    float texel = 2.0 / size;
    float upright = shadow_kinds[light].z * (shadow_kinds[light].y > 0.5 ? here.z : 1.0); // the gradient of slope 1
    float slope = length(gradient);
    if (!(slope <= steepest * upright))
        gradient = slope > 0.0 && slope < 1e30 ? gradient * (steepest * upright / slope) : vec2(0.0);
    float unit = texel * (upright + length(gradient));

    vec2 place = (here.xy * 0.5 + 0.5) * size - 0.5;
    vec2 first = floor(place), part = place - first;
    vec4 weights_x = vec4(1.0 - part.x, 1.0, 1.0, part.x) / 3.0, weights_y = vec4(1.0 - part.y, 1.0, 1.0, part.y) / 3.0;
    float seen = 0.0;
    for (int j = 0; j < 4; j += 2)
        for (int i = 0; i < 4; i += 2) {
            // Texels first - 1 + i and the next one: in the order (i, j + 1), (i + 1, j + 1), (i + 1, j), (i, j).
            vec4 depths = textureGather(shadow_maps, vec3((first + vec2(i, j)) / size, float(layer)));
            vec2 off = vec2(i, j) - 1.0 - part;
            // Not below 0, which empty texels have: else the plane, where it goes on behind its own end, would be hidden
            // by nothing.
            vec4 own = max(
                here.z + texel * (gradient.x * (off.x + vec4(0, 1, 1, 0)) + gradient.y * (off.y + vec4(1, 1, 0, 0))), 0.0);
            vec4 open = clamp(1.0 + ((own - depths) / unit + bias_texels) / fading_texels, 0.0, 1.0);
            seen += dot(open, vec4(weights_x[i] * weights_y[j + 1], weights_x[i + 1] * weights_y[j + 1],
                                   weights_x[i + 1] * weights_y[j], weights_x[i] * weights_y[j]));
        }
    return seen >= 0.0 ? min(seen, 1.0) : 1.0;
}

vec4 visibilities() {
    vec4 visible = vec4(1);
    vec3 across = dFdx(surface_place), along = dFdy(surface_place);
    for (int i = 0; i < CASTING; ++i)
        visible[i] = visibility_of(i, across, along);
    return visible;
}
#endif

#ifdef TEXTURED
layout(location = 2) in vec2 surface_uv;
#if defined(LIT) && !defined(RELIEF)
layout(location = 3) in float surface_highlight;
#endif

layout(binding = 1) uniform sampler2D surface_image; // linear RGB
#ifdef EMISSION
layout(binding = 3) uniform sampler2D emission_image; // linear RGB
#endif
layout(location = 60) uniform float lod_bias;
layout(location = 61) uniform vec4 uv_bounds; // the least of any vertex, and the largest: likewise

const vec3 rec709 = vec3(0.2126, 0.7152, 0.0722);

vec2 bounded_uv() {
    vec2 uv = mix(uv_bounds.xy, surface_uv, greaterThanEqual(surface_uv, uv_bounds.xy));
    return mix(uv_bounds.zw, uv, lessThanEqual(uv, uv_bounds.zw));
}

#ifdef CUT_OUT
layout(location = 63) uniform float least_share; // spread evenly from 0 to 1 over the samples of a pixel

// Texels wider than this sample have outlines, where alpha is a half. Of finer ones a share of all samples is there.
bool is_there() {
    vec2 uv = bounded_uv();
    float alpha = texture(surface_image, uv, lod_bias).a;
#ifdef BLENDS
    // One sample a pixel: by pixels, in a pattern that no eye finds (Jimenez 2014, "interleaved gradient noise").
    float share = least_share < 0.0 ? fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))))
                                    : least_share;
    return alpha > 0.0 && alpha >= share;
#else
    float level = textureQueryLod(surface_image, uv).y + lod_bias;
    return alpha >= mix(0.5, least_share, clamp(level, 0.0, 1.0));
#endif
}
#endif

vec4 textured(vec4 shade, float highlight) {
    vec3 rgb = shade.rgb * texture(surface_image, bounded_uv(), lod_bias).rgb;
#ifdef EMISSION
    rgb += texture(emission_image, bounded_uv(), lod_bias).rgb;
#endif
#ifdef LIT
    rgb += vec3(highlight >= 0.0 ? highlight : 0.0); // neither less nor NaN, as for shades
#endif
#if defined(LIT) || defined(RELIEF) || defined(EMISSION)
    rgb /= max(dot(rgb, rec709), 1.0);
#endif
    return vec4(rgb, dot(rgb, rec709));
}
#endif

#ifdef RELIEF
layout(location = 10) in vec4 surface_normal_and_albedo;
layout(binding = 4) uniform sampler2D relief_image; // x, y, z from -1 to 1

// The vertices' normal, tilted by the normal map: along the gradients of u and v on the triangle, the longer of which is a
// unit (Schueler, "Normal mapping without precomputed tangents", 2013).
vec3 tilted(vec3 n) {
    vec3 across = dFdx(surface_place), along = dFdy(surface_place);
    vec2 uv_across = dFdx(surface_uv), uv_along = dFdy(surface_uv);
    vec3 p = cross(along, n), q = cross(n, across);
    vec3 of_u = p * uv_across.x + q * uv_along.x, of_v = p * uv_across.y + q * uv_along.y;
    float size = max(dot(of_u, of_u), dot(of_v, of_v));
    float side = dot(cross(across, along), n) < 0.0 ? -1.0 : 1.0; // seen from behind, or where y grows downward
    vec3 map = texture(relief_image, bounded_uv(), lod_bias).xyz;
    vec3 sum = side * inversesqrt(max(size, 1e-30)) * (of_u * map.x + of_v * map.y) + n * map.z;
    float squared = dot(sum, sum);
    return size > 0.0 && squared > 0.0 ? sum * inversesqrt(squared) : n; // a zero n stays zero
}

#ifndef LIT
layout(location = 112) uniform vec4 baked_light; // direction towards it; ambient light
layout(location = 113) uniform float baked_fill; // of the light from behind

// Of white, in the light that the vertices' shades are of.
float baked_luminance(vec3 n) {
    float facing = dot(n, baked_light.xyz);
    return baked_light.w + (1.0 - baked_light.w) * max(facing, baked_fill * -facing);
}

const float darkest = 0.01; // a vertex that no light reaches shows no relief

// By how much the relief brightens the vertices' shades.
float brightening(vec3 n) { return baked_luminance(tilted(n)) / max(baked_luminance(n), darkest); }
#endif

// Zero where vertices have none.
vec3 surface_normal() {
    vec3 n = surface_normal_and_albedo.xyz;
    float squared = dot(n, n);
    return squared > 0.0 ? n * inversesqrt(squared) : vec3(0);
}
#endif

#ifdef WIREFRAME
const float half_line = 0.5;             // pixels, on each side of an edge
const float half_line_of_height = 0.15;  // lines get thinner where triangles are so small that lines would cover them
const float dark_surface = 0.08;         // relative luminance; below it lines are brighter than the surface
const float line_on_bright = 0.15;       // share of the surface's luminance
const float line_on_dark = 0.4;          // added to the surface's luminance

// The share of this sample that an edge's line covers. The weights are interpolated with perspective, so their
// derivatives give distances in pixels, also in triangles that reach behind the eye.
float line_coverage() {
    vec3 per_pixel = vec3(length(vec2(dFdx(corner_weights.x), dFdy(corner_weights.x))),
                          length(vec2(dFdx(corner_weights.y), dFdy(corner_weights.y))),
                          length(vec2(dFdx(corner_weights.z), dFdy(corner_weights.z))));
    vec3 heights = 1.0 / max(per_pixel, vec3(1e-20));
    vec3 distances = corner_weights * heights;
    float nearest = min(distances.x, min(distances.y, distances.z));
    float width = min(half_line, half_line_of_height * min(heights.x, min(heights.y, heights.z)));
#ifdef DISPLAY
    return clamp(width - nearest + 0.5, 0.0, 1.0); // one sample a pixel: soft edges, one pixel wide
#else
    return nearest < width ? 1.0 : 0.0;
#endif
}

vec4 line_shade(vec4 surface) {
    if (surface.a > dark_surface)
        return surface * line_on_bright;
    return surface + vec4(line_on_dark);
}
#endif

#ifdef ENCODE_SRGB
vec3 srgb_encoded(vec3 linear) {
    vec3 c = clamp(linear, 0.0, 1.0);
    return mix(1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
}
#endif

void main() {
#ifdef CUT_OUT
    bool is_drawn = is_there(); // what is not is dropped at the end, for neighbours are looked at until then
#else
    const bool is_drawn = true;
#endif
#ifdef DEPTH
    if (!is_drawn)
        discard;
    return;
#endif
    vec4 result = bounded(surface_shade);
    float highlight = 0.0;
#if defined(RELIEF) && defined(LIT)
    vec4 hue = result;
    float albedo = surface_normal_and_albedo.w;
    vec2 lit = lit_luminance(tilted(surface_normal()), surface_place, albedo >= 0.0 ? min(albedo, 1.0) : 0.0);
    result = hue * lit.x;
    highlight = lit.y;
#elif defined(RELIEF)
    result *= brightening(surface_normal());
#elif defined(TEXTURED) && defined(LIT)
    highlight = surface_highlight;
#endif
#ifdef MASK
    mask = vec4(1);
#endif
#ifdef CASTING
    vec4 visible = visibilities();
    vec4 casts[CASTING];
    for (int i = 0; i < CASTING; ++i)
#ifdef RELIEF
        casts[i] = hue * blockable[i].x;
#else
        casts[i] = bounded(surface_cast[i]);
#endif
#ifdef SHARE
    vec4 unhidden = result;
    for (int i = 0; i < CASTING; ++i)
        unhidden += casts[i];
#endif
    for (int i = 0; i < CASTING; ++i)
        result += visible[i] * casts[i];
#ifdef TEXTURED
    vec4 cast_highlights = vec4(0);
    for (int i = 0; i < CASTING; ++i)
#ifdef RELIEF
        cast_highlights[i] = blockable[i].y;
#else
        cast_highlights[i] = max(surface_cast_highlights[i], 0.0);
#endif
#ifdef SHARE
    unhidden.a += highlight;
    for (int i = 0; i < CASTING; ++i)
        unhidden.a += cast_highlights[i];
#endif
    for (int i = 0; i < CASTING; ++i)
        highlight += visible[i] * cast_highlights[i];
#else
    result = min(result / max(result.a, 1.0), whitest_shade);
#endif
#ifdef MASK
    mask = visible;
#endif
#ifdef SHARE
    // Of what a picture shows, which is cut off at white. What has no light loses none.
    if (!is_drawn)
        discard;
    float shown = min(unhidden.a, 1.0);
    pixel = vec4(shown > 0.0 ? min(result.a + highlight, shown) / shown : 1.0);
    return;
#endif
#endif
#ifdef SHARE
    if (!is_drawn)
        discard;
    pixel = vec4(1.0);
    return;
#endif
#ifdef TEXTURED
    result = textured(result, highlight);
#endif
#ifdef WIREFRAME
    result = mix(result, line_shade(result), line_coverage());
#endif
#ifdef ENCODE_SRGB
    result.rgb = srgb_encoded(result.rgb);
#endif
#ifdef DISPLAY
    result.a = 1.0;
#endif
    if (!is_drawn)
        discard;
    pixel = result;
}
