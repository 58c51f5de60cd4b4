// Energies of one band of differences: twice the squares of contrasts in thresholds.
layout(binding = 0) uniform sampler2D band; // cd/m2
layout(binding = 1) uniform sampler2D own;
layout(binding = 2) uniform sampler2D smoothed;
layout(location = 0) uniform ivec2 size;
layout(location = 1) uniform vec4 scales; // one over the weights', most thresholds, the energies'

layout(location = 0) out vec4 energy;

void main() {
    ivec2 at = place();
    vec4 here = texelFetch(band, at, 0), around = smoothed_at(band, at, size);
    vec4 seen = (texelFetch(own, at, 0) * scales.x) * here + (texelFetch(smoothed, at, 0) * scales.x) * around;
    for (int i = 0; i < 4; ++i) {
        float thresholds = abs(seen[i]);
        if (!(thresholds < scales.y)) // what is no number is visible
            thresholds = scales.y;
        energy[i] = 4 * at.x + i < size.x ? 2.0 * scales.z * thresholds * thresholds : 0.0; // nothing is outside
    }
}
