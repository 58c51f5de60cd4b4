// Takes up what changed of a cut: a triangle with its leaves at the corners, or leaves for which another wedge stands.
layout(local_size_x = 64) in;

const uint is_run = 0xffffffffu; // no leaf has this number

layout(std430, binding = 0) readonly buffer Changes {
    uvec4 changes[]; // slot and leaves; or the first leaf, how many, the wedge, and is_run
};
layout(std430, binding = 1) writeonly buffer Corners {
    uint leaf_at_corner[];
};
layout(std430, binding = 2) writeonly buffer Wedges {
    uint wedge_of_leaf[];
};

layout(location = 0) uniform uint change_count;

void take_up(uvec4 change) {
    if (change.w == is_run) {
        for (uint i = 0; i < change.y; ++i)
            wedge_of_leaf[change.x + i] = change.z;
        return;
    }
    for (uint k = 0; k < 3; ++k)
        leaf_at_corner[3 * change.x + k] = change[k + 1];
}

void main() {
    for (uint i = gl_GlobalInvocationID.x; i < change_count; i += gl_NumWorkGroups.x * gl_WorkGroupSize.x)
        take_up(changes[i]);
}
