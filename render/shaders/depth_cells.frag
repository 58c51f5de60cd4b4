// What a square cell of a depth picture holds, for one sample a pixel: a cell a fragment. Reversed depth is near /
// distance.
layout(binding = 0) uniform sampler2D depths;
layout(location = 0) uniform vec4 drawn; // the part that was drawn to, the last column and row excluded
layout(location = 1) uniform vec4 cell;  // pixels a side, the near plane's reciprocal, the picture's size

// Negatives, so that one blending keeps the extremes of all samples: the least.
layout(location = 0) out vec4 least; // least, -most, -largest difference between neighbours

float at(int x, int y) {
    ivec2 place = clamp(ivec2(x, y), ivec2(0), ivec2(cell.zw) - 1);
    bool is_drawn = all(greaterThanEqual(place, ivec2(drawn.xy))) && all(lessThan(place, ivec2(drawn.zw)));
    return is_drawn ? texelFetch(depths, place, 0).x : 0.0;
}

void main() {
    int side = int(cell.x);
    ivec2 first = ivec2(gl_FragCoord.xy) * side, last = min(first + side, ivec2(cell.zw)) - 1;
    float smallest = at(first.x, first.y), largest = smallest, jump = 0.0;
    // Each pixel with the ones before and above it, and those after and below the cell with its last ones.
    for (int y = first.y; y <= last.y + 1; ++y) {
        float before = at(first.x - 1, y);
        for (int x = first.x; x <= last.x + 1; ++x) {
            float here = at(x, y);
            if (y <= last.y)
                jump = max(jump, abs(here - before));
            if (x <= last.x)
                jump = max(jump, abs(here - at(x, y - 1)));
            if (x <= last.x && y <= last.y) {
                smallest = min(smallest, here);
                largest = max(largest, here);
            }
            before = here;
        }
    }
    least = vec4(smallest, -largest, -jump, 0.0) * cell.y;
}
