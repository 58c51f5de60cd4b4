// After the surface's own shader, whose main() is surface_main() here: drops the pixels outside of a range of an ordered
// pattern, so that items with ranges that meet share the pixels.
layout(location = 111) uniform vec2 stipple; // from .. below; the pattern is of 16 levels in 0..1

const uint pattern[16] = uint[16](0u, 8u, 2u, 10u, 12u, 4u, 14u, 6u, 3u, 11u, 1u, 9u, 15u, 7u, 13u, 5u);

void main() {
    surface_main();
    ivec2 at = ivec2(gl_FragCoord.xy) & 3;
    float level = (float(pattern[4 * at.y + at.x]) + 0.5) / 16.0;
    if (!(level >= stipple.x && level < stipple.y))
        discard;
}
