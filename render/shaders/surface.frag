// The surface's shade, with the triangles' edges drawn over it (WIREFRAME). DISPLAY: for displays, opaque
// and, with ENCODE_SRGB, encoded here because the framebuffer does not do it.
#ifdef FLAT
layout(location = 0) flat in vec4 surface_shade;
#else
layout(location = 0) in vec4 surface_shade;
#endif
#ifdef WIREFRAME
layout(location = 1) in vec3 corner_weights;
#endif

layout(location = 0) out vec4 pixel; // linear RGB; relative luminance in a

// The least and the largest shade of any vertex. Interpolation in triangles seen edge-on extrapolates, to anything and
// even to NaN.
layout(location = 1) uniform vec4 lowest_shade;
layout(location = 2) uniform vec4 highest_shade;

vec4 bounded(vec4 shade) {
    shade = mix(lowest_shade, shade, greaterThanEqual(shade, lowest_shade)); // false for NaN
    return mix(highest_shade, shade, lessThanEqual(shade, highest_shade));
}

#ifdef TEXTURED
layout(location = 2) in vec2 surface_uv;
#ifdef LIT
layout(location = 3) in float surface_highlight;
#endif

layout(binding = 1) uniform sampler2D surface_image; // linear RGB
layout(location = 60) uniform float lod_bias;
layout(location = 61) uniform vec4 uv_bounds; // the least of any vertex, and the largest: likewise

const vec3 rec709 = vec3(0.2126, 0.7152, 0.0722);

vec4 textured(vec4 shade) {
    vec2 uv = mix(uv_bounds.xy, surface_uv, greaterThanEqual(surface_uv, uv_bounds.xy));
    uv = mix(uv_bounds.zw, uv, lessThanEqual(uv, uv_bounds.zw));
    vec3 rgb = shade.rgb * texture(surface_image, uv, lod_bias).rgb;
#ifdef LIT
    rgb += vec3(surface_highlight >= 0.0 ? surface_highlight : 0.0); // neither less nor NaN, as for shades
    rgb /= max(dot(rgb, rec709), 1.0);
#endif
    return vec4(rgb, dot(rgb, rec709));
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
    vec4 result = bounded(surface_shade);
#ifdef TEXTURED
    result = textured(result);
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
    pixel = result;
}
