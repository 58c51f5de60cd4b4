// The surface's vertices, in the unit ball around the model. LIT: under lights, by the formula of <unseen/vdtree/lighting.h>.
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 vertex_shade; // linear RGB; relative luminance in a

layout(location = 0) uniform mat4 clip_from_unit;

#ifdef LIT
layout(location = 2) in ivec2 packed_normal; // octahedral, as in <unseen/vdtree/vertex_tree.h>
layout(location = 3) in float albedo;

const int none = -32768;
layout(location = 4) uniform vec4 material;  // ambient light, specular with its normalisation, shininess, the number of lights
layout(location = 5) uniform vec4 eye;
// Three a light. Direction (directional: towards it; spot: where it shines) and intensity (point and spot: at distance 1); position,
// and 0 for directional, 1 for point, 2 for spot; the cosines of the outer and the inner angle, and of a light that casts
// shadows its number among these, from 1 on.
layout(location = 6) uniform vec4 lights[3 * 16];

vec3 normal() {
    if (packed_normal.x == none || packed_normal.y == none)
        return vec3(0);
    vec2 p = vec2(packed_normal) / 32767.0;
    float z = 1.0 - abs(p.x) - abs(p.y);
    if (z < 0.0)
        p = (1.0 - abs(p.yx)) * mix(vec2(1), vec2(-1), lessThan(p, vec2(0)));
    return normalize(vec3(p, z));
}

#ifdef CASTING
vec2 blockable[CASTING]; // of each light that casts shadows, as lit_luminance() returns it of the others
#endif

// What the surface sends out by its albedo, and as a highlight.
vec2 lit_luminance() {
#ifdef CASTING
    for (int i = 0; i < CASTING; ++i)
        blockable[i] = vec2(0);
#endif
    vec3 n = normal();
    vec2 sum = vec2(material.x * albedo, 0.0);
    for (int i = 0; i < int(material.w); ++i) {
        vec3 direction = lights[3 * i].xyz;
        float intensity = lights[3 * i].w;
        float kind = lights[3 * i + 1].w;
        vec3 towards = direction;
        if (kind > 0.5) {
            vec3 offset = lights[3 * i + 1].xyz - position;
            float distance = max(length(offset), 1e-20);
            towards = offset / distance;
            intensity /= distance * distance;
            if (kind > 1.5)
                intensity *= smoothstep(lights[3 * i + 2].x, lights[3 * i + 2].y, -dot(towards, direction));
        }
        float facing = dot(n, towards);
        if (!(facing > 0.0))
            continue;
        vec2 share = vec2(albedo, 0.0);
        if (material.y > 0.0) {
            vec3 sum_of_both = towards + normalize(eye.xyz - position);
            vec3 half_way = sum_of_both / max(length(sum_of_both), 1e-20);
            share.y = material.y * pow(max(dot(n, half_way), 1e-20), material.z);
        }
#ifdef CASTING
        int number = int(lights[3 * i + 2].z);
        if (number > 0) {
            blockable[number - 1] = intensity * facing * share;
            continue;
        }
#endif
        sum += intensity * facing * share;
    }
    return sum;
}

// Of the colour that the vertex has.
vec4 shade_of(float luminance) {
    return vec4(vertex_shade.a > 0.0 ? vertex_shade.rgb * (luminance / vertex_shade.a) : vec3(luminance), luminance);
}
#endif

layout(location = 0) out vec4 shade;
#ifdef TEXTURED
layout(location = 4) in vec2 vertex_uv;
layout(location = 2) out vec2 uv;
#ifdef LIT
layout(location = 3) out float highlight; // which the texture does not colour
#endif
#endif
#ifdef CASTING
layout(location = 4) out vec3 place;
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
#ifdef LIT
    vec2 lit = lit_luminance();
#ifdef CASTING
    place = position;
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
