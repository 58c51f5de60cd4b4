// What is in a picture: its least and largest value, how many are not below 1, and the first that is no luminance. Each
// workgroup looks at 64 x 16 pixels. Whole numbers add up to the same in any order, and floats from 0 on are ordered as
// their bits.
layout(local_size_x = 16, local_size_y = 16) in;

layout(binding = 0) uniform sampler2D picture;
layout(std430, binding = 0) buffer Found {
    uint least; // bits
    uint largest;
    uint not_below_1;
    uint first_bad; // row-major
};
layout(location = 0) uniform ivec2 size;
layout(location = 1) uniform uint channel;
layout(location = 2) uniform vec4 to_luminance; // scale, offset

shared uint group_least, group_largest, group_not_below_1, group_first_bad;

void main() {
    if (gl_LocalInvocationIndex == 0u) {
        group_least = group_first_bad = 0xffffffffu;
        group_largest = group_not_below_1 = 0u;
    }
    barrier();
    uint low = 0xffffffffu, high = 0u, visible = 0u, bad = 0xffffffffu;
    ivec2 at = ivec2(gl_WorkGroupID.xy) * ivec2(64, 16) + ivec2(gl_LocalInvocationID.xy);
    for (int i = 0; i < 4; ++i, at.x += 16) {
        if (at.x >= size.x || at.y >= size.y)
            continue;
        precise float value = texelFetch(picture, at, 0)[channel] * to_luminance.x + to_luminance.y;
        uint bits = floatBitsToUint(value);
        if ((bits > 0x80000000u) || bits >= 0x7f800000u && bits != 0x80000000u)
            bad = min(bad, uint(at.y) * uint(size.x) + uint(at.x));
        bits &= 0x7fffffffu; // of -0
        low = min(low, bits);
        high = max(high, bits);
        if (!(value < 1.0))
            ++visible;
    }
    atomicMin(group_least, low);
    atomicMax(group_largest, high);
    atomicAdd(group_not_below_1, visible);
    atomicMin(group_first_bad, bad);
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        atomicMin(least, group_least);
        atomicMax(largest, group_largest);
        atomicAdd(not_below_1, group_not_below_1);
        atomicMin(first_bad, group_first_bad);
    }
}
