// A symmetric kernel along one axis; what lies outside is 0. Along rows with REACH_1, 2 or 3 texels to each side, or else
// along columns.
#if defined(REACH_1)
#define REACH 1
#elif defined(REACH_2)
#define REACH 2
#elif defined(REACH_3)
#define REACH 3
#endif

layout(binding = 0) uniform sampler2D plane;
layout(location = 0) uniform ivec2 size;
layout(location = 1) uniform float kernel[12]; // from the middle on, 0 beyond its end
#ifndef REACH
layout(location = 13) uniform uint reach; // pixels
#endif

layout(location = 0) out vec4 values;

void main() {
    ivec2 at = place();
#ifdef REACH
    float v[4 * (2 * REACH + 1)];
    for (int t = 0; t <= 2 * REACH; ++t) {
        int column = at.x - REACH + t;
        vec4 some = column >= 0 && column <= last_column(size.x) ? texelFetch(plane, ivec2(column, at.y), 0) : vec4(0.0);
        for (int i = 0; i < 4; ++i)
            v[4 * t + i] = some[i];
    }
    const int m = 4 * REACH, last = REACH == 3 ? 11 : m;
    values = kernel[0] * vec4(v[m], v[m + 1], v[m + 2], v[m + 3]);
    for (int k = 1; k <= last; ++k)
        values += kernel[k] * (vec4(v[m - k], v[m - k + 1], v[m - k + 2], v[m - k + 3]) +
                               vec4(v[m + k], v[m + k + 1], v[m + k + 2], v[m + k + 3]));
#else
    values = kernel[0] * texelFetch(plane, at, 0);
    for (int k = 1; k <= int(reach); ++k) {
        vec4 above = at.y - k >= 0 ? texelFetch(plane, ivec2(at.x, at.y - k), 0) : vec4(0.0);
        vec4 below = at.y + k < size.y ? texelFetch(plane, ivec2(at.x, at.y + k), 0) : vec4(0.0);
        values += kernel[k] * (above + below);
    }
#endif
}
