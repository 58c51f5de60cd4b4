// Gazes: traces, simulated ones, and what a tracker makes of them.
#include <unseen/perception/gaze.h>

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/number_text.h>
#include <unseen/vdtree/internal/random.h>

namespace unseen::perception {
namespace {

// Fixations and saccades: see the header.
constexpr double median_fixation_s = 0.25, fixation_spread = 0.35; // standard deviation of the logarithm
constexpr int amplitude_shape = 2;
constexpr double mean_amplitude_deg = 5.5, least_amplitude_deg = 0.5, largest_amplitude_deg = 20;
constexpr double seconds_per_degree = 0.0022, least_saccade_s = 0.021;

// Margins that tables are made for; beyond the last, nothing is known.
constexpr double margins_deg[] = {0, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 4, 6, 8, 12, 15, 20, 30, 45, 60};

// What is wrong with a sample after another, or nothing.
std::string complaint_about(const GazeTrace::Sample& sample, const GazeTrace::Sample* before) {
    if (!std::isfinite(sample.time_s)) return "has a time_s that is not finite";
    for (const auto& [name, px] : {std::pair("x_px", sample.px.x), std::pair("y_px", sample.px.y)}) {
        if (!std::isfinite(px)) return "has an " + std::string(name) + " that is not finite";
        if (std::abs(px) > GazeTrace::farthest_px)
            return "has an " + std::string(name) + " of " + number_text(px) + ": at most a million pixels aside can be";
    }
    if (!before) return {};
    if (!(sample.time_s > before->time_s))
        return "is out of order: time_s " + number_text(sample.time_s) + " s comes after " +
               number_text(before->time_s) + " s";
    if (!(sample.time_s - before->time_s <= GazeTrace::longest_gap_s))
        return "follows a gap of " + number_text(sample.time_s - before->time_s) + " s: at most 1 s may be missing";
    return {};
}

// Share of the way at a share of the time: minimum jerk (Hogan 1984).
double minimum_jerk(double t) { return t * t * t * (10 + t * (-15 + 6 * t)); }

// A fixation at `from`, then a saccade to `to`.
struct Movement {
    double fixation_s, saccade_s;
    glm::dvec2 from, to; // pixels
};

class EyeModel {
public:
    EyeModel(const SimulatedGaze& options, const Display& display)
        : random_(options.seed), size_(options.width_px, options.height_px), at_(size_ * 0.5),
          tangent_per_pixel_(display.pixel_pitch / display.distance) {}

    Movement next() {
        Movement movement;
        movement.fixation_s = median_fixation_s * std::exp(fixation_spread * random_.normal());
        movement.from = at_;
        const double amplitude = choose_target();
        movement.saccade_s = least_saccade_s + seconds_per_degree * amplitude;
        movement.to = at_;
        return movement;
    }

private:
    glm::dvec2 to_degrees(glm::dvec2 px) const {
        const glm::dvec2 t = (px - size_ * 0.5) * tangent_per_pixel_;
        return {std::atan(t.x) * degrees_per_radian, std::atan(t.y) * degrees_per_radian};
    }
    glm::dvec2 to_pixels(glm::dvec2 degrees) const {
        return size_ * 0.5 +
               glm::dvec2(std::tan(degrees.x / degrees_per_radian), std::tan(degrees.y / degrees_per_radian)) /
                   tangent_per_pixel_;
    }
    bool is_inside(glm::dvec2 px) const { return px.x >= 0 && px.y >= 0 && px.x <= size_.x && px.y <= size_.y; }

    // Draws until a target is in the window; a small window may have none of that amplitude, so it shrinks with every
    // failure.
    double choose_target() {
        double amplitude = 0;
        do amplitude = random_.gamma(amplitude_shape, mean_amplitude_deg / amplitude_shape);
        while (!(amplitude >= least_amplitude_deg && amplitude <= largest_amplitude_deg));
        const glm::dvec2 here = to_degrees(at_);
        for (constexpr double shrink = 0.93;; amplitude *= shrink) {
            const double direction = 2 * std::numbers::pi * random_.uniform();
            const glm::dvec2 target = here + amplitude * glm::dvec2(std::cos(direction), std::sin(direction));
            constexpr double steepest_deg = 80;
            const bool is_ahead = std::abs(target.x) < steepest_deg && std::abs(target.y) < steepest_deg;
            if (is_ahead && is_inside(to_pixels(target))) {
                at_ = to_pixels(target);
                return amplitude;
            }
            constexpr double hopeless_deg = 1e-6; // a window of a pixel
            if (amplitude < hopeless_deg) return 0;
        }
    }

