// Adds one sample's image to the sum. Sums are of differences from the background, so that background pixels stay
// exactly that, whatever the number of samples.
layout(binding = 0) uniform sampler2D sample_image;
layout(location = 0) uniform float background;

layout(location = 0) out vec4 difference;

void main() {
    difference = texelFetch(sample_image, ivec2(gl_FragCoord.xy), 0) - vec4(background);
}
