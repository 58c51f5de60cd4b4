// Pools the bands, each sample for the pixels that it is nearest to: powers to V, or the least of THRESHOLDS.
#ifdef UP_TO_8
const int most = 8;
#else
const int most = 16;
#endif
layout(binding = 0) uniform sampler2D bands[most]; // the first ones are used
layout(location = 0) uniform ivec2 size;         // of the picture
layout(location = 1) uniform uint count;
#ifndef THRESHOLDS
layout(location = 2) uniform float exponent;
#endif

layout(location = 0) out vec4 pooled;

void main() {
    ivec2 at = place(), last = size - 1; // of the level
    ivec4 x = 4 * at.x + ivec4(0, 1, 2, 3);
#ifdef THRESHOLDS
    vec4 least = vec4(largest_float);
#else
    vec4 sum = vec4(0.0);
#endif
    for (int level = 0; level < most; ++level) {
        if (level >= int(count))
            break;
        int half_block = level == 0 ? 0 : 1 << (level - 1);
        ivec4 nearest = min((x + half_block) >> level, last.x) - min((x.x + half_block) >> level, last.x);
        vec4 some = four(bands[level], min((x.x + half_block) >> level, last.x), min((at.y + half_block) >> level, last.y),
                         last.x + 1);
        vec4 values = some;
        if (level > 0) // four pixels are of three samples at most
            for (int i = 1; i < 4; ++i)
                values[i] = nearest[i] == 0 ? some.x : nearest[i] == 1 ? some.y : some.z;
#ifdef THRESHOLDS
        least = min(least, values);
#else
        sum += values;
#endif
        last = (last + 2) / 2 - 1;
    }
#ifdef THRESHOLDS
    pooled = least;
#else
    for (int i = 0; i < 4; ++i)
        pooled[i] = sum[i] <= 0.0 ? 0.0 : exact_exp2(exact_log2(max(sum[i], least_normal)) / exponent);
#endif
}
