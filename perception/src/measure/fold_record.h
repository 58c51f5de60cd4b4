// What a tree keeps of a fold's measurement, as attributes: numbers as they were measured. No factor of the model is in
// them, and none includes the children's; <fold_errors.h> makes errors of them. The exceptions say so.
#pragma once

#include <string_view>

#include <unseen/vdtree/vertex_tree.h>

#include "measure/fold_stages.h"
#include "measure/measurement.h"

namespace unseen::perception {

inline constexpr std::string_view record_name = "fold_errors", facing_name = "fold_facing",
                                  stage_of_name = "fold_stage", stages_name = "fold_stages",
                                  settings_name = "fold_measurement", texture_name = "fold_texture";

// Of an interior node. Lengths in mesh units, luminances relative, 0..1. Neighbours: folded as far as nodes that are no
// larger than this one and not much richer in luminance, or not at all; the larger of the two counts.
struct FoldRecord {
    using Component = float;

    float shift = 0;         // the largest difference of the surfaces' heights, in the mean over a seventh of the width
    float farthest = 0;      // the largest distance of a point from the other surface
    float mean_distance = 0; // of points
    float largest_luminance = 0; // difference of a point from the nearest one of the other surface
    float mean_luminance = 0;
    // Half the mean distance of the ring's other corners from the proxy: what a fold changes is largest at the vertex
    // and fades to nothing there, so it is about as wide as this, in a radius, also where the support is small in a
    // ring of long triangles.
    float extent = 0;
    float gap = 0;  // to another part of the surface; infinite where none is near, 0 where they intersect
    float sine = 1; // of the least angle between such parts
    // By the picture's size and by band: of the difference of luminance, as amplitudes of gratings of the bands'
    // frequencies.
    float amplitudes[measurement::picture_sizes.size()][measurement::picture_bands] = {};
    // By how much the mean luminance of an area shifts, as a share of it, where all nodes like this one are folded:
    // that of an area 2^k times as wide as the node by at most bias / 2^(k fading / 2), for any k from 1 up to the
    // whole mesh. What is folded together, the model's errors decide.
    float bias = 0;
    // The largest distance between the surface's open border and what the fold makes of it; 0 where there is none. Seen
    // along the normal such a border moves as far as it does, whatever the heights.
    float border = 0;

    bool operator==(const FoldRecord&) const = default;
};
static_assert(sizeof(FoldRecord) == 18 * sizeof(float));

struct FoldFacing {
    using Component = std::uint8_t;

    // Of all triangles that touch the support, before and after the fold, with unfolded and with folded neighbours:
    // where all of these face the eye, or none does, the fold moves no outline.
    vdtree::NormalSlabs facing;
    std::uint8_t is_height_field = 0; // whether nothing is hidden under something else in the pictures
    // 0: as large over any area, systematic; 2: as random errors do; 3: errors that cancel each other.
    std::uint8_t fading = 0;

    bool operator==(const FoldFacing&) const = default;
};
static_assert(sizeof(FoldFacing) == 16);
inline constexpr std::uint8_t most_fading = 3;

// What a fold changes of a texture's detail; of textured trees alone.
inline constexpr std::size_t texture_octaves = 8;
inline constexpr float most_texture_contrast = 8;
struct FoldTexture {
    using Component = float;

    // Contrasts of gratings over the local mean, by how many octaves their waves are narrower than what changes is
    // wide; narrower ones count as the last.
    float contrast[texture_octaves] = {};
    float mean = 0;  // of the texture's luminance on the mesh around the node, 0..1
    float slide = 0; // of the texture over the surface, in the mean over some cells: as a share of the width, 0..1

    bool operator==(const FoldTexture&) const = default;
};
static_assert(sizeof(FoldTexture) == (texture_octaves + 2) * sizeof(float));
inline bool is_sound(const FoldTexture& texture) {
    bool sound = texture.mean >= 0 && texture.mean <= 1 && texture.slide >= 0 && texture.slide <= 1;
    for (const float contrast : texture.contrast) sound &= contrast >= 0 && contrast <= most_texture_contrast;
    return sound;
}

// Whether all of it are numbers that a measurement can give.
inline bool is_sound(const FoldRecord& r) {
    bool sound = r.gap >= 0 && r.sine <= 1;
    for (const float value : {r.shift, r.farthest, r.mean_distance, r.largest_luminance, r.mean_luminance, r.extent,
                              r.sine, r.bias, r.border})
        sound &= value >= 0 && std::isfinite(value);
    for (const auto& of_size : r.amplitudes)
        for (const float amplitude : of_size) sound &= amplitude >= 0 && std::isfinite(amplitude);
    return sound;
}

} // namespace unseen::perception
