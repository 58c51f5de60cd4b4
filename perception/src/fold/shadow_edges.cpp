#include <map>

#include <unseen/perception/internal/shadow_edges.h>

#include "fold/pattern_eye.h"

namespace unseen::perception {
namespace {

// Illuminances range from a four-thousandth of white to white; more light than that is cut off.
constexpr int illuminance_octaves = 12, illuminances_per_octave = 4;
double illuminance_at(int i) {
    return std::exp2(static_cast<double>(i) / illuminances_per_octave - illuminance_octaves);
}

} // namespace

Result<ShadowEdges> ShadowEdges::create(const vdtree::View& view, const FoldTestOptions& options, double ambient) {
    if (const auto valid = check_arguments(view, options); !valid) return valid.error();
    if (const auto valid = validate(options.model); !valid) return valid.error();
    if (!(ambient >= 0 && ambient <= 1)) return invalid_argument("fold test: the ambient light must be from 0 to 1");
    const Screen screen(view, options);
    const PatternLevels levels(options.display);
    const CsfTable& csf = csf_of(options);
    const auto shared = pattern_bands(screen.highest_cpd, options.model, csf.samples().summation);
    const PatternBands& bands = *shared;
    std::map<int, PatternEye> eyes; // by luminance
    // Strips that are lit by `own`, whatever the angle: all that is below the illuminance occurs.
    std::vector<double> widest_strips;
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i <= illuminance_octaves * illuminances_per_octave; ++i) {
        const double own = illuminance_at(i), before = i > 0 ? illuminance_at(i - 1) : 0;
        const double mean = levels.in_cdm2(ambient + own / 2);
        const int luminance = levels.luminance_level(mean);
        auto eye = eyes.find(luminance);
        if (eye == eyes.end()) {
            const double cdm2 = levels.luminance(luminance);
            const Surround none{cdm2, 1}; // strips are not dimmed
            const Dimming dimming(bands, none, cdm2, screen.highest_cpd, options.model);
            eye = eyes.emplace(luminance, PatternEye(csf, 0, cdm2, screen, bands, dimming, options.model)).first;
        }
        const int contrast = levels.contrast_level(levels.difference_in_cdm2(own), mean);
        const double needed_widths =
            contrast == no_contrast ? 0
                                    : eye->second.strip_distance(PatternLevels::contrast(contrast), Course::one_way);
        // Between the last one's light and this one's, the widest is no less than this. Below the first, taken as
        // there.
        const double from = i > 0 ? before : own;
        if (needed_widths > 0) least = std::min(least, from / needed_widths);
        widest_strips.push_back(least);
    }
    return ShadowEdges(std::move(widest_strips));
}

double ShadowEdges::widest_unseen(double illuminance) const {
    if (!(illuminance > 0)) return illuminance <= 0 ? std::numeric_limits<double>::infinity() : 0;
    const double place = std::ceil((std::log2(illuminance) + illuminance_octaves) * illuminances_per_octave);
    const double last = static_cast<double>(widest_.size() - 1);
    return widest_[static_cast<std::size_t>(std::clamp(place, 0.0, last))] / illuminance;
}

} // namespace unseen::perception
