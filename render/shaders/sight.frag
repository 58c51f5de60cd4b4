// How one band of the reference is seen: the weights of differences; with THRESHOLDS, the least step that is visible.
// With GAZE by eccentricity.
layout(binding = 0) uniform sampler2D luminances;
layout(binding = 1) uniform sampler2D contrasts;
layout(binding = 2) uniform sampler2D nodes; // log2 of sensitivity, own, smoothed
layout(location = 0) uniform ivec2 size;
layout(location = 1) uniform vec4 masking;      // power, knee, least and largest masker
layout(location = 2) uniform ivec2 cells;       // of luminance: the first one, how many nodes
layout(location = 3) uniform ivec2 rows;        // of nodes: the first one, by how much a luminance's bits are shifted
layout(location = 4) uniform float of_patch;    // sensitivity to patches over that to unlimited gratings
#ifdef GAZE
layout(location = 5) uniform vec4 gaze;         // direction, tangent of a pixel
layout(location = 6) uniform vec4 eccentricity; // the first node's, nodes a degree, how many
layout(location = 7) uniform ivec2 window;
layout(location = 8) uniform uint level;
#endif

#ifdef THRESHOLDS
layout(location = 0) out vec4 steps;
#else
layout(location = 0) out vec4 own;
layout(location = 1) out vec4 smoothed;
#endif

// Linear between two nodes of a row.
vec3 between(int cell, float share, int row) {
    vec3 a = texelFetch(nodes, ivec2(cell, row), 0).xyz, b = texelFetch(nodes, ivec2(cell + 1, row), 0).xyz;
    return a + share * (b - a);
}

#ifdef GAZE
// The angle of (x, y) from the x axis, in radians, within 4e-7; y >= 0, and not both 0. Hastings' polynomial.
float angle_of(float y, float x) {
    const float pi = 3.14159265358979;
    float wide = abs(x), t = min(wide, y) / max(wide, y), s = t * t;
    float series =
        t * (0.99999934 +
             s * (-0.33329856 +
                  s * (0.19946536 +
                       s * (-0.13908534 + s * (0.09642004 + s * (-0.05590986 + s * (0.02186123 - s * 0.0040540580)))))));
    float steep = y > wide ? 0.5 * pi - series : series;
    return x < 0.0 ? pi - steep : steep;
}

// Of the pixel that the sample stands on, in degrees.
float eccentricity_of(ivec2 sample_at) {
    vec2 px = vec2(sample_at << int(level)) + 0.5;
    vec3 direction = vec3((px - 0.5 * vec2(window)) * gaze.w, 1.0);
    return angle_of(length(cross(gaze.xyz, direction)), dot(gaze.xyz, direction)) * 57.2957795130823;
}
#endif

vec3 node_of(float luminance, ivec2 sample_at) {
    int bits = floatBitsToInt(luminance), cell = (bits >> rows.y) - cells.x, last = cells.y - 2;
    int fraction = bits & ((1 << rows.y) - 1);
    float share = cell < 0 ? 0.0 : cell > last ? 1.0 : float(fraction) / float(1 << rows.y);
    cell = clamp(cell, 0, last);
#ifdef GAZE
    int count = int(eccentricity.z);
    float at = clamp((eccentricity_of(sample_at) - eccentricity.x) * eccentricity.y, 0.0, float(count - 1));
    int row = clamp(int(at), 0, max(count - 2, 0)), next = min(row + 1, count - 1);
    vec3 near = between(cell, share, rows.x + row), far = between(cell, share, rows.x + next);
    return near + (at - float(row)) * (far - near);
#else
    return between(cell, share, rows.x);
#endif
}

void main() {
    ivec2 at = place();
    vec4 luminance = texelFetch(luminances, at, 0), contrast = texelFetch(contrasts, at, 0);
    vec4 around = smoothed_at(contrasts, at, size);
    for (int i = 0; i < 4; ++i) {
        vec3 node = node_of(luminance[i], ivec2(min(4 * at.x + i, size.x - 1), at.y));
        float sensitivity = exact_exp2(node.x);
        // Maskers work where they are: their contrasts count in thresholds of patches.
        float masker = abs(node.y * contrast[i] + node.z * around[i]) * sensitivity * of_patch;
        float raised = 1.0 + exact_exp2(masking.x * exact_log2(clamp(masker, masking.z, masking.w)));
        float elevation = exact_exp2(exact_log2(raised) / masking.y);
#ifdef THRESHOLDS
        steps[i] = luminance[i] * elevation / (sensitivity * of_patch);
#else
        float to_thresholds = (sensitivity / (luminance[i] * elevation));
        own[i] = to_thresholds * node.y;
        smoothed[i] = to_thresholds * node.z;
#endif
    }
}