    Random random_;
    glm::dvec2 size_, at_;
    double tangent_per_pixel_;
};

} // namespace

// ---- traces -------------------------------------------------------------------------------------------------------

Result<GazeTrace> GazeTrace::create(std::vector<GazeTrace::Sample> samples) {
    if (samples.empty()) return invalid_argument("A gaze trace needs at least one sample.");
    for (std::size_t i = 0; i < samples.size(); ++i) {
        const std::string problem = complaint_about(samples[i], i > 0 ? &samples[i - 1] : nullptr);
        if (!problem.empty()) return invalid_argument("Gaze sample " + std::to_string(i) + " " + problem + ".");
    }
    return GazeTrace(std::move(samples));
}

glm::dvec2 GazeTrace::at(double time_s) const {
    const auto after = std::upper_bound(samples_.begin(), samples_.end(), time_s,
                                        [](double t, const GazeTrace::Sample& s) { return t < s.time_s; });
    if (after == samples_.begin()) return samples_.front().px;
    if (after == samples_.end()) return samples_.back().px;
    const GazeTrace::Sample &a = *(after - 1), &b = *after;
    return a.px + (b.px - a.px) * ((time_s - a.time_s) / (b.time_s - a.time_s));
}

Result<GazeTrace> simulate_gaze(const SimulatedGaze& o, const Display& display) {
    if (!(o.duration_s > 0 && o.samples_per_s > 0 &&
          o.duration_s * o.samples_per_s <= static_cast<double>(GazeTrace::most_samples)))
        return invalid_argument(
            "A simulated gaze needs a duration and a rate above 0, and at most ten million samples.");
    if (o.width_px < 1 || o.height_px < 1)
        return invalid_argument("A simulated gaze needs a window of at least 1x1 pixels.");
    if (o.samples_per_s < 1 / GazeTrace::longest_gap_s)
        return invalid_argument("A simulated gaze needs a sample a second at least.");
    if (auto valid = validate(display); !valid) return valid.error();
    EyeModel eye(o, display);
    std::vector<GazeTrace::Sample> samples;
    Movement movement = eye.next();
    double begun_s = 0;
    const auto count = static_cast<std::size_t>(std::floor(o.duration_s * o.samples_per_s)) + 1;
    samples.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
        const double t = static_cast<double>(i) / o.samples_per_s;
        while (t >= begun_s + movement.fixation_s + movement.saccade_s) {
            begun_s += movement.fixation_s + movement.saccade_s;
            movement = eye.next();
        }
        const double share = std::max(0.0, (t - begun_s - movement.fixation_s) / movement.saccade_s);
        samples.push_back({t, movement.from + (movement.to - movement.from) * minimum_jerk(share)});
    }
    return GazeTrace::create(std::move(samples));
}

// ---- trackers -----------------------------------------------------------------------------------------------------

Result<void> validate(const GazeTracker::Options& o) {
    constexpr double widest_deg = 180, slowest_s = 10;
    if (!(o.error_deg >= 0 && o.error_deg <= widest_deg))
        return invalid_argument("The gaze's error must lie in 0 to 180 degrees, not " + number_text(o.error_deg) + ".");
    if (!(o.latency_s >= 0 && o.latency_s <= slowest_s))
        return invalid_argument("The gaze's latency must lie in 0 to 10 s, not " + number_text(o.latency_s) + ".");
    if (!(o.suppressed_s >= 0 && o.suppressed_s <= 1))
        return invalid_argument("Suppression must last 0 to 1 s, not " + number_text(o.suppressed_s) + ".");
    return {};
}

GazeTracker::GazeTracker(GazeTrace trace, const GazeTracker::Options& options, const Display& display, int width_px,
                         int height_px)
    : trace_(std::move(trace)), options_(options), tangent_per_pixel_(display.pixel_pitch / display.distance),
      centre_px_(glm::dvec2(width_px, height_px) * 0.5) {
    const std::vector<GazeTrace::Sample>& s = trace_.samples();
    for (std::size_t i = 1; i < s.size(); ++i) {
        if (!(speed_at((s[i - 1].time_s + s[i].time_s) / 2) >= saccade_speed_deg_s)) continue;
        if (!saccades_.empty() && saccades_.back().second == s[i - 1].time_s) saccades_.back().second = s[i].time_s;
        else saccades_.emplace_back(s[i - 1].time_s, s[i].time_s);
    }
    for (auto& [from, to] : saccades_) to = std::max(to, from + options_.suppressed_s);
}

double GazeTracker::speed_at(double time_s) const {
    const std::vector<GazeTrace::Sample>& s = trace_.samples();
    const auto after = std::upper_bound(s.begin(), s.end(), time_s,
                                        [](double t, const GazeTrace::Sample& sample) { return t < sample.time_s; });
    if (after == s.begin() || after == s.end()) return 0;
    const auto direction = [&](glm::dvec2 px) {
        return glm::normalize(glm::dvec3((px - centre_px_) * tangent_per_pixel_, 1));
    };
    const glm::dvec3 a = direction((after - 1)->px), b = direction(after->px);
    return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)) * degrees_per_radian /
           (after->time_s - (after - 1)->time_s);
}

GazeTracker::Gaze GazeTracker::at(double time_s) const {
    double seen_s = time_s - options_.latency_s; // when the eye was where the tracker says
    GazeTracker::Gaze tracked;
    if (options_.suppression) {
        const auto next = std::upper_bound(saccades_.begin(), saccades_.end(), seen_s,
                                           [](double t, const auto& s) { return t < s.first; });
        // Saccades may follow each other within the time that the first blinds for.
        for (auto s = next; s != saccades_.begin();) {
            --s;
            if (!(seen_s < s->second)) break;
            seen_s = std::nextafter(s->first, s->first - 1);
        }
    }
    tracked.px = trace_.at(seen_s);
    tracked.speed_deg_s = speed_at(seen_s);
    tracked.margin_deg = options_.error_deg + tracked.speed_deg_s * options_.latency_s;
    return tracked;
}

// ---- tables -------------------------------------------------------------------------------------------------------

std::shared_ptr<const CsfTable> WidenedTables::at(Degrees margin) {
    const auto rounded =
        std::find_if(std::begin(margins_deg), std::end(margins_deg), [&](double m) { return m >= margin.value(); });
    if (rounded == std::end(margins_deg)) return nullptr;
    std::shared_ptr<const CsfTable>& kept = widened_[*rounded];
    if (!kept) kept = std::make_shared<const CsfTable>(table_.widened(Degrees(*rounded)));
    return kept;
}

} // namespace unseen::perception
