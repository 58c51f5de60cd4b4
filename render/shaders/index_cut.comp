// Makes a cut's index buffer: at every corner the wedge that stands for its leaf.
layout(local_size_x = 256) in;

layout(std430, binding = 1) readonly buffer Corners {
    uint leaf_at_corner[];
};
layout(std430, binding = 2) readonly buffer Wedges {
    uint wedge_of_leaf[];
};
layout(std430, binding = 3) writeonly buffer Indices {
    uint indices[];
};

layout(location = 0) uniform uint corner_count;

void main() {
    for (uint i = gl_GlobalInvocationID.x; i < corner_count; i += gl_NumWorkGroups.x * gl_WorkGroupSize.x)
        indices[i] = wedge_of_leaf[leaf_at_corner[i]];
}
