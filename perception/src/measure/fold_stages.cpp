#include "measure/fold_record.h"

namespace unseen::perception {
namespace {

constexpr auto& backgrounds = FoldStage::backgrounds;
constexpr float least_white = 1e-3f; // relative luminance: what is darker is not told from black

struct Numbers {
    std::size_t first, last;
};

// The first of those of `sorted` that `low..high` lies between, and the last.
template <std::size_t count>
Numbers around(const std::array<float, count>& sorted, float low, float high) {
    Numbers n{0, count - 1};
    while (n.first + 1 < count && sorted[n.first + 1] <= low) ++n.first;
    while (n.last > n.first && sorted[n.last - 1] >= high) --n.last;
    return n;
}

// For a mesh before a background `times` as bright as the brightest of the pictures. With its change l of light and c
// of cover, |l - times c| <= times |l - c| + (times - 1) |l|; and what that is divided by does not get less.
void include_brighter(const FoldStage& stage, float times, ContrastsByBand& contrast) {
    for (std::size_t b = 0; b < FoldStage::band_count; ++b)
        for (std::size_t row = 0; row < FoldStage::masks.size(); ++row)
            contrast[b][row] = std::max(contrast[b][row], times * stage.contrast[backgrounds.size() - 1][b][row] +
                                                              (times - 1) * stage.contrast[0][b][row]);
}

} // namespace

std::vector<FoldStage> LitStages::under(const Illumination& light) const {
    const float darkest = light.ambient + light.least, lightest = light.ambient + light.most;
    if (!(darkest >= least_white)) return {};
    const Numbers shares = around(ambient_shares, light.ambient / lightest, light.ambient / darkest);
    const float factor = std::max(1.0f, lightest * LitStages::black / FoldStage::black);
    std::vector<FoldStage> stages(stage_count());
    for (std::size_t stage = 0; stage < stages.size(); ++stage)
        // What lies between changes nothing: see above.
        for (const std::size_t share : {shares.first, shares.last}) {
            const FoldStage& from = by_share[share * stages.size() + stage];
            for (std::size_t k = 0; k < backgrounds.size(); ++k) {
                ContrastsByBand& to = stages[stage].contrast[k];
                const float low = backgrounds[k] / (brightest * lightest),
                            high = backgrounds[k] / (brightest * darkest);
                const Numbers behind = around(backgrounds, low, high);
                for (std::size_t i = behind.first; i <= behind.last; ++i) include(from.contrast[i], factor, to);
                if (high > 1) include_brighter(from, factor * high, to);
            }
        }
    return stages;
}

} // namespace unseen::perception
