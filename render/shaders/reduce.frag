// Smooths by the pyramid's kernel along one axis, and takes every second sample of it: ALONG_ROWS, or else along columns.
layout(binding = 0) uniform sampler2D plane;
layout(location = 0) uniform ivec2 size; // of the plane
layout(location = 1) uniform vec4 kernel;

layout(location = 0) out vec4 values;

void main() {
    ivec2 at = place();
#ifdef ALONG_ROWS
    int x = 8 * at.x; // of the first pixel
    float v[16];      // from x - 4 on
    for (int t = 0; t < 4; ++t) {
        vec4 some = texel(plane, 2 * at.x - 1 + t, at.y, size.x);
        for (int i = 0; i < 4; ++i)
            v[4 * t + i] = some[i];
    }
    // Mirrored at the row's ends.
    int inside = size.x - x;
    for (int k = 1; k <= 8; ++k) {
        v[4 + k] = inside == k ? v[2 + k] : v[4 + k];
        v[5 + k] = inside == k ? v[1 + k] : v[5 + k];
    }
    if (size.x == 1)
        v[5] = v[6] = v[4];
    v[3] = x == 0 ? v[5] : v[3];
    v[2] = x == 0 ? v[6] : v[2];
    values = kernel.x * vec4(v[4], v[6], v[8], v[10]) +
             kernel.y * (vec4(v[3], v[5], v[7], v[9]) + vec4(v[5], v[7], v[9], v[11])) +
             kernel.z * (vec4(v[2], v[4], v[6], v[8]) + vec4(v[6], v[8], v[10], v[12]));
#else
    vec4 v[5];
    for (int i = 0; i < 5; ++i)
        v[i] = texelFetch(plane, ivec2(at.x, mirrored(2 * at.y - 2 + i, size.y)), 0);
    values = kernel.x * v[2] + kernel.y * (v[1] + v[3]) + kernel.z * (v[0] + v[4]);
#endif
}
