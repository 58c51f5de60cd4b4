// The least elevation of thresholds in each cell of a grid over the picture, from one band's maskers: of all samples that
// stand in the cell, and those around it. A cell a fragment.
layout(binding = 0) uniform sampler2D maskers;
layout(location = 0) uniform ivec2 size;    // of the band
layout(location = 1) uniform vec4 masking;  // power, knee, least and largest masker
layout(location = 2) uniform ivec2 cell;    // pixels a side, the band's level
layout(location = 3) uniform ivec2 place_0; // of the grid's first cell, in what is drawn to

layout(location = 0) out float least;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy) - place_0, first = at * cell.x, last = first + cell.x - 1;
    ivec2 from = max((first >> cell.y) - 1, ivec2(0)), to = min((last >> cell.y) + 2, size - 1);
    float masker = largest_float;
    for (int y = from.y; y <= to.y; ++y)
        for (int x = from.x; x <= to.x; ++x)
            masker = min(masker, pixel(maskers, x, y));
    float raised = 1.0 + exact_exp2(masking.x * exact_log2(clamp(masker, masking.z, masking.w)));
    least = exact_exp2(exact_log2(raised) / masking.y);
}
