// What a triangle knows of itself. FLAT: the mean of its corners' shades; WIREFRAME: the weights of its corners.
layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;

layout(location = 0) in vec4 shade[];

#ifdef FLAT
layout(location = 0) flat out vec4 surface_shade;
#else
layout(location = 0) out vec4 surface_shade;
#endif
layout(location = 1) out vec3 corner_weights;

#ifdef TEXTURED
layout(location = 2) in vec2 uv[];
layout(location = 2) out vec2 surface_uv;
#if defined(LIT) && !defined(RELIEF)
layout(location = 3) in float highlight[];
layout(location = 3) out float surface_highlight;
#endif
#endif

#if defined(CASTING) || defined(RELIEF)
layout(location = 4) in vec3 place[];
layout(location = 4) out vec3 surface_place;
#endif
#ifdef RELIEF
layout(location = 10) in vec4 normal_and_albedo[];
layout(location = 10) out vec4 surface_normal_and_albedo;
#elif defined(CASTING)
layout(location = 5) in vec4 cast_shade[][CASTING];
#ifdef FLAT
layout(location = 5) flat out vec4 surface_cast[CASTING];
#else
layout(location = 5) out vec4 surface_cast[CASTING];
#endif
#ifdef TEXTURED
layout(location = 9) in vec4 cast_highlights[];
layout(location = 9) out vec4 surface_cast_highlights;
#endif
#endif

invariant gl_Position;

void main() {
    for (int corner = 0; corner < 3; ++corner) {
        gl_Position = gl_in[corner].gl_Position;
#ifdef FLAT
        surface_shade = (shade[0] + shade[1] + shade[2]) / 3.0;
#else
        surface_shade = shade[corner];
#endif
        corner_weights = vec3(corner == 0, corner == 1, corner == 2);
#ifdef TEXTURED
        surface_uv = uv[corner];
#if defined(LIT) && !defined(RELIEF)
#ifdef FLAT
        surface_highlight = (highlight[0] + highlight[1] + highlight[2]) / 3.0;
#else
        surface_highlight = highlight[corner];
#endif
#endif
#endif
#if defined(CASTING) || defined(RELIEF)
        surface_place = place[corner];
#endif
#ifdef RELIEF
        surface_normal_and_albedo = normal_and_albedo[corner];
#elif defined(CASTING)
        for (int i = 0; i < CASTING; ++i)
#ifdef FLAT
            surface_cast[i] = (cast_shade[0][i] + cast_shade[1][i] + cast_shade[2][i]) / 3.0;
#else
            surface_cast[i] = cast_shade[corner][i];
#endif
#ifdef TEXTURED
#ifdef FLAT
        surface_cast_highlights = (cast_highlights[0] + cast_highlights[1] + cast_highlights[2]) / 3.0;
#else
        surface_cast_highlights = cast_highlights[corner];
#endif
#endif
#endif
        EmitVertex();
    }
    EndPrimitive();
}
