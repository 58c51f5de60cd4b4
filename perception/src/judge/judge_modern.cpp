// The modern judge: a decimated Laplacian pyramid of the reference and of the difference, each band weighted by the
// sensitivity to unlimited gratings (judge/band_weights.h) and masked by the reference. How much there is of one
// decides how well it is seen: squares of contrasts in thresholds are summed over a window whose form is the law of
// area (judge/summation.h). A grating's squares are half its amplitude's square in the mean, hence the factor of 2. The
// squares of the channels (luminance, and where colours differ red-green and yellow-violet) are added; the bands are
// pooled.
#include <limits>
#include <mutex>

#include <unseen/perception/internal/chroma.h>

#include "judge/band_weights.h"
#include "judge/judge_input.h"
#include "judge/modern_masking.h"
#include "pyramid_kernel.h"

namespace unseen::perception {
namespace {

// ---- images -------------------------------------------------------------------------------------------------------

constexpr auto middle = static_cast<float>(kernel_middle), near = static_cast<float>(kernel_near),
               far = static_cast<float>(kernel_far);

// A line with `margin` mirrored samples to each side, which the kernels below reach.
constexpr int margin = 2;
void mirror(const float* line, int count, std::vector<float>& padded) {
    padded.resize(static_cast<std::size_t>(count + 2 * margin));
    std::copy_n(line, count, padded.begin() + margin);
    for (int i = 1; i <= margin; ++i) {
        padded[static_cast<std::size_t>(margin - i)] = line[mirrored(-i, count)];
        padded[static_cast<std::size_t>(margin + count - 1 + i)] = line[mirrored(count - 1 + i, count)];
    }
}

// Smoothed by the pyramid's kernel, every second sample of each axis.
Plane reduce(const Plane& in) {
    Plane rows(in.width, (in.height + 1) / 2), out((in.width + 1) / 2, rows.height);
    for (int y = 0; y < rows.height; ++y) {
        const auto line = [&](int offset) { return in.row(mirrored(2 * y + offset, in.height)); };
        const float *a = line(-2), *b = line(-1), *c = line(0), *d = line(1), *e = line(2);
        float* const to = rows.row(y);
        for (int x = 0; x < in.width; ++x) to[x] = middle * c[x] + near * (b[x] + d[x]) + far * (a[x] + e[x]);
    }
    std::vector<float> padded;
    for (int y = 0; y < out.height; ++y) {
        mirror(rows.row(y), rows.width, padded);
        const float* const at = padded.data() + margin;
        float* const to = out.row(y);
        for (int x = 0; x < out.width; ++x) {
            const float* const c = at + 2 * x;
            to[x] = middle * c[0] + near * (c[-1] + c[1]) + far * (c[-2] + c[2]);
        }
    }
    return out;
}

// Between samples of a coarse level at even places; a coarse line ends with its last sample.
Plane expand(const Plane& coarse, int width, int height) {
    Plane rows(coarse.width, height), out(width, height);
    for (int y = 0; y < height; ++y) {
        const int at = y / 2;
        const float *above = coarse.row(std::max(at - 1, 0)), *here = coarse.row(at),
                    *below = coarse.row(std::min(at + 1, coarse.height - 1));
        float* const to = rows.row(y);
        if (y % 2 == 1)
            for (int x = 0; x < coarse.width; ++x) to[x] = 2 * near * (here[x] + below[x]);
        else
            for (int x = 0; x < coarse.width; ++x) to[x] = 2 * (middle * here[x] + far * (above[x] + below[x]));
    }
    std::vector<float> padded(static_cast<std::size_t>(coarse.width + 2));
    for (int y = 0; y < height; ++y) {
        std::copy_n(rows.row(y), coarse.width, padded.begin() + 1);
        padded.front() = padded[1];
        padded.back() = padded[static_cast<std::size_t>(coarse.width)];
        const float* const at = padded.data() + 1;
        float* const to = out.row(y);
        for (int x = 0; 2 * x < width; ++x) to[2 * x] = 2 * (middle * at[x] + far * (at[x - 1] + at[x + 1]));
        for (int x = 0; 2 * x + 1 < width; ++x) to[2 * x + 1] = 2 * near * (at[x] + at[x + 1]);
    }
    return out;
}

// The binomial filter (1 2 1)/4 along both axes, whose response the tilt uses.
Plane smooth(const Plane& in) {
    Plane rows(in.width, in.height), out(in.width, in.height);
    std::vector<float> padded;
    for (int y = 0; y < in.height; ++y) {
        mirror(in.row(y), in.width, padded);
        const float* const at = padded.data() + margin;
        float* const to = rows.row(y);
        for (int x = 0; x < in.width; ++x) to[x] = 0.5f * at[x] + 0.25f * (at[x - 1] + at[x + 1]);
    }
    for (int y = 0; y < in.height; ++y) {
        const float *above = rows.row(mirrored(y - 1, in.height)), *here = rows.row(y),
                    *below = rows.row(mirrored(y + 1, in.height));
        float* const to = out.row(y);
        for (int x = 0; x < in.width; ++x) to[x] = 0.5f * here[x] + 0.25f * (above[x] + below[x]);
    }
    return out;
}

// ---- channels -------------------------------------------------------------------------------------------------------

enum class Channel : std::size_t { luminance, red_green, yellow_violet };
constexpr std::array chromatic = {Channel::red_green, Channel::yellow_violet};

// A pixel's three channels: luminance, and chroma in units of it (opponent_chroma()).
glm::dvec3 channels_at(const Image& image, std::size_t pixel) {
    if (image.channels == 1) return {image.values[pixel], 0, 0};
    const float* const at = image.values.data() + 3 * pixel;
    const glm::dvec3 rgb(at[0], at[1], at[2]);
    const double luminance = rec709_luminance(rgb);
    const glm::dvec2 chroma = opponent_chroma(rgb);
    return {luminance, chroma};
}

Plane plane_of(const Image& image, Channel channel) {
    Plane plane(image.width, image.height);
    if (channel == Channel::luminance && image.channels == 1) {
        plane.values = image.values;
        return plane;
    }
    for (std::size_t i = 0; i < plane.values.size(); ++i)
        plane.values[i] = static_cast<float>(channels_at(image, i)[static_cast<int>(channel)]);
    return plane;
}

// ---- bands ----------------------------------------------------------------------------------------------------------

// One band of a channel of the reference, at its own resolution.
struct ReferenceBand {
    int level = 0;
    bool is_base = false;
    Plane luminance; // cd/m2, floored
    Plane contrast;  // over the luminance
};

// Splits what is finer than the next level from a plane, and leaves that level in it.
struct Split {
    Plane coarse, fine;
};
Split split(Plane& plane) {
    Plane next = reduce(plane);
    Split parts{expand(next, plane.width, plane.height), std::move(plane)};
    for (std::size_t i = 0; i < parts.fine.values.size(); ++i) parts.fine.values[i] -= parts.coarse.values[i];
    plane = std::move(next);
    return parts;
}

// Leaves the next level in `luminance`, and in `chroma` where that is not empty: then the contrast is of that.
ReferenceBand split_reference(Plane& luminance, Plane& chroma, int level, bool is_base, float floor_cdm2) {
    ReferenceBand band;
    band.level = level, band.is_base = is_base;
    if (is_base) { // what the pyramid did not split; a base does not mask itself
        band.luminance = std::move(luminance);
        band.contrast = Plane(band.luminance.width, band.luminance.height);
    } else {
        Split parts = split(luminance);
        band.luminance = std::move(parts.coarse);
        band.contrast = chroma.values.empty() ? std::move(parts.fine) : split(chroma).fine;
    }
    for (std::size_t i = 0; i < band.luminance.values.size(); ++i) {
        float& local = band.luminance.values[i];
        local = std::max(local, floor_cdm2);
        band.contrast.values[i] /= local;
    }
    return band;
}

// How a row of samples is seen.
struct RowSight {
    BandWeights weights;
    std::vector<float> elevation; // of thresholds, by the reference
};

// A channel of the reference, band by band.
class Reference {
public:
    Reference(const Image& image, const JudgeOptions& options, Channel channel = Channel::luminance)
        : eccentricities_(eccentricities(image.width, image.height, options)),
          floor_cdm2_(static_cast<float>(contrast_floor(options.display))), rest_(plane_of(image, Channel::luminance)) {
        conditions_ = conditions_for(rest_, options, eccentricities_);
        if (channel == Channel::luminance) return;
        rest_of_chroma_ = plane_of(image, channel);
        conditions_.model = channel == Channel::red_green ? CsfModel::castle_red_green : CsfModel::castle_yellow_violet;
        // A viewer's table is of luminance alone.
        conditions_.gain = options.colour_gain.value_or(options.csf_table ? default_person.gain : options.gain);
        conditions_.table = nullptr;
    }

