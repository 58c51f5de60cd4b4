// Thresholds from the levels of a picture: what contrasts of each band elevate, times threshold versus intensity.
const int band_count = 6;
layout(binding = 0) uniform sampler2D differences[band_count]; // level i less level i + 1
layout(binding = 6) uniform sampler2D blurred[band_count];     // level i + 2
layout(binding = 12) uniform sampler2D adaptations;
layout(binding = 13) uniform sampler2D sensitivities; // rows: log2 of the bands' CSF, then of TVI
layout(location = 0) uniform vec4 masking;            // scale, gain, power; the largest elevation
layout(location = 1) uniform vec4 nodes;              // the first one's log2, how many an octave, how many; the floor
layout(location = 2) uniform float frequency_factors[band_count];

layout(location = 0) out vec4 thresholds;

float between(float at, int row) {
    int cell = clamp(int(at), 0, int(nodes.z) - 2);
    float a = texelFetch(sensitivities, ivec2(cell, row), 0).r, b = texelFetch(sensitivities, ivec2(cell + 1, row), 0).r;
    return a + (at - float(cell)) * (b - a);
}

void main() {
    ivec2 at = place();
    vec4 adaptation = max(texelFetch(adaptations, at, 0), vec4(nodes.w));
    vec4 nodes_at, sum = vec4(0.0), weighted = vec4(0.0);
    for (int i = 0; i < 4; ++i)
        nodes_at[i] = clamp((exact_log2(adaptation[i]) - nodes.x) * nodes.y, 0.0, nodes.z - 1.0);
    for (int band = 0; band < band_count; ++band) {
        vec4 contrast =
            abs(texelFetch(differences[band], at, 0)) / max(texelFetch(blurred[band], at, 0), vec4(nodes.w));
        sum += contrast;
        for (int i = 0; i < 4; ++i) {
            if (!(contrast[i] >= least_normal))
                continue;
            // log2 of the contrast in thresholds, times the gain; and of the masking's fourth power.
            float x = exact_log2(contrast[i]) + between(nodes_at[i], band) + exact_log2(masking.y);
            float t = 4.0 * (exact_log2(masking.x) + masking.z * x);
            float elevated = t > 100.0 ? exact_exp2(0.25 * t) : exact_exp2(0.25 * exact_log2(1.0 + exact_exp2(t)));
            weighted[i] += contrast[i] * min(frequency_factors[band] * elevated, 1e30);
        }
    }
    for (int i = 0; i < 4; ++i) {
        float elevation = clamp(weighted[i] / max(sum[i], nodes.w), 1.0, masking.w);
        thresholds[i] = elevation * exact_exp2(between(nodes_at[i], band_count));
    }
}
