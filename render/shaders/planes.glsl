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

// The binomial filter (1 2 1)/4 along both axes.
vec4 smoothed_at(sampler2D plane, ivec2 at, ivec2 size) {
    int above = mirrored(at.y - 1, size.y), below = mirrored(at.y + 1, size.y);
    float v[6]; // from the pixel left of the texel to the one right of it
    if (at.x > 0 && 4 * at.x + 4 < size.x) {
        vec4 left = 0.5 * texel(plane, at.x - 1, at.y, size.x) +
                    0.25 * (texel(plane, at.x - 1, above, size.x) + texel(plane, at.x - 1, below, size.x));
        vec4 here = 0.5 * texel(plane, at.x, at.y, size.x) +
                    0.25 * (texel(plane, at.x, above, size.x) + texel(plane, at.x, below, size.x));
        vec4 right = 0.5 * texel(plane, at.x + 1, at.y, size.x) +
                     0.25 * (texel(plane, at.x + 1, above, size.x) + texel(plane, at.x + 1, below, size.x));
        v[0] = left.w, v[1] = here.x, v[2] = here.y, v[3] = here.z, v[4] = here.w, v[5] = right.x;
    } else {
        for (int i = 0; i < 6; ++i) {
            int x = mirrored(4 * at.x - 1 + i, size.x);
            v[i] = 0.5 * pixel(plane, x, at.y) + 0.25 * (pixel(plane, x, above) + pixel(plane, x, below));
        }
    }
    return 0.5 * vec4(v[1], v[2], v[3], v[4]) + 0.25 * (vec4(v[0], v[1], v[2], v[3]) + vec4(v[2], v[3], v[4], v[5]));
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
