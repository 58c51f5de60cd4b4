// Puts vertices elsewhere: each move is a vertex and all seven values that the vertex buffer holds of it.
layout(local_size_x = 64) in;

struct Move {
    uint vertex;
    float values[7];
};
layout(std430, binding = 0) readonly buffer Moves {
    Move moves[];
};
layout(std430, binding = 1) writeonly buffer Window { // the part of the vertex buffer that is bound
    float values[];
};

layout(location = 0) uniform uint move_count;
layout(location = 1) uniform uint window_first; // vertex
layout(location = 2) uniform uint window_size;  // vertices

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= move_count)
        return;
    uint vertex = moves[i].vertex - window_first; // wraps to something large in front of the window
    if (vertex >= window_size)
        return;
    for (uint k = 0u; k < 7u; ++k)
        values[vertex * 7u + k] = moves[i].values[k];
}
