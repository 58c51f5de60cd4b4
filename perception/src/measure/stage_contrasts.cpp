#include "measure/stage_picture.h"

#include <numbers>
#include <utility>

#include "measure/registers.h"

namespace unseen::perception {

using namespace vdtree;

namespace {

// The share of a grating's amplitude that is left in cells, which show the mean over their area; cycles a cell.
double share_in_cells(double frequency) {
    return std::sin(std::numbers::pi * frequency) / (std::numbers::pi * frequency);
}

// The largest contrasts of a band. `Floats`: a register's, each lane with places of its own.
template <class Floats>
UNSEEN_INLINE void find_contrasts(const StageBands::Band& mesh, const StageBands::Band& difference, std::size_t band,
                                  const StageSurround& around, FoldStage& stage) {
    constexpr auto& masks = FoldStage::masks;
    constexpr std::size_t backgrounds = FoldStage::backgrounds.size(), width = width_of<Floats>;
    const auto magnitude = [](const Floats& v) UNSEEN_INLINE_LAMBDA { return v < 0 ? -v : v; };
    const float inverse_gain = 1 / static_cast<float>(band_gain(band) * share_in_cells(nominal_frequency(band)));
    Floats most[backgrounds][masks.size()] = {};
    const std::size_t count = difference.light.values.size();
    for (std::size_t first = 0; first < count; first += width) {
        const auto load = [&](const Raster& from) UNSEEN_INLINE_LAMBDA {
            Floats to{};
            if (first + width <= count) std::memcpy(&to, from.values.data() + first, sizeof to);
            else std::memcpy(&to, from.values.data() + first, (count - first) * sizeof(float));
            return to;
        };
        const Floats light = load(difference.light), cover = load(difference.cover);
        bool differs = false;
        for (std::size_t i = 0; i < width; ++i) differs |= (light[i] != 0) | (cover[i] != 0);
        if (!differs) continue;
        const Floats own_light = load(mesh.light), own_cover = load(mesh.cover), mean_light = load(mesh.mean_light),
                     mean_cover = load(mesh.mean_cover);
        for (std::size_t k = 0; k < backgrounds; ++k) {
            const float background = around.brightest * FoldStage::backgrounds[k];
            const Floats lit = mean_light + background * (1 - mean_cover), mean = lit < 0 ? Floats{} : lit;
            const Floats to_contrast = inverse_gain / (mean + around.black);
            const Floats mask = magnitude(own_light - background * own_cover) * to_contrast;
            const Floats contrast = magnitude(light - background * cover) * to_contrast;
            for (std::size_t row = 0; row < masks.size(); ++row) {
                Floats here = contrast;
                if (row > 0) here = mask >= masks[row] ? here : Floats{};
                if (row + 1 < masks.size()) here = mask >= masks[row + 1] ? Floats{} : here;
                most[k][row] = most[k][row] < here ? here : most[k][row];
            }
        }
    }
    for (std::size_t k = 0; k < backgrounds; ++k)
        for (std::size_t row = 0; row < masks.size(); ++row)
            for (std::size_t i = 0; i < width; ++i)
                stage.contrast[k][band][row] = std::max(stage.contrast[k][band][row], most[k][row][i]);
}
} // namespace

StageBands::StageBands(const StagePicture& picture) {
    Raster light = picture.light, cover = picture.cover;
    for (Band& band : bands_) {
        band.light = std::move(light), band.cover = std::move(cover);
        light = split(band.light, band.mean_light);
        cover = split(band.cover, band.mean_cover);
    }
}

Raster StageBands::split(Raster& plane, Raster& mean) {
    Raster next = reduce(plane);
    mean = expand(next, plane.side);
    for (std::size_t i = 0; i < plane.values.size(); ++i) plane.values[i] -= mean.values[i];
    return next;
}

void StageBands::set_to_sum(const StageBands& picture, float share, const StageBands& other, float other_share) {
    const auto sum = [&](const Raster& a, const Raster& b, Raster& to) {
        to.side = a.side;
        to.values.resize(a.values.size());
        for (std::size_t i = 0; i < a.values.size(); ++i)
            to.values[i] = share * a.values[i] + other_share * b.values[i];
    };
    for (std::size_t b = 0; b < FoldStage::band_count; ++b) {
        sum(picture[b].light, other[b].light, bands_[b].light);
        sum(picture[b].mean_light, other[b].mean_light, bands_[b].mean_light);
        bands_[b].cover = picture[b].cover, bands_[b].mean_cover = picture[b].mean_cover;
    }
}

void add_contrasts(const StageBands& mesh, const StageBands& difference, const StageSurround& around,
                   FoldStage& stage) {
    for (std::size_t b = 0; b < FoldStage::band_count; ++b)
        on_widest([&]<class Floats>()
                      UNSEEN_INLINE_LAMBDA { find_contrasts<Floats>(mesh[b], difference[b], b, around, stage); });
}

} // namespace unseen::perception
