// After the surface's own shader, whose main() is surface_main() here: drops the pixels that look like a picture.
layout(binding = 14) uniform sampler2D compared_picture;
layout(binding = 15) uniform sampler2D compared_thresholds; // cd/m2
layout(location = 110) uniform vec4 compared;                // channel, cd/m2 of a luminance of 1

void main() {
    surface_main();
    ivec2 at = ivec2(gl_FragCoord.xy);
    float there = texelFetch(compared_picture, at, 0)[int(compared.x)];
    float threshold = texelFetch(compared_thresholds, at, 0).r;
    if (abs(pixel.a - there) * compared.y < threshold) // false for what is no number
        discard;
}
