// An image's pixel over the target's. Two outputs, because the coverage is not what a target keeps in a.
layout(binding = 0) uniform sampler2D image; // sRGB codes; a is the coverage
layout(location = 0) uniform vec4 place; // the image's left and top; the target's height, 1 if its first row is the top
layout(location = 1) uniform uint kind;  // 0 linear with luminance in a, 1 for displays, 2 the same in codes

layout(location = 0, index = 0) out vec4 colour; // times the coverage
layout(location = 0, index = 1) out vec4 coverage;

const vec3 rec709 = vec3(0.2126, 0.7152, 0.0722);

vec3 linear(vec3 code) {
    return mix(pow((code + 0.055) / 1.055, vec3(2.4)), code / 12.92, lessThanEqual(code, vec3(0.04045)));
}

void main() {
    vec2 pixel = gl_FragCoord.xy;
    if (place.w < 0.5) pixel.y = place.z - pixel.y;
    vec4 texel = texelFetch(image, ivec2(pixel) - ivec2(place.xy), 0);
    vec3 rgb = kind == 2u ? texel.rgb : linear(texel.rgb);
    colour = vec4(rgb, kind == 0u ? dot(rgb, rec709) : 1.0) * texel.a;
    coverage = vec4(texel.a);
}
