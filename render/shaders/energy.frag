// Energies of one band of differences: twice the squares of contrasts in thresholds.
layout(binding = 0) uniform sampler2D band; // cd/m2
layout(binding = 1) uniform sampler2D own;
layout(binding = 2) uniform sampler2D smoothed;
layout(location = 0) uniform ivec2 size;
layout(location = 1) uniform vec4 limits; // x: most thresholds

layout(location = 0) out vec4 energy;

void main() {
    ivec2 at = place();
    vec4 here = texelFetch(band, at, 0), around = smoothed_at(band, at, size);
    vec4 seen = texelFetch(own, at, 0) * here + texelFetch(smoothed, at, 0) * around;
    for (int i = 0; i < 4; ++i) {
        float thresholds = abs(seen[i]);
        if (!(thresholds < limits.x)) // NaN is visible
            thresholds = limits.x;
        energy[i] = 4 * at.x + i < size.x ? 2.0 * thresholds * thresholds : 0.0; // nothing is outside
    }
}
