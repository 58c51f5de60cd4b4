// A picture as a plane of luminance, cd/m2; or, with DIFFERENCE, less the reference.
layout(binding = 0) uniform sampler2D picture;
#ifdef DIFFERENCE
layout(binding = 1) uniform sampler2D reference;
#endif
layout(location = 0) uniform ivec2 size;
layout(location = 1) uniform uint channel;
layout(location = 2) uniform vec4 to_luminance; // scale, offset

layout(location = 0) out vec4 values;

void main() {
    ivec2 at = place();
    vec4 cdm2;
    for (int i = 0; i < 4; ++i) {
        float value = texelFetch(picture, ivec2(min(4 * at.x + i, size.x - 1), at.y), 0)[channel];
        precise float luminance = value * to_luminance.x + to_luminance.y; // of equal pictures equal in both variants
        cdm2[i] = luminance;
    }
#ifdef DIFFERENCE
    values = cdm2 - texelFetch(reference, at, 0);
#else
    values = cdm2;
#endif
}
