// Means of two by two; what lies outside is 0.
layout(binding = 0) uniform sampler2D plane;
layout(location = 0) uniform ivec2 size; // of the plane

layout(location = 0) out vec4 values;

vec4 inside(int column, int y) {
    return column <= last_column(size.x) && y < size.y ? texelFetch(plane, ivec2(column, y), 0) : vec4(0.0);
}

void main() {
    ivec2 at = place();
    vec4 left = inside(2 * at.x, 2 * at.y) + inside(2 * at.x, 2 * at.y + 1);
    vec4 right = inside(2 * at.x + 1, 2 * at.y) + inside(2 * at.x + 1, 2 * at.y + 1);
    values = 0.25 * vec4(left.xz + left.yw, right.xz + right.yw);
}
