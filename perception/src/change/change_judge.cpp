// The judge of changes: what lasts by the Judge, and the flicker of the moment by elaTCSF over the whole field.
#include <complex>

#include <unseen/perception/internal/change.h>

#include "change/flicker.h"
#include "judge/band_weights.h"
#include "judge/judge_input.h"

namespace unseen::perception {
namespace {

// Fitted constants as published with the program (gfxdisp/elaTCSF).
constexpr double scale = 154.133, second_share = 0.721095, second_slower = 2.12547, stage_s = 0.00292069;
constexpr int first_stages = 15, second_stages = 16;
constexpr double decay_per_degree = 0.0330933; // log10
constexpr double luminance_scale = 1.76801, luminance_half = 1.62402, luminance_power = 0.533781;
constexpr double speed_at_1_cdm2 = 0.6678, speed_per_decade = 0.222269; // of time
constexpr double speed_per_degree = 0.0341811, offset_hz = 2;
constexpr double darkest_cdm2 = 0.1;

// |H| at a frequency of the foveal filter.
double amplitude(double hz) {
    const std::complex<double> z(0, 2 * std::numbers::pi * hz * stage_s);
    return std::abs(
        scale * (std::pow(1.0 + z, -first_stages) - second_share * std::pow(1.0 + second_slower * z, -second_stages)));
}

// The response of n equal low-pass stages of time constant 1 to a step: 1 - e^-x (1 + x + ... + x^(n-1) / (n-1)!).
double stages_step(int n, double x) {
    if (!(x > 0)) return 0;
    double term = 1, sum = 1;
    for (int k = 1; k < n; ++k) sum += term *= x / k;
    return 1 - std::exp(-x) * sum;
}

constexpr double table_step_s = 5e-4, table_end_s = 0.4; // when it has settled
constexpr std::size_t table_size = static_cast<std::size_t>(table_end_s / table_step_s) + 2;

struct StepTable {
    std::array<double, table_size> response{};
    double peak_s = 0;
    StepTable() {
        for (std::size_t i = 0; i < table_size; ++i) {
            const double seconds = static_cast<double>(i) * table_step_s;
            response[i] = scale * (stages_step(first_stages, seconds / stage_s) -
                                   second_share * stages_step(second_stages, seconds / (second_slower * stage_s)));
        }
        peak_s = static_cast<double>(std::ranges::max_element(response) - response.begin()) * table_step_s;
    }
};

double luminance_speed(double cdm2) {
    return speed_at_1_cdm2 + speed_per_decade * std::log10(std::max(cdm2, darkest_cdm2));
}

} // namespace

double flicker_speed(double eccentricity_deg, double cdm2) {
    return luminance_speed(cdm2) * (1 + speed_per_degree * eccentricity_deg);
}

double flicker_scale(double eccentricity_deg, double cdm2) {
    return std::pow(10.0, -decay_per_degree * eccentricity_deg) * luminance_scale *
           std::pow(1 + luminance_half / std::max(cdm2, darkest_cdm2), -luminance_power);
}

double flicker_sensitivity(double hz, double eccentricity_deg, double cdm2) {
    const double foveal_hz =
        ((hz + offset_hz) / (1 + speed_per_degree * eccentricity_deg) - offset_hz) / luminance_speed(cdm2);
    return flicker_scale(eccentricity_deg, cdm2) * amplitude(foveal_hz);
}

double step_response(double seconds_after_peak) {
    static const StepTable table;
    const double seconds = seconds_after_peak + table.peak_s;
    if (!(seconds > 0)) return 0;
    if (!(seconds < table_end_s)) return scale * (1 - second_share);
    const double place = seconds / table_step_s;
    const auto i = static_cast<std::size_t>(place);
    return std::lerp(table.response[i], table.response[i + 1], place - static_cast<double>(i));
}

namespace {

using Values = std::vector<float>;

// Both axes by a symmetric kernel, from the middle on; what lies outside of the picture mirrors it.
Values blurred(const Values& in, int width, int height, std::span<const float> kernel) {
    const int reach = static_cast<int>(kernel.size()) - 1;
    Values rows(in.size()), out(in.size());
    const auto at = [&](int x, int y) {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
    };
    Values line(static_cast<std::size_t>(width + 2 * reach));
    for (int y = 0; y < height; ++y) {
        for (int x = -reach; x < width + reach; ++x)
            line[static_cast<std::size_t>(x + reach)] = in[at(mirrored(x, width), y)];
        for (int x = 0; x < width; ++x) {
            const float* const middle = &line[static_cast<std::size_t>(x + reach)];
            float sum = kernel[0] * middle[0];
            for (int k = 1; k <= reach; ++k) sum += kernel[static_cast<std::size_t>(k)] * (middle[-k] + middle[k]);
            rows[at(x, y)] = sum;
        }
    }
    for (int y = 0; y < height; ++y) {
        float* const to = &out[at(0, y)];
        for (int k = -reach; k <= reach; ++k) {
            const float* const from = &rows[at(0, mirrored(y + k, height))];
            const float weight = kernel[static_cast<std::size_t>(std::abs(k))];
            for (int x = 0; x < width; ++x) to[x] += weight * from[x];
        }
    }
    return out;
}

std::vector<float> gaussian(double sigma_px) {
    constexpr double reach = 3.5; // standard deviations: beyond lies 0.05%
    std::vector<float> kernel;
    double sum = 0;
    for (int i = 0; i <= static_cast<int>(std::ceil(reach * sigma_px)); ++i) {
        const double weight = std::exp(-i * i / (2 * sigma_px * sigma_px));
        kernel.push_back(static_cast<float>(weight));
        sum += i == 0 ? weight : 2 * weight;
    }
    for (float& weight : kernel) weight = static_cast<float>(weight / sum);
    return kernel;
}

// What the flicker of the moment has of a difference: see flicker_blurs.
Values coarse_part(const Values& difference, int width, int height, double ppd) {
    Values sum(difference.size());
    for (const FlickerBlur& blur : flicker_blurs) {
        // exp(-(rho / cpd)^2) is the spectrum of a Gaussian of this standard deviation.
        const double sigma_px = ppd / (std::numbers::sqrt2 * std::numbers::pi * blur.cpd);
        const Values part = blurred(difference, width, height, gaussian(sigma_px));
        for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += static_cast<float>(blur.weight) * part[i];
    }
    return sum;
}

// What the eye is used to: the mean over about a degree, by two boxes of two thirds of one.
Values adaptation(const Image& picture, double ppd, double floor_cdm2) {
    const auto reach = static_cast<std::size_t>(std::max(0.0, std::round(ppd / 3)));
    const std::vector<float> box(reach + 1, static_cast<float>(1.0 / static_cast<double>(2 * reach + 1)));
    Values mean = blurred(picture.values, picture.width, picture.height, box);
    for (float& v : mean) v = std::max(v, static_cast<float>(floor_cdm2));
    return mean;
}

// How much better than by elaTCSF flicker is seen: as still pictures are than by castleCSF.
double flicker_gain(const JudgeOptions& options) {
    if (!options.csf_table) return options.gain;
    const Luminance middle(to_luminance(options.display, 0.5));
    return options.gain * options.csf_table->peak_sensitivity(Degrees(0), middle) /
           CsfTable::standard().peak_sensitivity(Degrees(0), middle);
}

// V of what is different where the light of a picture has changed by so much.
Result<double> lasting_of(const Image& before, const Values& difference, const JudgeOptions& options) {
    const auto judge = Judge::create(before, options);
    if (!judge) return judge.error();
    Image after = before;
    // Sums of differences of several frames need not be those of two pictures.
    for (std::size_t i = 0; i < after.values.size(); ++i)
        after.values[i] = std::max(0.0f, after.values[i] + difference[i]);
    auto judged = judge->judge(after);
    if (!judged) return judged.error();
    return judged->max_ratio;
}

ChangeJudgement pooled(double lasting, double flicker, double beta) {
    const double most = std::max(lasting, flicker);
    if (!(most > 0)) return {};
    return {most * std::pow(std::pow(lasting / most, beta) + std::pow(flicker / most, beta), 1 / beta), lasting,
            flicker};
}

} // namespace

void ChangeWatch::pass(double seconds) {
    for (Step& step : steps_) step.age_s += seconds;
    while (!steps_.empty() && !(steps_.front().age_s < remembered_s)) steps_.pop_front();
}

// V of all changes together, over the whole field.
double ChangeWatch::flicker(const Image& before) const {
    const double ppd = pixels_per_degree(options_.display).value();
    const double gain = flicker_gain(options_);
    const Values luminance = adaptation(before, ppd, contrast_floor(options_.display));
    const Plane aside = eccentricities(before.width, before.height, options_);
    double sum = 0;
    for (std::size_t i = 0; i < before.values.size(); ++i) {
        if (std::ranges::none_of(steps_, [&](const Step& step) { return step.coarse[i] != 0; })) continue;
        const double degrees = aside.values.empty() ? 0 : static_cast<double>(aside.values[i]),
                     cdm2 = static_cast<double>(luminance[i]);
        const double speed = flicker_speed(degrees, cdm2);
        double response = 0;
        for (const Step& step : steps_)
            response += static_cast<double>(step.coarse[i]) * step_response(speed * step.age_s);
        const double thresholds = std::abs(response) / cdm2 * flicker_scale(degrees, cdm2) * gain;
        sum += std::pow(thresholds, flicker_pooling);
    }
    return std::pow(sum / (ppd * ppd) / flicker_pooling_deg2, 1 / flicker_pooling);
}

Result<ChangeJudgement> ChangeWatch::next(const Image& before, const Image& after, double seconds) {
    if (auto ok = check(options_); !ok) return ok.error();
    if (!(seconds >= 0 && std::isfinite(seconds)))
        return judge_argument_error("judge of changes", "the time must be 0 seconds or more, and finite");
    if (auto ok = check_luminance_pair("judge of changes", before, after); !ok) return ok.error();
    if (before.width != width_ || before.height != height_) steps_.clear(); // another window
    width_ = before.width, height_ = before.height;
    pass(seconds);
    Values difference(before.values.size());
    for (std::size_t i = 0; i < difference.size(); ++i) difference[i] = after.values[i] - before.values[i];
    if (std::ranges::all_of(difference, [](float v) { return v == 0; })) return ChangeJudgement{};

    Values all = difference;
    for (const Step& step : steps_)
        for (std::size_t i = 0; i < all.size(); ++i) all[i] += step.difference[i];
    auto lasting = lasting_of(before, all, options_);
    if (!lasting) return lasting.error();

    Values coarse = coarse_part(difference, width_, height_, pixels_per_degree(options_.display).value());
    steps_.push_back({0, std::move(difference), std::move(coarse)});
    return pooled(*lasting, flicker(before), options_.beta);
}

} // namespace unseen::perception
