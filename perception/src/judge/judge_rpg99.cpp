// The threshold map of Ramasubramanian, Pattanaik and Greenberg 1999 with the choices of Yee's PerceptualDiff 2.1,
// for comparison with older results. Three of its faults are kept on purpose, since without them it would be another
// judge: the field in degrees, not the pixels of a degree, chooses the adaptation level; its "pyramid" blurs at full
// resolution, so the bands are no octaves; the error masks itself.
#include <unseen/perception/internal/judge_tables.h>

#include <limits>

#include "csf/csf_model.h"
#include "judge/judge_input.h"

namespace unseen::perception {
namespace {

constexpr std::size_t level_count = 8;
constexpr std::size_t band_count = level_count - 2; // a band needs its level and the two below
constexpr double contrast_floor = 1e-5;             // of denominators: cd/m2 or contrast
constexpr double csf_peak_frequency = 3.248;        // cpd, of the CSF below at 100 cd/m2
constexpr double csf_reference_luminance = 100;     // cd/m2
constexpr double largest_elevation = 10;
constexpr std::array<double, 5> kernel = {0.05, 0.25, 0.4, 0.25, 0.05};
// Resolution of tables. Where TVI has a step or a bend, a table errs by up to 3% within one node's distance; elsewhere
// by 1e-5.
constexpr int nodes_an_octave = 128;
constexpr int first_octave = -17, last_octave = 20; // 0.8e-5 to 1e6 cd/m2: around the floor, and beyond the sun on snow
constexpr float least_log2 = -126;                  // of a float: a sensitivity below it is none

// Threshold versus intensity, cd/m2 (Ward Larson et al. 1997 after Ferwerda et al. 1996).
double tvi(double luminance) {
    const double x = std::log10(luminance);
    double y = 0;
    if (x < -3.94) y = -2.86;
    else if (x < -1.44) y = std::pow(0.405 * x + 1.6, 2.18) - 2.86;
    else if (x < -0.0184) y = x - 0.395;
    else if (x < 1.9) y = std::pow(0.249 * x + 0.65, 2.7) - 0.72;
    else y = x - 1.255;
    return std::pow(10.0, y);
}

// Daly 1993, s = 0.7 and b = 4, with the rounded constants of the program.
constexpr double masking_scale = 0.0153, masking_gain = 392.498, masking_power = 0.7;
double masking(double normalised_contrast) {
    const double t = masking_scale * std::pow(masking_gain * normalised_contrast, masking_power);
    return std::sqrt(std::sqrt(1 + t * t * t * t));
}

using Plane = std::vector<double>;

// -k becomes k and n + k becomes n - k - 1; repeated, since an image may be smaller than the kernel.
std::size_t mirrored(long i, long n) {
    while (i < 0 || i >= n) i = i < 0 ? std::min(-i, n - 1) : std::max(2 * n - i - 1, 0L);
    return static_cast<std::size_t>(i);
}

Plane blurred(const Plane& in, int width, int height) {
    const auto w = static_cast<std::size_t>(width);
    Plane rows(in.size()), out(in.size());
    for (int y = 0; y < height; ++y) {
        const double* line = in.data() + static_cast<std::size_t>(y) * w;
        for (int x = 0; x < width; ++x) {
            double sum = 0;
            for (int k = -2; k <= 2; ++k) sum += kernel[static_cast<std::size_t>(k + 2)] * line[mirrored(x + k, width)];
            rows[static_cast<std::size_t>(y) * w + static_cast<std::size_t>(x)] = sum;
        }
    }
    for (int y = 0; y < height; ++y) {
        double* line = out.data() + static_cast<std::size_t>(y) * w;
        for (int k = -2; k <= 2; ++k) {
            const double* from = rows.data() + mirrored(y + k, height) * w;
            for (std::size_t x = 0; x < w; ++x) line[x] += kernel[static_cast<std::size_t>(k + 2)] * from[x];
        }
    }
    return out;
}

std::vector<Plane> blur_levels(const Image& image) {
    std::vector<Plane> levels;
    levels.emplace_back(image.values.begin(), image.values.end());
    while (levels.size() < level_count) levels.push_back(blurred(levels.back(), image.width, image.height));
    return levels;
}

// Everything that depends on the field and the image's width alone.
struct Bands {
    std::array<double, band_count> frequency{};        // cpd
    std::array<double, band_count> frequency_factor{}; // CSF at its peak over CSF at the band
    std::size_t adaptation_level = 0;
};

Bands make_bands(double field_degrees, int width) {
    const double degrees = 2 * std::tan(field_degrees * std::numbers::pi / 360) * 180 / std::numbers::pi;
    Bands bands;
    double frequency = 0.5 * width / degrees;
    const Barten1989 csf(csf_reference_luminance);
    for (std::size_t i = 0; i < band_count; ++i, frequency *= 0.5) {
        bands.frequency[i] = frequency;
        bands.frequency_factor[i] = csf(csf_peak_frequency) / csf(frequency);
    }
    for (double pixels = 1; bands.adaptation_level + 1 < level_count && pixels <= degrees; pixels *= 2)
        ++bands.adaptation_level;
    return bands;
}

double elevation(const std::array<double, band_count>& contrast, const Bands& bands, double adaptation) {
    const Barten1989 csf(adaptation);
    double sum = 0, weighted = 0;
    for (std::size_t i = 0; i < band_count; ++i) {
        sum += contrast[i];
        if (contrast[i] > 0)
            weighted += contrast[i] * bands.frequency_factor[i] * masking(contrast[i] * csf(bands.frequency[i]));
    }
    return std::clamp(weighted / std::max(sum, contrast_floor), 1.0, largest_elevation);
}

Result<void> check_field(double field_degrees) {
    if (field_degrees > 0 && field_degrees < 180) return {};
    return judge_argument_error("rpg99", "field_degrees must lie between 0 and 180");
}

Result<void> check(const Image& reference, const Image& test, double field_degrees) {
    if (auto ok = check_luminance_pair("rpg99", reference, test); !ok) return ok;
    return check_field(field_degrees);
}

struct ExactMap {
    Plane adaptation, elevation, threshold;
};

ExactMap exact_map(const Image& reference, const Image& test, double field_degrees) {
    const Bands bands = make_bands(field_degrees, reference.width);
    const std::vector<Plane> a = blur_levels(reference);
    const bool one_image = reference.values == test.values;
    const std::vector<Plane> own_b = one_image ? std::vector<Plane>() : blur_levels(test);
    const std::vector<Plane>& b = one_image ? a : own_b;

    ExactMap map;
    for (Plane* p : {&map.adaptation, &map.elevation, &map.threshold}) p->resize(a[0].size());
    for (std::size_t p = 0; p < a[0].size(); ++p) {
        std::array<double, band_count> contrast{};
        for (std::size_t i = 0; i < band_count; ++i) {
            const double difference = std::max(std::abs(a[i][p] - a[i + 1][p]), std::abs(b[i][p] - b[i + 1][p]));
            contrast[i] = difference / std::max({a[i + 2][p], b[i + 2][p], contrast_floor});
        }
        const std::size_t level = bands.adaptation_level;
        map.adaptation[p] = std::max(0.5 * (a[level][p] + b[level][p]), contrast_floor);
        map.elevation[p] = elevation(contrast, bands, map.adaptation[p]);
        map.threshold[p] = map.elevation[p] * tvi(map.adaptation[p]);
    }
    return map;
}

Image as_image(const Plane& plane, const Image& like) {
    Image image{like.width, like.height, 1, {}};
    image.values.reserve(plane.size());
    for (const double v : plane) image.values.push_back(static_cast<float>(v));
    return image;
}

} // namespace

Result<Rpg99Map> rpg99_map(const Image& reference, const Image& test, double field_degrees) {
    if (auto ok = check(reference, test, field_degrees); !ok) return ok.error();
    const ExactMap map = exact_map(reference, test, field_degrees);
    return Rpg99Map{as_image(map.adaptation, reference), as_image(map.elevation, reference),
                    as_image(map.threshold, reference)};
}

Result<Judgement> judge_rpg99(const Image& reference, const Image& test, double field_degrees) {
    if (auto ok = check(reference, test, field_degrees); !ok) return ok.error();
    const ExactMap map = exact_map(reference, test, field_degrees);
    Judgement judgement;
    judgement.pixels = map.threshold.size();
    Plane ratio(map.threshold.size());
    for (std::size_t p = 0; p < ratio.size(); ++p) {
        const double difference = std::abs(double{reference.values[p]} - double{test.values[p]});
        ratio[p] = difference / map.threshold[p];
        judgement.visible_pixels += !(difference <= map.threshold[p]);
        judgement.max_ratio = std::max(judgement.max_ratio, ratio[p]);
    }
    judgement.visibility = as_image(ratio, reference);
    return judgement;
}

Result<Rpg99Tables> rpg99_tables(int width, double field_degrees) {
    if (auto ok = check_field(field_degrees); !ok) return ok.error();
    if (width < 1) return judge_argument_error("rpg99", "a picture has a width of at least 1 pixel");
    const Bands bands = make_bands(field_degrees, width);
    Rpg99Tables tables;
    tables.kernel = {static_cast<float>(kernel[2]), static_cast<float>(kernel[3]), static_cast<float>(kernel[4])};
    for (std::size_t i = 0; i < band_count; ++i)
        tables.frequency_factor[i] = static_cast<float>(
            std::min(bands.frequency_factor[i], static_cast<double>(std::numeric_limits<float>::max())));
    tables.adaptation_level = static_cast<int>(bands.adaptation_level);
    tables.floor = static_cast<float>(contrast_floor);
    tables.largest_elevation = static_cast<float>(largest_elevation);
    tables.masking_scale = static_cast<float>(masking_scale);
    tables.masking_gain = static_cast<float>(masking_gain);
    tables.masking_power = static_cast<float>(masking_power);
    tables.first_log2 = first_octave;
    tables.nodes_an_octave = nodes_an_octave;
    tables.luminances = (last_octave - first_octave) * nodes_an_octave + 1;
    tables.log2_csf.resize(band_count * static_cast<std::size_t>(tables.luminances));
    for (int l = 0; l < tables.luminances; ++l) {
        const double luminance = std::exp2(first_octave + static_cast<double>(l) / nodes_an_octave);
        tables.log2_tvi.push_back(static_cast<float>(std::log2(tvi(luminance))));
        const Barten1989 csf(luminance);
        for (std::size_t i = 0; i < band_count; ++i)
            tables.log2_csf[i * static_cast<std::size_t>(tables.luminances) + static_cast<std::size_t>(l)] =
                std::max(static_cast<float>(std::log2(csf(bands.frequency[i]))), least_log2);
    }
    return tables;
}

} // namespace unseen::perception
