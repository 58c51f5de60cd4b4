// Pictures of the whole mesh in bands of frequency, and the contrasts between two of them.
#pragma once

#include <array>

#include "measure/fold_stages.h"
#include "measure/stage_picture.h"

namespace unseen::perception {

// A picture, split into bands.
class StageBands {
public:
    struct Band {
        Raster light, cover;           // less the means
        Raster mean_light, mean_cover; // over wider areas
    };

    StageBands() = default;
    explicit StageBands(const StagePicture& picture);
    const Band& operator[](std::size_t band) const { return bands_[band]; }

    // Becomes the bands of a picture of the same surfaces with `share` times the one's light and `other_share` times
    // the other's.
    void set_to_sum(const StageBands& picture, float share, const StageBands& other, float other_share);

private:
    static Raster split(Raster& plane, Raster& mean); // takes the mean away; returns the next level

    std::array<Band, FoldStage::band_count> bands_;
};

// What the contrasts are relative to; relative luminances.
struct StageSurround {
    float brightest = 1;            // of what is behind the mesh
    float black = FoldStage::black; // added to the local mean
};

// Raises the stage's contrasts to those of a difference of pictures.
void add_contrasts(const StageBands& mesh, const StageBands& difference, const StageSurround& around, FoldStage& stage);

} // namespace unseen::perception
