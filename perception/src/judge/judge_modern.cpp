// The modern visibility map: a decimated Laplacian pyramid of the reference and of the difference, each band weighted
// by the contrast sensitivity at its frequency (judge/band_weights.h), masked by the reference, and pooled over the
// bands.
#include <perception/judge.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "judge/band_weights.h"
#include "judge/judge_input.h"
#include "judge/masking.h"
#include "pyramid_kernel.h"

namespace unseen::perception {
namespace {

constexpr double contrast_limit = 1000; // of one band, so that a black reference stays finite

// ---- images -------------------------------------------------------------------------------------------------------

struct Plane {
    int width = 0, height = 0;
    std::vector<double> values;
    Plane(int w, int h) : width(w), height(h), values(static_cast<std::size_t>(w) * static_cast<std::size_t>(h)) {}
    double* row(int y) { return values.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width); }
    const double* row(int y) const {
        return values.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
    }
};

// Mirrored about the outermost pixels; an image narrower than the kernel repeats its last one.
int mirrored(int i, int n) {
    if (i < 0) i = -i;
    if (i >= n) i = 2 * (n - 1) - i;
    return std::clamp(i, 0, n - 1);
}

// One axis of the reduction: out[i] = sum of the five pixels around in[2 i].
template <class Read>
double reduced(int i, int n, Read in) {
    const int c = 2 * i;
    return kernel_middle * in(c) + kernel_near * (in(mirrored(c - 1, n)) + in(mirrored(c + 1, n))) +
           kernel_far * (in(mirrored(c - 2, n)) + in(mirrored(c + 2, n)));
}
// One axis of the expansion: pixel x between coarse samples at even positions; the coarse row ends with its last
// sample.
template <class Read>
double expanded(int x, int coarse_n, Read in) {
    const int c = x / 2, next = std::min(c + 1, coarse_n - 1);
    if (x % 2 == 1) return 2 * kernel_near * (in(c) + in(next));
    return 2 * (kernel_middle * in(c) + kernel_far * (in(std::max(c - 1, 0)) + in(next)));
}

Plane reduce(const Plane& in) {
    Plane rows((in.width + 1) / 2, in.height), out(rows.width, (in.height + 1) / 2);
    for (int y = 0; y < in.height; ++y) {
        const double* line = in.row(y);
        for (int x = 0; x < rows.width; ++x) rows.row(y)[x] = reduced(x, in.width, [&](int i) { return line[i]; });
    }
    for (int y = 0; y < out.height; ++y) {
        for (int x = 0; x < out.width; ++x) {
            out.row(y)[x] = reduced(y, in.height, [&](int i) { return rows.row(i)[x]; });
        }
    }
    return out;
}

Plane expand(const Plane& coarse, int width, int height) {
    Plane rows(width, coarse.height), out(width, height);
    for (int y = 0; y < coarse.height; ++y) {
        const double* line = coarse.row(y);
        for (int x = 0; x < width; ++x) rows.row(y)[x] = expanded(x, coarse.width, [&](int i) { return line[i]; });
    }
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            out.row(y)[x] = expanded(y, coarse.height, [&](int i) { return rows.row(i)[x]; });
        }
    }
    return out;
}

// The binomial filter (1 2 1)/4 along both axes, whose response the tilt uses.
Plane smooth(const Plane& in) {
    Plane rows(in.width, in.height), out(in.width, in.height);
    for (int y = 0; y < in.height; ++y) {
        const double* line = in.row(y);
        for (int x = 0; x < in.width; ++x) {
            rows.row(y)[x] = 0.5 * line[x] + 0.25 * (line[mirrored(x - 1, in.width)] + line[mirrored(x + 1, in.width)]);
        }
    }
    for (int y = 0; y < in.height; ++y) {
        const double *above = rows.row(mirrored(y - 1, in.height)), *below = rows.row(mirrored(y + 1, in.height));
        for (int x = 0; x < in.width; ++x) out.row(y)[x] = 0.5 * rows.row(y)[x] + 0.25 * (above[x] + below[x]);
    }
    return out;
}

// ---- the bands of an image pair -----------------------------------------------------------------------------------

// One band at its own resolution: contrasts relative to the reference's local luminance, and their tilted companions.
struct Band {
    int level = 0;
    bool is_base = false;
    Plane luminance;  // cd/m2, floored
    Plane reference;  // contrast
    Plane difference; // contrast
};

// The luminance and the two contrasts of one band; leaves the next levels in `reference` and `difference`.
Band split_band(Plane& reference, Plane& difference, int level, double floor_cdm2) {
    Plane next_reference = reduce(reference), next_difference = reduce(difference);
    Band band{level, false, expand(next_reference, reference.width, reference.height), std::move(reference),
              std::move(difference)};
    const Plane back = expand(next_difference, band.luminance.width, band.luminance.height);
    for (std::size_t i = 0; i < back.values.size(); ++i) {
        double& luminance = band.luminance.values[i];
        band.reference.values[i] -= luminance;
        band.difference.values[i] -= back.values[i];
        luminance = std::max(luminance, floor_cdm2);
        band.reference.values[i] = std::clamp(band.reference.values[i] / luminance, -contrast_limit, contrast_limit);
        band.difference.values[i] = std::clamp(band.difference.values[i] / luminance, -contrast_limit, contrast_limit);
    }
    reference = std::move(next_reference);
    difference = std::move(next_difference);
    return band;
}

