// A plane as a texture of one pixel a texel, for everybody.
layout(binding = 0) uniform sampler2D plane;

layout(location = 0) out float value;

void main() { value = pixel(plane, int(gl_FragCoord.x), int(gl_FragCoord.y)); }