    const BandConditions& conditions() const { return conditions_; }

    // Calls `use(band)` for each from fine to coarse; only one is held at a time. Once.
    template <class Use>
    void for_each_band(Use use) {
        for (int level = 0; level <= conditions_.base_level; ++level)
            use(split_reference(rest_, rest_of_chroma_, level, level == conditions_.base_level, floor_cdm2_));
    }

    // `use(y, sight)` for each row of a band.
    template <class Use>
    void for_each_row(const ReferenceBand& band, const BandTable& table, Use use) const {
        const Plane smooth_contrast = smooth(band.contrast);
        const auto width = static_cast<std::size_t>(band.luminance.width);
        const auto of_patch = static_cast<float>(table.of_patch());
        std::vector<float> eccentricity;
        RowSight sight;
        sight.elevation.resize(width);
        for (int y = 0; y < band.luminance.height; ++y) {
            if (!eccentricities_.values.empty()) {
                const float* const degrees = eccentricities_.row(y << band.level);
                eccentricity.resize(width);
                for (std::size_t x = 0; x < width; ++x) eccentricity[x] = degrees[x << band.level];
            }
            table.weigh({band.luminance.row(y), width}, eccentricity, sight.weights);
            const auto& [sensitivity, own, smoothed] = sight.weights;
            const float *const contrast = band.contrast.row(y), *const around = smooth_contrast.row(y);
            for (std::size_t x = 0; x < width; ++x) {
                // Maskers work where they are: their contrasts count in thresholds of patches.
                const float masker = std::abs(own[x] * contrast[x] + smoothed[x] * around[x]);
                sight.elevation[x] = fast_daly_elevation(masker * sensitivity[x] * of_patch);
            }
            use(y, sight);
        }
    }

private:
    Plane eccentricities_;
    BandConditions conditions_;
    float floor_cdm2_;
    Plane rest_, rest_of_chroma_; // what is not split into bands yet; no chroma in the channel of luminance
};

// What the reference makes of one band of differences.
struct Band {
    int level = 0;
    bool is_base = false;
    // Weights of differences in cd/m2: contrasts in thresholds of unlimited gratings, masked, are
    //   own x + smoothed (h*x).
    Plane own, smoothed;
    SummationWindow window{1};
};

Band prepare_band(const Reference& reference, const ReferenceBand& from) {
    const BandConditions& conditions = reference.conditions();
    const BandTable table(conditions, from.level);
    const int width = from.luminance.width, height = from.luminance.height;
    Band band{from.level, from.is_base, Plane(width, height), Plane(width, height),
              SummationWindow(summation_area_in_samples(conditions, from.level))};
    reference.for_each_row(from, table, [&](int y, const RowSight& sight) {
        const float* const luminance = from.luminance.row(y);
        float *const own = band.own.row(y), *const smoothed = band.smoothed.row(y);
        const auto& weights = sight.weights;
        for (std::size_t x = 0; x < sight.elevation.size(); ++x) {
            const float to_thresholds = weights.sensitivity[x] / (luminance[x] * sight.elevation[x]);
            own[x] = to_thresholds * weights.own[x];
            smoothed[x] = to_thresholds * weights.smoothed[x];
        }
    });
    return band;
}

// Energies to the power of beta / 2, beta the exponent of amplitudes; the usual ones without logarithms.
void raise(std::vector<float>& energies, float beta) {
    constexpr float least = std::numeric_limits<float>::min();
    if (beta == 2) return;
    if (beta == 3.5f)
        for (float& e : energies) e = e * std::sqrt(e) * std::sqrt(std::sqrt(e));
    else
        for (float& e : energies) e = e > 0 ? fast_exp2(beta / 2 * fast_log2(std::max(e, least))) : 0;
}

// The sums of powers to V.
void take_root(std::vector<float>& powers, float beta) {
    constexpr float least = std::numeric_limits<float>::min();
    for (float& p : powers) p = p > 0 ? fast_exp2(fast_log2(std::max(p, least)) / beta) : 0;
}

} // namespace

struct Judge::State {
    using Bands = std::vector<Band>; // from fine to coarse

