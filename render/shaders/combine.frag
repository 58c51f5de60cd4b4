// Layers put together by their depths, all of them or all but one.
// What is nearer hides what is farther. Of equal depths the earlier layer is taken, and the background last, as where
// all is drawn at once.
layout(binding = 0) uniform sampler2DArray colours; // slice 0: the background
layout(binding = 1) uniform sampler2DArray depths;  // 1 at the near plane, 0 at infinity
#ifdef MASKED
layout(binding = 2) uniform sampler2D mask;        // of the layer that is left out: the share of their light ...
layout(binding = 3) uniform sampler2D mask_depths; // ... that its surfaces get, which are here
#endif
layout(location = 0) uniform ivec2 layers; // how many, the one that is left out (-1: none)

layout(location = 0) out vec4 pixel;

vec4 nearest_at(ivec2 at) {
    float nearest = 0.0;
    int chosen = 0;
    for (int i = 1; i <= layers.x; ++i) {
        if (i - 1 == layers.y)
            continue;
        float depth = texelFetch(depths, ivec3(at, i), 0).r;
        if (depth > nearest) {
            nearest = depth;
            chosen = i;
        }
    }
    float behind = texelFetch(depths, ivec3(at, 0), 0).r;
    if (behind > nearest) {
        nearest = behind;
        chosen = 0;
    }
    vec4 colour = texelFetch(colours, ivec3(at, chosen), 0);
#ifdef MASKED
    if (texelFetch(mask_depths, at, 0).r > nearest) // what is before the layer's surfaces hides their shadows
        colour *= texelFetch(mask, at, 0).r;
#endif
    return colour;
}

void main() { pixel = nearest_at(ivec2(gl_FragCoord.xy)); }
