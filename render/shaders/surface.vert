// The surface's vertices, in the unit ball around the model.
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 vertex_shade; // linear RGB; relative luminance in a

layout(location = 0) uniform mat4 clip_from_unit;

layout(location = 0) out vec4 shade;

// All variants of the program put a vertex at the same place, so that a wireframe lies on the surface it is of.
invariant gl_Position;

void main() {
    gl_Position = clip_from_unit * vec4(position, 1.0);
    shade = vertex_shade;
}