    Image reference;
    JudgeOptions options;
    Bands of_luminance;

    // By channel; made for the first picture whose colours differ.
    const std::array<Bands, chromatic.size()>& of_chroma() const {
        std::call_once(chroma_is_asked_for_, [&] {
            for (std::size_t i = 0; i < chromatic.size(); ++i) of_chroma_[i] = prepare(chromatic[i]);
        });
        return of_chroma_;
    }
    Bands prepare(Channel channel) const {
        Bands bands;
        Reference by_band(reference, options, channel);
        by_band.for_each_band([&](const ReferenceBand& band) { bands.push_back(prepare_band(by_band, band)); });
        return bands;
    }

private:
    mutable std::once_flag chroma_is_asked_for_;
    mutable std::array<Bands, chromatic.size()> of_chroma_;
};

namespace {

// Differences of a channel, band by band.
struct Differences {
    const std::vector<Band>* bands;
    Plane rest; // what is not split yet

    // Squares of the differences in thresholds, summed over the window. Leaves the next level in `rest`.
    Plane energies(const Band& band, float most) {
        Plane here = band.is_base ? std::move(rest) : split(rest).fine;
        const Plane smoothed = smooth(here);
        for (std::size_t i = 0; i < here.values.size(); ++i) {
            const float thresholds = std::min(
                std::abs(band.own.values[i] * here.values[i] + band.smoothed.values[i] * smoothed.values[i]), most);
            here.values[i] = 2 * thresholds * thresholds;
        }
        return band.window.sums(here);
    }
};

// Test less reference, by channel; of chroma only where some colour differs by more than the rounding of greys.
std::vector<Plane> differences_of(const Image& reference, const Image& test) {
    constexpr double rounding = 1e-6; // of the luminance: a thousandth of what can be seen
    std::vector<Plane> all{Plane(reference.width, reference.height)};
    std::vector<float>& luminance = all.front().values;
    if (reference.channels == 1 && test.channels == 1) {
        for (std::size_t i = 0; i < luminance.size(); ++i) luminance[i] = test.values[i] - reference.values[i];
        return all;
    }
    all.resize(1 + chromatic.size(), all.front());
    bool is_coloured = false;
    for (std::size_t i = 0; i < all.front().values.size(); ++i) {
        const glm::dvec3 was = channels_at(reference, i), is = channels_at(test, i), by = is - was;
        for (int k = 0; k < 3; ++k) all[static_cast<std::size_t>(k)].values[i] = static_cast<float>(by[k]);
        is_coloured |= std::max(std::abs(by[1]), std::abs(by[2])) > rounding * std::max(was[0], is[0]);
    }
    if (!is_coloured) all.resize(1);
    return all;
}

} // namespace

Judge::Judge(std::shared_ptr<const State> state) : state_(std::move(state)) {}

Result<Judge> Judge::create(Image reference, const JudgeOptions& options) {
    if (auto ok = check(options); !ok) return ok.error();
    if (auto ok = check_light("judge", reference, "reference"); !ok) return ok.error();
    auto state = std::make_shared<State>();
    state->reference = std::move(reference);
    state->options = options;
    state->of_luminance = state->prepare(Channel::luminance);
    return Judge(std::move(state));
}

Result<Judgement> Judge::judge(const Image& test) const {
    const Image& reference = state_->reference;
    if (auto ok = check_light_pair("judge", reference, test); !ok) return ok.error();
    const auto beta = static_cast<float>(state_->options.beta);
    const float most = most_thresholds(state_->options.beta);
    std::vector<Differences> channels;
    for (Plane& difference : differences_of(reference, test)) {
        const std::size_t before = channels.size();
        channels.push_back(
            {before == 0 ? &state_->of_luminance : &state_->of_chroma()[before - 1], std::move(difference)});
    }
    Plane sum(reference.width, reference.height);
    for (std::size_t k = 0; k < state_->of_luminance.size(); ++k) {
        Plane powers = channels.front().energies((*channels.front().bands)[k], most);
        for (std::size_t c = 1; c < channels.size(); ++c) {
            const Plane more = channels[c].energies((*channels[c].bands)[k], most);
            for (std::size_t i = 0; i < powers.values.size(); ++i) powers.values[i] += more.values[i];
        }
        raise(powers.values, beta);
        spread(powers, state_->of_luminance[k].level, sum, [](float& to, float from) { to += from; });
    }

    take_root(sum.values, beta);
    Judgement judgement;
    judgement.pixels = sum.values.size();
    judgement.visible_pixels = static_cast<std::uint64_t>(
        std::count_if(sum.values.begin(), sum.values.end(), [](float v) { return !(v < 1); }));
    judgement.max_ratio = static_cast<double>(*std::max_element(sum.values.begin(), sum.values.end()));
    judgement.visibility = {reference.width, reference.height, 1, std::move(sum.values)};
    judgement.judges_colour = channels.size() > 1;
    return judgement;
}

Result<Judgement> judge_modern(const Image& reference, const Image& test, const JudgeOptions& options) {
    const auto judge = Judge::create(reference, options);
    if (!judge) return judge.error();
    return judge->judge(test);
}

JudgeOptions second_judge_options(const Person& person, const Display& display,
                                  const std::optional<glm::dvec2>& gaze_px) {
    return {.display = display,
            .gaze_px = gaze_px,
            .csf = CsfModel::barten_fitted,
            .gain = person.barten_gain,
            .colour_gain = person.gain,
            .beta = 2};
}

Result<Image> threshold_map_modern(const Image& reference, const JudgeOptions& options) {
    if (auto ok = check(options); !ok) return ok.error();
    if (auto ok = check_light("judge", reference, "reference"); !ok) return ok.error();
    Plane threshold(reference.width, reference.height);
    std::fill(threshold.values.begin(), threshold.values.end(), std::numeric_limits<float>::max());
    Reference bands(reference, options);
    bands.for_each_band([&](const ReferenceBand& band) {
        const BandTable table(bands.conditions(), band.level);
        const auto of_patch = static_cast<float>(table.of_patch());
        Plane steps(band.luminance.width, band.luminance.height);
        bands.for_each_row(band, table, [&](int y, const RowSight& sight) {
            const float* const luminance = band.luminance.row(y);
            for (std::size_t x = 0; x < sight.elevation.size(); ++x)
                steps.row(y)[x] = luminance[x] * sight.elevation[x] / (sight.weights.sensitivity[x] * of_patch);
        });
        spread(steps, band.level, threshold, [](float& to, float from) { to = std::min(to, from); });
    });
    return Image{threshold.width, threshold.height, 1, std::move(threshold.values)};
}

Result<JudgeTables> judge_tables(int width, int height, float darkest_cdm2, float brightest_cdm2,
                                 const JudgeOptions& options) {
    if (auto ok = check(options); !ok) return ok.error();
    if (width < 1 || height < 1) return judge_argument_error("judge", "a picture has one pixel or more");
    if (!(darkest_cdm2 >= 0 && darkest_cdm2 <= brightest_cdm2 && std::isfinite(brightest_cdm2)))
        return judge_argument_error("judge", "a picture's luminances ascend from 0 or more, and are finite");
    const BandConditions conditions = conditions_for(width, height, {darkest_cdm2, brightest_cdm2},
                                                     eccentricity_range(width, height, options), options);
    JudgeTables tables;
    tables.width = width, tables.height = height;
    tables.floor_cdm2 = static_cast<float>(contrast_floor(options.display));
    tables.beta = static_cast<float>(options.beta);
    tables.most_thresholds = most_thresholds(options.beta);
    tables.kernel = {static_cast<float>(kernel_middle), static_cast<float>(kernel_near),
                     static_cast<float>(kernel_far)};
    tables.masking_power = static_cast<float>(masking_knee) * static_cast<float>(masking_slope);
    tables.masking_knee = static_cast<float>(masking_knee);
    tables.least_masker = least_masker, tables.most_masker = most_masker;
    tables.luminance_shift = BandTable::fraction_bits;
    tables.eccentricity_step = static_cast<float>(BandTable::eccentricity_step);
    tables.gaze = gaze_on_screen(width, height, options);
    for (int level = 0; level <= conditions.base_level; ++level) {
        const BandTable band(conditions, level);
        tables.first_luminance = band.first_cell();
        tables.first_eccentricity = band.first_eccentricity();
        tables.luminances = static_cast<int>(band.luminances());
        tables.eccentricities = static_cast<int>(band.eccentricities());
        tables.bands.push_back({static_cast<float>(band.of_patch()),
                                SummationWindow(summation_area_in_samples(conditions, level)).gaussians(),
                                band.nodes()});
    }
    return tables;
}

} // namespace unseen::perception
