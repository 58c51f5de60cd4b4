// A band of a pyramid: a level less the next one, expanded. Of the REFERENCE its luminance and contrast, and of its BASE,
// which no level follows and which does not mask itself.
layout(binding = 0) uniform sampler2D fine;
#ifndef BASE
layout(binding = 1) uniform sampler2D coarse;
layout(location = 0) uniform ivec2 coarse_size;
layout(location = 1) uniform vec4 kernel;

// Between samples of the coarse level at even places; a coarse line ends with its last sample.
vec4 expanded(ivec2 at) {
    int first = 2 * at.x - 1, y = at.y / 2;
    vec4 here = four(coarse, first, y, coarse_size.x);
    vec4 below = four(coarse, first, min(y + 1, coarse_size.y - 1), coarse_size.x), c;
    if ((at.y & 1) == 1) {
        c = 2.0 * kernel.y * (here + below);
    } else {
        vec4 above = four(coarse, first, max(y - 1, 0), coarse_size.x);
        c = 2.0 * (kernel.x * here + kernel.z * (above + below));
    }
    if (first < 0)
        c.x = c.y;
    if (first + 2 >= coarse_size.x)
        c.z = c.y;
    if (first + 3 >= coarse_size.x)
        c.w = c.z;
    return 2.0 * vec4(kernel.x * c.y + kernel.z * (c.x + c.z), kernel.y * (c.y + c.z),
                      kernel.x * c.z + kernel.z * (c.y + c.w), kernel.y * (c.z + c.w));
}
#endif

#ifdef REFERENCE
layout(location = 2) uniform float least_luminance;

layout(location = 0) out vec4 luminance;
layout(location = 1) out vec4 contrast;
#else
layout(location = 0) out vec4 band;
#endif

void main() {
    ivec2 at = place();
    vec4 values = texelFetch(fine, at, 0);
#ifdef REFERENCE
#ifdef BASE
    luminance = max(values, vec4(least_luminance));
    contrast = vec4(0.0);
#else
    vec4 around = expanded(at);
    luminance = max(around, vec4(least_luminance));
    contrast = (values - around) / luminance;
#endif
#else
    band = values - expanded(at);
#endif
}
