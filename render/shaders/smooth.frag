// One level of a picture from the one before, along one axis: five taps. Of numbers in two floats, so that what nearly
// equal levels differ by is exact: differences of contrasts below 1e-5 count. WITH_DIFFERENCE: also the level before
// less this one.
layout(binding = 0) uniform sampler2D highs; // what is blurred, and what it lacks
layout(binding = 1) uniform sampler2D lows;
#ifdef WITH_DIFFERENCE
layout(binding = 2) uniform sampler2D highs_before; // the level before
layout(binding = 3) uniform sampler2D lows_before;
#endif
layout(location = 0) uniform ivec2 size;
layout(location = 1) uniform vec4 taps; // by distance

layout(location = 0) out vec4 high;
layout(location = 1) out vec4 low;
#ifdef WITH_DIFFERENCE
layout(location = 2) out vec4 difference;
#endif

// -i becomes i, n + i becomes n - i - 1; again, where the picture is narrower than the kernel.
int reflected(int i, int n) {
    for (int k = 0; k < 4; ++k) {
        if (i < 0)
            i = min(-i, n - 1);
        else if (i >= n)
            i = max(2 * n - i - 1, 0);
    }
    return i;
}

#ifdef ALONG_ROWS
vec4 at_offset(sampler2D plane, ivec2 at, int offset) {
    vec4 values;
    for (int i = 0; i < 4; ++i)
        values[i] = pixel(plane, reflected(min(4 * at.x + i, size.x - 1) + offset, size.x), at.y);
    return values;
}
#else
vec4 at_offset(sampler2D plane, ivec2 at, int offset) {
    return texelFetch(plane, ivec2(at.x, reflected(at.y + offset, size.y)), 0);
}
#endif

void main() {
    ivec2 at = place();
    vec4 h = at_offset(highs, at, 0), l = at_offset(lows, at, 0);
    precise vec4 change = vec4(0.0);
    for (int k = 1; k <= 2; ++k)
        for (int side = -k; side <= k; side += 2 * k) {
            precise vec4 towards = (at_offset(highs, at, side) - h) + (at_offset(lows, at, side) - l);
            change += taps[k] * towards;
        }
    // The sum of both, exact in two floats.
    precise vec4 rest = l + change;
    precise vec4 sum = h + rest;
    precise vec4 part = sum - h;
    precise vec4 lost = (h - (sum - part)) + (rest - part);
    high = sum;
    low = lost;
#ifdef WITH_DIFFERENCE
    precise vec4 less = (texelFetch(highs_before, at, 0) - sum) + (texelFetch(lows_before, at, 0) - lost);
    difference = less;
#endif
}
