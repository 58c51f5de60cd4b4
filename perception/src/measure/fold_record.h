// What a tree keeps of a fold's measurement, as attributes: numbers as they were measured. No factor of the model is in
// them, and none includes the children's; <fold_errors.h> makes errors of them. The exceptions say so.
#pragma once

#include <algorithm>
#include <cmath>

#include <unseen/vdtree/vertex_tree.h>

#include "measure/measurement.h"

namespace unseen::perception {

// All nodes fold in one order, by about how much light each fold changes; after each stage a share of them is left.
// The mesh and the stage are drawn from directions all around (parallel projection, the mesh's sphere over 128 cells, 16
// samples a cell). The pictures are split into bands of an octave each (Laplacian pyramid: Burt and Adelson 1983). The
// record holds the largest contrast of their difference.
//
// A measurement, not a bound: the eye may stand between the directions, and near the mesh its picture is another one.
struct FoldStage {
    using Component = float;

    // Relative luminances behind the mesh. With any one between two of these, contrasts are no larger than the larger
    // ones of the two: the difference is linear in the background, and so is what it is divided by.
    static constexpr std::array<float, 9> backgrounds = {0, 0.02f, 0.05f, 0.1f, 0.15f, 0.2f, 0.3f, 0.5f, 1};
    // Contrasts of the mesh's own picture in the same band and place, from which on a row of contrasts counts: what may
    // mask the difference.
    static constexpr std::array<float, 6> masks = {0, 0.01f, 0.03f, 0.1f, 0.3f, 1};
    static constexpr std::size_t band_count = 11; // each half the frequency of the one before
    // Added to what luminances are divided by: about a display's black.
    static constexpr float black = 0.005f;

    // Differences over the local mean luminance of the mesh's picture, amplitudes of gratings; by background, band and
    // mask.
    float contrast[backgrounds.size()][band_count][masks.size()] = {};

    // The frequency of a band: cycles over the diameter of VertexTree::bounding_sphere().
    static double frequency(std::size_t band);

    bool operator==(const FoldStage&) const = default;
};
// Keeps the larger one of each contrast.
using ContrastsByBand = float[FoldStage::band_count][FoldStage::masks.size()];
inline void include(const ContrastsByBand& other, float factor, ContrastsByBand& contrast) {
    for (std::size_t b = 0; b < FoldStage::band_count; ++b)
        for (std::size_t row = 0; row < FoldStage::masks.size(); ++row)
            contrast[b][row] = std::max(contrast[b][row], factor * other[b][row]);
}
inline void include(const FoldStage& other, FoldStage& stage) {
    for (std::size_t k = 0; k < FoldStage::backgrounds.size(); ++k) include(other.contrast[k], 1, stage.contrast[k]);
}
// Whether all of it are numbers that a measurement can give.
inline bool is_sound(const FoldStage& stage) {
    bool sound = true;
    for (const auto& by_band : stage.contrast)
        for (const auto& by_mask : by_band)
            for (const float contrast : by_mask) sound &= contrast >= 0 && std::isfinite(contrast);
    return sound;
}
static_assert(sizeof(FoldStage) == sizeof(float) * 9 * 11 * 6);

// What white that faces all lights of a scene has of them, somewhere on the mesh; relative luminance.
struct Illumination {
    float ambient = 0;
    float least = 0, most = 0; // of the lights together
};

// Pictures are taken under single lights, from before the mesh as it is seen, from aside and from behind, in turn all
// around it, and of these with several shares of ambient light. Kept is the largest contrast of any of the lights, for
// each share.
//
// That serves all other lights, too. Let a mesh's picture be m and a change of it d, both of a light alone. Under
// several lights the contrast is sum d / sum m, which is no more than the largest d / m of one of the lights with its
// part of the ambient light. And with a share of ambient light between two of these here, or with the mesh partly in
// shadow, a contrast is no more than the larger one of the two: d and m are linear in the share. That is so of each
// place. What masks a change there is taken from the picture of the single light: a measurement, as all of the stages.
struct LitStages {
    // Shares of the light on a white surface that faces it, which is 1 in the pictures. Ascending; the last one: no
    // other light.
    static constexpr std::array<float, 5> ambient_shares = {0, 0.1f, 0.2f, 0.4f, 1};
    static constexpr std::size_t lights = 3; // of a direction
    // What FoldStage::backgrounds are shares of, for a mesh in the shade may stand before what is not.
    static constexpr float brightest = 4;
    // Added to what luminances are divided by: that of FoldStage, for white up to twice as bright as a display's.
    static constexpr float black = FoldStage::black / 2;

    std::vector<FoldStage> by_share; // the stages of the first share, those of the second, ...

    std::size_t stage_count() const { return by_share.size() / ambient_shares.size(); }
    // The stages under such light. None where there are none, or where somewhere on the mesh there is no light at all.
    std::vector<FoldStage> under(const Illumination& light) const;
};

inline constexpr std::string_view record_name = "fold_errors", facing_name = "fold_facing",
                                  stage_of_name = "fold_stage", stages_name = "fold_stages",
                                  settings_name = "fold_measurement", texture_name = "fold_texture";

// What is measured of an interior node. Lengths in mesh units, luminances relative, 0..1. Neighbours: folded as far as
// nodes that are no larger than this one and not much richer in luminance, or not at all; the larger of the two counts.
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
    float thickness = 0; // the mean width of a ring that is narrower than its pictures' cells; 0: it is not

    bool operator==(const FoldRecord&) const = default;
};
static_assert(sizeof(FoldRecord) == 19 * sizeof(float));

struct FoldFacing {
    using Component = std::uint8_t;

    // The normals of all triangles that touch the support, before and after the fold, with unfolded and with folded
    // neighbours: where all of these face the eye, or none does, the fold moves no outline.
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
                              r.sine, r.bias, r.border, r.thickness})
        sound &= value >= 0 && std::isfinite(value);
    for (const auto& of_size : r.amplitudes)
        for (const float amplitude : of_size) sound &= amplitude >= 0 && std::isfinite(amplitude);
    return sound;
}

} // namespace unseen::perception
