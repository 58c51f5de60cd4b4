// Pools the bands, each sample for the pixels that it is nearest to: powers to V, or the least of THRESHOLDS.
layout(binding = 0) uniform sampler2D bands[16]; // the first ones are used
layout(location = 0) uniform ivec2 size;         // of the picture
layout(location = 1) uniform uint count;
#ifndef THRESHOLDS
layout(location = 2) uniform float exponent;
#endif

layout(location = 0) out float pooled;

void main() {
    ivec2 at = place(), last = size - 1; // of the level
#ifdef THRESHOLDS
    float least = largest_float;
#else
    float sum = 0.0;
#endif
    for (int level = 0; level < 16; ++level) {
        if (level >= int(count))
            break;
        int half_block = level == 0 ? 0 : 1 << (level - 1);
        ivec2 nearest = min((at + half_block) >> level, last);
        float value = pixel(bands[level], nearest.x, nearest.y);
#ifdef THRESHOLDS
        least = min(least, value);
#else
        sum += value;
#endif
        last = (last + 2) / 2 - 1;
    }
#ifdef THRESHOLDS
    pooled = least;
#else
    pooled = sum <= 0.0 ? 0.0 : exact_exp2(exact_log2(max(sum, least_normal)) / exponent);
#endif
}
