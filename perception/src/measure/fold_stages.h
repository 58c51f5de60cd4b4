// What pictures of the whole mesh, folded in stages, show of the folds: for meshes that are seen from far away, or
// aside.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace unseen::perception {

// All nodes fold in one order, by about how much light each fold changes; after each stage a share of them is left.
// Pictures from directions all around (parallel projection, the mesh's sphere over 128 cells, 16 samples a cell) of the
// mesh and of the stage are split into bands of an octave each (Laplacian pyramid: Burt and Adelson 1983), and the
// largest contrast of their difference is noted.
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

    // Of a band: cycles over the diameter of VertexTree::bounding_sphere().
    static double frequency(std::size_t band);

    bool operator==(const FoldStage&) const = default;
};
// Of each contrast the larger one.
inline void include(const FoldStage& other, FoldStage& stage) {
    for (std::size_t k = 0; k < FoldStage::backgrounds.size(); ++k)
        for (std::size_t b = 0; b < FoldStage::band_count; ++b)
            for (std::size_t row = 0; row < FoldStage::masks.size(); ++row)
                stage.contrast[k][b][row] = std::max(stage.contrast[k][b][row], other.contrast[k][b][row]);
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
    // Of what white that faces the light has of it, which is 1 in the pictures. Ascending; the last one: no other
    // light.
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

} // namespace unseen::perception
