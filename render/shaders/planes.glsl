// What the judge's passes share. A plane is a grid of numbers: four of a row lie in one texel, so that a fetch gets four
// and a pass makes four at once. The last texel of a row may hold more than the row does; what is there is finite, and
// counts for nothing.

// A fragment's texel, whose first pixel is at 4 x.
ivec2 place() { return ivec2(gl_FragCoord.xy); }

int last_column(int width) { return (width - 1) >> 2; }

vec4 texel(sampler2D plane, int column, int y, int width) {
    return texelFetch(plane, ivec2(clamp(column, 0, last_column(width)), y), 0);
}

// Of a pixel that the plane has.
float pixel(sampler2D plane, int x, int y) { return texelFetch(plane, ivec2(x >> 2, y), 0)[x & 3]; }

// Pixels from `first` on. Those that the plane has not are any that it has.
vec4 four(sampler2D plane, int first, int y, int width) {
    vec4 a = texel(plane, first >> 2, y, width), b = texel(plane, (first + 3) >> 2, y, width);
    int skipped = first & 3;
    return skipped == 0 ? a : skipped == 1 ? vec4(a.yzw, b.x) : skipped == 2 ? vec4(a.zw, b.xy) : vec4(a.w, b.xyz);
}

// Mirrored about the outermost pixels; a plane narrower than a kernel repeats its last one.
int mirrored(int i, int n) {
    if (i < 0)
        i = -i;
    if (i >= n)
        i = 2 * (n - 1) - i;
    return clamp(i, 0, n - 1);
}

// The binomial filter (1 2 1)/4 along both axes, mirrored at the borders. Without branches: some GPUs, and all software,
// would go through each anyway.
vec4 smoothed_at(sampler2D plane, ivec2 at, ivec2 size) {
    int above = mirrored(at.y - 1, size.y), below = mirrored(at.y + 1, size.y), inside = size.x - 4 * at.x;
    vec4 left = 0.5 * texel(plane, at.x - 1, at.y, size.x) +
                0.25 * (texel(plane, at.x - 1, above, size.x) + texel(plane, at.x - 1, below, size.x));
    vec4 here = 0.5 * texel(plane, at.x, at.y, size.x) +
                0.25 * (texel(plane, at.x, above, size.x) + texel(plane, at.x, below, size.x));
    vec4 right = 0.5 * texel(plane, at.x + 1, at.y, size.x) +
                 0.25 * (texel(plane, at.x + 1, above, size.x) + texel(plane, at.x + 1, below, size.x));
    // What follows the last pixel of the row is the one before it.
    here.y = inside == 1 ? (at.x == 0 ? here.x : left.w) : here.y;
    here.z = inside == 2 ? here.x : here.z;
    here.w = inside == 3 ? here.y : here.w;
    right.x = inside == 4 ? here.z : right.x;
    left.w = at.x == 0 ? here.y : left.w;
    return 0.5 * here + 0.25 * (vec4(left.w, here.xyz) + vec4(here.yzw, right.x));
}

// Drivers compute logarithms and powers to a few digits; these are within 4e-7, as the judge on the CPU has them. Of a
// normal, positive number.
float exact_log2(float x) {
    int bits = floatBitsToInt(x);
    int exponent = (bits - 0x3f3504f3) >> 23; // mantissas from 1 / sqrt 2 to sqrt 2
    float m = intBitsToFloat(bits - (exponent << 23)), t = (m - 1.0) / (m + 1.0), square = t * t;
    float series = 1.0 + square * (1.0 / 3.0 + square * (1.0 / 5.0 + square * (1.0 / 7.0)));
    return float(exponent) + 2.8853900817779268 * t * series;
}

float exact_exp2(float x) {
    float limited = clamp(x, -126.0, 127.0), whole = floor(limited + 0.5), y = (limited - whole) * 0.69314718055994531;
    float series = 1.0 + y * (1.0 + y * (1.0 / 2.0 + y * (1.0 / 6.0 + y * (1.0 / 24.0 + y * (1.0 / 120.0 + y / 720.0)))));
    return series * intBitsToFloat((int(whole) + 127) << 23);
}

const float least_normal = 1.17549435e-38, largest_float = 3.40282347e38;