// What the pyramid did not split: the contrast of the difference against the level itself; a base does not mask itself.
Band base_band(Plane& reference, Plane& difference, int level, double floor_cdm2) {
    Band band{level, true, std::move(reference), Plane(0, 0), std::move(difference)};
    band.reference = Plane(band.luminance.width, band.luminance.height);
    for (std::size_t i = 0; i < band.luminance.values.size(); ++i) {
        double& luminance = band.luminance.values[i];
        luminance = std::max(luminance, floor_cdm2);
        band.difference.values[i] = std::clamp(band.difference.values[i] / luminance, -contrast_limit, contrast_limit);
    }
    return band;
}

// Calls `use(band)` for each band from fine to coarse; only one is held at a time.
template <class Use>
void for_each_band(const Image& reference, const Image* test, int base, double floor_cdm2, Use use) {
    Plane r(reference.width, reference.height), d(reference.width, reference.height);
    for (std::size_t i = 0; i < r.values.size(); ++i) {
        r.values[i] = reference.values[i];
        if (test != nullptr) d.values[i] = static_cast<double>(test->values[i]) - r.values[i];
    }
    for (int level = 0; level < base; ++level) use(split_band(r, d, level, floor_cdm2));
    use(base_band(r, d, base, floor_cdm2));
}

// A band's table is made when its luminances are known; `Visit` gets the sample index, the weight there, and the
// reference's and the difference's contrast, gain and tilt applied.
template <class Visit>
void for_each_sample(const Band& band, const BandConditions& conditions, const Eccentricity& eccentricity,
                     bool skip_equal, Visit visit) {
    const BandTable table(conditions, band.level, band.is_base);
    const Plane smooth_reference = smooth(band.reference), smooth_difference = smooth(band.difference);
    const double step = std::exp2(band.level);
    for (int y = 0; y < band.luminance.height; ++y) {
        for (int x = 0; x < band.luminance.width; ++x) {
            const std::size_t i = static_cast<std::size_t>(y) * static_cast<std::size_t>(band.luminance.width) +
                                  static_cast<std::size_t>(x);
            const double d = band.difference.values[i], d_smooth = smooth_difference.values[i];
            if (skip_equal && d == 0 && d_smooth == 0) continue;
            const BandWeight weight =
                table.at(std::log10(band.luminance.values[i]), eccentricity.at_pixel(x * step, y * step));
            const double r = band.reference.values[i], r_smooth = smooth_reference.values[i];
            const auto tilted = [&](double c, double c_smooth) {
                return std::abs(c + weight.tilt * (c_smooth - table.smooth_at_nominal() * c)) / table.gain();
            };
            visit(i, weight.sensitivity, tilted(r, r_smooth), tilted(d, d_smooth));
        }
    }
}

// ---- images out ----------------------------------------------------------------------------------------------------

Image as_image(const Plane& plane) {
    Image image{plane.width, plane.height, 1, {}};
    image.values.reserve(plane.values.size());
    for (const double v : plane.values) {
        image.values.push_back(static_cast<float>(std::min<double>(v, std::numeric_limits<float>::max())));
    }
    return image;
}

} // namespace

Result<Judgement> judge_modern(const Image& reference, const Image& test, const JudgeOptions& options) {
    if (auto ok = check(options); !ok) return ok.error();
    if (auto ok = check_luminance_pair("judge", reference, test); !ok) return ok.error();
    const Eccentricity eccentricity(reference, options);
    const BandConditions conditions = conditions_for(Stimuli::patches, 1, reference, options, eccentricity);
    const int base = base_level(reference, conditions.ppd);

    Plane sum(reference.width, reference.height);
    for_each_band(reference, &test, base, contrast_floor(options.display), [&](const Band& band) {
        Plane powers(band.luminance.width, band.luminance.height);
        for_each_sample(band, conditions, eccentricity, true, [&](std::size_t i, double s, double mask, double change) {
            powers.values[i] = std::pow(change * s / daly_elevation(mask * s), options.beta);
        });
        spread(powers, band.level, sum, [](double& to, double from) { to += from; });
    });

    Judgement judgement;
    judgement.pixels = sum.values.size();
    for (double& v : sum.values) {
        if (v != 0) v = std::pow(v, 1 / options.beta);
        judgement.visible_pixels += !(v < 1);
        judgement.max_ratio = std::max(judgement.max_ratio, v);
    }
    judgement.visibility = as_image(sum);
    return judgement;
}

Result<Image> threshold_map_modern(const Image& reference, const JudgeOptions& options) {
    if (auto ok = check(options); !ok) return ok.error();
    if (auto ok = check_luminance("judge", reference, "reference"); !ok) return ok.error();
    const Eccentricity eccentricity(reference, options);
    const BandConditions conditions = conditions_for(Stimuli::patches, 1, reference, options, eccentricity);
    const int base = base_level(reference, conditions.ppd);

    Plane threshold(reference.width, reference.height);
    std::fill(threshold.values.begin(), threshold.values.end(), std::numeric_limits<double>::infinity());
    for_each_band(reference, nullptr, base, contrast_floor(options.display), [&](const Band& band) {
        Plane steps(band.luminance.width, band.luminance.height);
        for_each_sample(band, conditions, eccentricity, false, [&](std::size_t i, double s, double mask, double) {
            steps.values[i] = band.luminance.values[i] * daly_elevation(mask * s) / s;
        });
        spread(steps, band.level, threshold, [](double& to, double from) { to = std::min(to, from); });
    });
    return as_image(threshold);
}

} // namespace unseen::perception
