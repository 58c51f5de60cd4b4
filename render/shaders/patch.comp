// Applies what changed of an index buffer: pairs of a place and its new value.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Writes {
    uvec2 writes[];
};
layout(std430, binding = 1) writeonly buffer Window { // the part of the index buffer that is bound
    uint indices[];
};

layout(location = 0) uniform uint write_count;
layout(location = 1) uniform uint window_first; // place
layout(location = 2) uniform uint window_size;  // places

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= write_count)
        return;
    uint place = writes[i].x - window_first; // wraps to something large in front of the window
    if (place < window_size)
        indices[place] = writes[i].y;
}
