// Light from lights, by the formula of <unseen/vdtree/lighting.h>: of vertices, or of pixels that have a relief.
layout(location = 4) uniform vec4 material;  // ambient light, specular with its normalisation, shininess, the number of lights
layout(location = 5) uniform vec4 eye;
// Three a light. Direction (directional: towards it; spot: where it shines) and intensity (point and spot: at distance 1); position,
// and 0 for directional, 1 for point, 2 for spot; the cosines of the outer and the inner angle, and of a light that casts
// shadows its number among these, from 1 on.
layout(location = 6) uniform vec4 lights[3 * 16];

#ifdef CASTING
vec2 blockable[CASTING]; // of each light that casts shadows, as lit_luminance() returns it of the others
#endif

// What a surface of this normal and albedo sends out by the albedo, and as a highlight. `place`: in the unit frame.
vec2 lit_luminance(vec3 n, vec3 place, float albedo) {
#ifdef CASTING
    for (int i = 0; i < CASTING; ++i)
        blockable[i] = vec2(0);
#endif
    vec2 sum = vec2(material.x * albedo, 0.0);
    for (int i = 0; i < int(material.w); ++i) {
        vec3 direction = lights[3 * i].xyz;
        float intensity = lights[3 * i].w;
        float kind = lights[3 * i + 1].w;
        vec3 towards = direction;
        if (kind > 0.5) {
            vec3 offset = lights[3 * i + 1].xyz - place;
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
            vec3 sum_of_both = towards + normalize(eye.xyz - place);
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
