// The surface's vertices, in the unit ball around the model. LIT: under lights (lighting.glsl). RELIEF: pixels have normals of
// their own, and are lit by themselves.
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 vertex_shade; // linear RGB; relative luminance in a

layout(location = 0) uniform mat4 clip_from_unit;

#if defined(LIT) || defined(RELIEF)
layout(location = 2) in ivec2 packed_normal; // octahedral, as in <unseen/vdtree/vertex_tree.h>
layout(location = 3) in float albedo;

const int none = -32768;

vec3 normal() {
    if (packed_normal.x == none || packed_normal.y == none)
        return vec3(0);
    vec2 p = vec2(packed_normal) / 32767.0;
    float z = 1.0 - abs(p.x) - abs(p.y);
    if (z < 0.0)
        p = (1.0 - abs(p.yx)) * mix(vec2(1), vec2(-1), lessThan(p, vec2(0)));
    return normalize(vec3(p, z));
}
#endif

#ifdef LIT
// Of the colour that the vertex has.
vec4 shade_of(float luminance) {
    return vec4(vertex_shade.a > 0.0 ? vertex_shade.rgb * (luminance / vertex_shade.a) : vec3(luminance), luminance);
}
#endif

layout(location = 0) out vec4 shade; // RELIEF and LIT: of the luminance 1
#ifdef TEXTURED
layout(location = 4) in vec2 vertex_uv;
layout(location = 2) out vec2 uv;
#if defined(LIT) && !defined(RELIEF)
layout(location = 3) out float highlight; // which the texture does not colour
#endif
#endif
#if defined(CASTING) || defined(RELIEF)
layout(location = 4) out vec3 place;
#endif
#ifdef RELIEF
layout(location = 10) out vec4 normal_and_albedo;
#elif defined(CASTING)
layout(location = 5) out vec4 cast_shade[CASTING]; // added where the light is not hidden
#ifdef TEXTURED
layout(location = 9) out vec4 cast_highlights; // likewise, by light
#endif
#endif

// All variants of the program put a vertex at the same place, so that a wireframe lies on the surface it is of.
invariant gl_Position;

void main() {
    gl_Position = clip_from_unit * vec4(position, 1.0);
    shade = vertex_shade;
#ifdef TEXTURED
    uv = vertex_uv;
#endif
#if defined(CASTING) || defined(RELIEF)
    place = position;
#endif
#ifdef RELIEF
    normal_and_albedo = vec4(normal(), albedo);
#ifdef LIT
    shade = shade_of(1.0);
#endif
#elif defined(LIT)
    vec2 lit = lit_luminance(normal(), position, albedo);
#ifdef CASTING
#ifdef TEXTURED
    highlight = lit.y;
    shade = shade_of(lit.x);
    cast_highlights = vec4(0);
    for (int i = 0; i < CASTING; ++i) {
        cast_shade[i] = shade_of(blockable[i].x);
        cast_highlights[i] = blockable[i].y;
    }
#else
    shade = shade_of(lit.x + lit.y); // cut off at white once it is known which lights are hidden
    for (int i = 0; i < CASTING; ++i)
        cast_shade[i] = shade_of(blockable[i].x + blockable[i].y);
#endif
#else
#ifdef TEXTURED
    float luminance = lit.x;
    highlight = lit.y;
#else
    float luminance = min(lit.x + lit.y, 1.0);
#endif
    shade = shade_of(luminance);
#endif
#endif
}
