// A symmetric kernel along one axis; what lies outside is 0. ALONG_ROWS, or else along columns; with 4, 8 or 11 taps to each
// side: REACH_1, 2 or 3 texels.
#if defined(REACH_1)
#define REACH 1
#elif defined(REACH_2)
#define REACH 2
#else
#define REACH 3
#endif

layout(binding = 0) uniform sampler2D plane;
layout(location = 0) uniform ivec2 size;
layout(location = 1) uniform float kernel[12]; // from the middle on, 0 beyond its end

layout(location = 0) out vec4 values;

void main() {
    const int last = REACH == 3 ? 11 : 4 * REACH;
    ivec2 at = place();
#ifdef ALONG_ROWS
    float v[4 * (2 * REACH + 1)];
    for (int t = 0; t <= 2 * REACH; ++t) {
        int column = at.x - REACH + t;
        vec4 some = texel(plane, column, at.y, size.x);
        some = column >= 0 && column <= last_column(size.x) ? some : vec4(0.0);
        for (int i = 0; i < 4; ++i)
            v[4 * t + i] = some[i];
    }
    const int m = 4 * REACH;
    values = kernel[0] * vec4(v[m], v[m + 1], v[m + 2], v[m + 3]);
    for (int k = 1; k <= last; ++k)
        values += kernel[k] * (vec4(v[m - k], v[m - k + 1], v[m - k + 2], v[m - k + 3]) +
                               vec4(v[m + k], v[m + k + 1], v[m + k + 2], v[m + k + 3]));
#else
    values = kernel[0] * texelFetch(plane, at, 0);
    for (int k = 1; k <= last; ++k) {
        vec4 above = texelFetch(plane, ivec2(at.x, max(at.y - k, 0)), 0);
        vec4 below = texelFetch(plane, ivec2(at.x, min(at.y + k, size.y - 1)), 0);
        values += (at.y - k >= 0 ? kernel[k] : 0.0) * above + (at.y + k < size.y ? kernel[k] : 0.0) * below;
    }
#endif
}
