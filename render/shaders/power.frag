// The energies that a window holds, as the sum of three Gaussians that were applied to halved planes; then to the power of
// half the exponent of the pooling, which is one of amplitudes.
layout(binding = 0) uniform sampler2D first;
layout(binding = 1) uniform sampler2D second;
layout(binding = 2) uniform sampler2D third;
layout(location = 0) uniform vec4 weights; // of the Gaussians
layout(location = 1) uniform vec4 halvings; // of the Gaussians, exponent
layout(location = 2) uniform ivec2 first_size;
layout(location = 3) uniform ivec2 second_size;
layout(location = 4) uniform ivec2 third_size;

layout(location = 0) out vec4 powers;

// Linear between the samples of a plane of lower resolution.
vec4 enlarged(sampler2D plane, float halvings_of, ivec2 size, ivec2 at) {
    if (halvings_of == 0.0)
        return texelFetch(plane, at, 0);
    float share = 1.0 / float(1 << int(halvings_of));
    vec4 x = clamp((vec4(0.5, 1.5, 2.5, 3.5) + float(4 * at.x)) * share - 0.5, 0.0, float(size.x - 1));
    float y = clamp((float(at.y) + 0.5) * share - 0.5, 0.0, float(size.y - 1));
    int left = int(x.x), above = int(y);
    vec4 a = four(plane, left, above, size.x), b = four(plane, left, min(above + 1, size.y - 1), size.x);
    vec4 line = a + (y - float(above)) * (b - a), samples = float(left) + vec4(0.0, 1.0, 2.0, 3.0), values;
    for (int i = 0; i < 4; ++i)
        values[i] = dot(max(1.0 - abs(samples - x[i]), 0.0), line); // two of the four samples
    return values;
}

void main() {
    ivec2 at = place();
    vec4 energy = weights.x * enlarged(first, halvings.x, first_size, at) +
                  weights.y * enlarged(second, halvings.y, second_size, at) +
                  weights.z * enlarged(third, halvings.z, third_size, at);
#if defined(EXPONENT_3_5) // the usual one, without logarithms
    powers = energy * sqrt(energy) * sqrt(sqrt(energy));
#elif defined(EXPONENT_2)
    powers = energy;
#else
    for (int i = 0; i < 4; ++i)
        powers[i] = energy[i] > 0.0 ? exact_exp2(0.5 * halvings.w * exact_log2(max(energy[i], least_normal))) : 0.0;
#endif
}
