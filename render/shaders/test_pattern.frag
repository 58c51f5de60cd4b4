// A luminance for each pixel, and for that one of the two codes around it.
layout(std430, binding = 0) readonly buffer Levels { float levels[256]; }; // cd/m2, ascending

layout(location = 0) uniform uint kind; // 0 grating, 1 match
layout(location = 1) uniform vec4 screen;  // width, height, tangent per pixel, 1 if the first row of the target is the top
layout(location = 2) uniform vec4 grating; // mean, contrast, cycles per degree, sigma in degrees
layout(location = 3) uniform vec4 place;   // phase in radians, centre (tangents), code
layout(location = 4) uniform vec4 overlay; // number of marks, their code; rows, white rows
layout(location = 5) uniform uint frame;
layout(location = 6) uniform vec4 marks[8];

layout(location = 0) out vec4 result;

const float pi = 3.14159265358979;
const float degrees_per_radian = 180.0 / pi;

// PCG (Jarzynski and Olano 2020, "Hash functions for GPU rendering", pcg3d): uniform in [0, 1).
float noise(uvec3 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    v ^= v >> 16u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    return float(v.x >> 8) * (1.0 / 16777216.0);
}

// Tangents on the screen of a pixel from the top left.
vec2 tangents(vec2 pixel) { return vec2(pixel.x - screen.x * 0.5, screen.y * 0.5 - pixel.y) * screen.z; }

float grating_luminance(vec2 pixel) {
    vec3 view = vec3(tangents(pixel), 1.0), axis = normalize(vec3(place.yz, 1.0));
    vec3 right = normalize(vec3(axis.z, 0.0, -axis.x)), up = cross(axis, right);
    vec2 angle = atan(vec2(dot(view, right), dot(view, up)), vec2(dot(view, axis))) * degrees_per_radian;
    float envelope = exp(-dot(angle, angle) / (2.0 * grating.w * grating.w));
    return grating.x * (1.0 + grating.y * envelope * cos(2.0 * pi * grating.z * angle.x + place.x));
}

// The highest code that is not brighter, and a share of the way to the next.
uint code_for(float luminance, float random) {
    uint below = 0u;
    for (uint step = 128u; step > 0u; step >>= 1)
        if (levels[below + step] <= luminance) below += step;
    if (below == 255u) return 255u;
    float share = (luminance - levels[below]) / (levels[below + 1u] - levels[below]);
    return random < share ? below + 1u : below;
}

void main() {
    vec2 pixel = gl_FragCoord.xy;
    if (screen.w < 0.5) pixel.y = screen.y - pixel.y;
    float code;
    if (kind == 1u) {
        bool is_white = mod(floor(pixel.y), overlay.z) < overlay.w;
        code = pixel.x < screen.x * 0.5 ? (is_white ? 1.0 : 0.0) : round(place.w * 255.0) / 255.0;
    } else {
        code = float(code_for(grating_luminance(pixel), noise(uvec3(uvec2(pixel), frame)))) / 255.0;
    }
    for (int i = 0; i < int(overlay.x); ++i)
        if (all(greaterThanEqual(pixel, marks[i].xy)) && all(lessThan(pixel, marks[i].zw))) code = overlay.y;
    result = vec4(vec3(code), 1.0);
}
