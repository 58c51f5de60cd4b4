// What pictures of the whole mesh, folded in stages, show of the folds under lights that are not known yet.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "measure/fold_stages.h"

namespace unseen::perception {

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
