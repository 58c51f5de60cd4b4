// What is known of contrast sensitivity, and of the thresholds that a picture raises: formulas, tables and maps.
#include "accuracy_axes.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <utility>

#include <glm/gtc/packing.hpp>

#include <unseen/perception/csf.h>
#include <unseen/perception/internal/judge_tables.h>
#include <unseen/perception/judge.h>
#include <unseen/render/internal/elevation.h>
#include <unseen/render/internal/visibility_passes.h>
#include <unseen/session_gpu/gpu_judge.h>
#include <unseen/session_gpu/picture_judge.h>
#include <unseen/session_gpu/scene_renderer.h>

#include "bench_tools.h"
#include "terminal.h"

namespace unseen::app {
namespace {

using perception::CyclesPerDegree;
using perception::Degrees;
using perception::Luminance;

// The value that so large a share of them stays below; `values` in any order, and not empty.
double quantile(std::vector<double> values, double share) {
    const auto nth = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), nth, values.end());
    return *nth;
}

// ---- contrast sensitivity

struct Stimuli {
    std::vector<double> cpd, degrees, cdm2;
};

Stimuli random_stimuli(std::size_t count) {
    std::mt19937_64 random(1);
    const auto between = [&](double a, double b) {
        return a + (b - a) * static_cast<double>(random() >> 11) * 0x1p-53;
    };
    Stimuli all;
    for (std::size_t i = 0; i < count; ++i) {
        all.cpd.push_back(std::exp2(between(-3, 5)));
        all.degrees.push_back(between(0, 60));
        all.cdm2.push_back(std::exp2(between(-3, 8)));
    }
    return all;
}

// What tables span: castleCSF's own domain, more or less.
constexpr double first_cpd = 1.0 / 16, last_cpd = 64, last_degrees = 120, first_cdm2 = 1e-3, last_cdm2 = 1e4;

std::vector<double> steps(double first, double last, int count, bool is_log) {
    std::vector<double> values;
    for (int i = 0; i < count; ++i) {
        const double share = static_cast<double>(i) / (count - 1);
        values.push_back(is_log ? first * std::pow(last / first, share) : first + share * (last - first));
    }
    return values;
}

perception::CsfSamples samples_of(int count) {
    perception::CsfSamples s;
    s.source = "castle, " + std::to_string(count) + " samples an axis";
    s.frequency_cpd = steps(first_cpd, last_cpd, count, true);
    s.eccentricity_deg = steps(0, last_degrees, count, false);
    s.luminance_cdm2 = steps(first_cdm2, last_cdm2, count, true);
    constexpr double least = 1e-30; // above 0, and far below what bends a curve that is seen
    for (const double e : s.eccentricity_deg)
        for (const double l : s.luminance_cdm2)
            for (const double f : s.frequency_cpd)
                s.sensitivity.push_back(std::max(
                    perception::sensitivity(perception::CsfModel::castle,
                                            perception::stimulus_of({}, CyclesPerDegree(f), Degrees(e), Luminance(l))),
                    least));
    return s;
}

// A twin of the table that is cubic (Catmull and Rom) in all three axes, of the same logarithms. Axes have equal steps.
class CubicTable {
public:
    explicit CubicTable(const perception::CsfSamples& s) : count_(static_cast<int>(s.frequency_cpd.size())) {
        for (const double value : s.sensitivity) log_.push_back(static_cast<float>(std::log2(value)));
    }

    double sensitivity(double cpd, double degrees, double cdm2) const {
        const double last = count_ - 1;
        const Place f = place(std::log(cpd / first_cpd) / std::log(last_cpd / first_cpd) * last),
                    e = place(degrees / last_degrees * last),
                    l = place(std::log(cdm2 / first_cdm2) / std::log(last_cdm2 / first_cdm2) * last);
        double sum = 0;
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < 4; ++j) {
                double along = 0;
                for (int k = 0; k < 4; ++k)
                    along +=
                        f.weight[k] *
                        static_cast<double>(
                            log_[static_cast<std::size_t>((e.index[i] * count_ + l.index[j]) * count_ + f.index[k])]);
                sum += e.weight[i] * l.weight[j] * along;
            }
        return std::exp2(sum);
    }
    std::size_t bytes() const { return sizeof(float) * log_.size(); }

private:
    struct Place {
        int index[4];
        double weight[4];
    };
    Place place(double at) const {
        const int first = std::clamp(static_cast<int>(at), 0, count_ - 2);
        const double t = std::clamp(at - first, 0.0, 1.0), t2 = t * t, t3 = t2 * t;
        Place p{{},
                {0.5 * (2 * t2 - t - t3), 0.5 * (2 - 5 * t2 + 3 * t3), 0.5 * (t + 4 * t2 - 3 * t3), 0.5 * (t3 - t2)}};
        for (int i = 0; i < 4; ++i) p.index[i] = std::clamp(first - 1 + i, 0, count_ - 1);
        return p;
    }

    int count_;
    std::vector<float> log_; // log2 S; [(e * luminances + l) * frequencies + f]
};

// A twin of castleCSF's formula for static gratings of patch_area(), in any precision. Its constants are those of
// perception/src/csf/csf_castle.cpp, which has the source.
template <class Real>
Real castle_twin(Real cpd, Real degrees, Real cdm2) {
    const auto rise = [&](Real p1, Real p2, Real p3) { return p1 * std::exp(-p3 * std::log1p(p2 / cdm2)); };
    const Real area = std::numbers::pi_v<Real> * (Real(1.5) / cpd) * (Real(1.5) / cpd);
    const auto channel = [&](Real log2_width, Real truncation, Real area0, Real frequency0, Real peak) {
        const Real decades = std::log10(cpd / peak);
        Real parabola = std::pow(Real(10), -decades * decades / std::exp2(log2_width));
        if (cpd < peak) parabola = std::max(parabola, 1 - truncation);
        const Real relative = cpd / frequency0, summed = area0 / (1 + relative * relative);
        return parabola * cpd * std::sqrt(summed / (1 + summed / area));
    };
    const Real glare = -std::expm1(-Real(9.66862e9) * std::log1p(Real(5.58341e-7) / cdm2));
    const Real sustained = rise(Real(56.4947), Real(7.54726), Real(0.144532)) * glare *
                           channel(Real(0.000213047), Real(0.100207), Real(157.103), Real(0.702338),
                                   rise(Real(1.78119), Real(91.5718), Real(0.256682)));
    const Real hz0 = std::max(Real(4.7036) + Real(2.41482) * std::log10(cdm2), Real(0.5));
    const Real away = std::pow(hz0, Real(0.1898));
    const Real transient = std::exp(-away * away / Real(0.0844836)) * Real(2748.09) * std::pow(cdm2, Real(0.193434)) *
                           channel(Real(2.6761), Real(0.000241177), Real(3.81611), Real(3.01389), Real(0.000316696));
    const Real decay = std::min(Real(0.0239853) + Real(0.0189038) * cpd, Real(0.0400662) + Real(0.00813619) * cpd);
    return (sustained + transient) * std::pow(Real(10), -decay * degrees);
}

// ---- maps

perception::Image block_means(const perception::Image& image, int block) {
    perception::Image out{
        .width = (image.width + block - 1) / block, .height = (image.height + block - 1) / block, .values = {}};
    for (int y = 0; y < out.height; ++y)
        for (int x = 0; x < out.width; ++x) {
            double sum = 0;
            int count = 0;
            for (int v = y * block; v < std::min((y + 1) * block, image.height); ++v)
                for (int u = x * block; u < std::min((x + 1) * block, image.width); ++u, ++count)
                    sum += static_cast<double>(image.at(u, v));
            out.values.push_back(static_cast<float>(sum / count));
        }
    return out;
}

perception::Image in_half_floats(perception::Image image) {
    for (float& value : image.values) value = glm::unpackHalf1x16(glm::packHalf1x16(value));
    return image;
}

// Of each pixel of the truth, the relative error of a map of blocks.
std::vector<double> map_errors(const std::vector<float>& map, int map_width, int block,
                               const perception::Image& truth) {
    std::vector<double> errors;
    for (int y = 0; y < truth.height; ++y)
        for (int x = 0; x < truth.width; ++x) {
            const double wanted = static_cast<double>(truth.at(x, y));
            const auto at = static_cast<std::size_t>(y / block) * static_cast<std::size_t>(map_width) +
                            static_cast<std::size_t>(x / block);
            errors.push_back(std::abs(static_cast<double>(map[at]) - wanted) / wanted);
        }
    return errors;
}

// A way to make a map on the GPU.
struct MapVariant {
    std::string name; // begins with the recipe
    const perception::Image& picture;
    int block = 1;            // each of its pixels stands for so many by so many
    std::size_t bands = 0;    // at most; 0: all
    double picture_bytes = 4; // a pixel
    std::string note = {};
};

struct GpuMap {
    std::vector<float> thresholds;
    double milliseconds = 0; // median
    std::string note;
};

class MapMaker {
public:
    MapMaker(AccuracySubject& subject, int repeats)
        : context_(subject.context), observer_(subject.session.observer()), repeats_(repeats) {}

    perception::JudgeOptions judging() const { return session::judge_options(observer_); }
    perception::Rpg99Options rpg99_options(int width, int block) const {
        return {.field_degrees = perception::physical_field(display(block), width).value(), .masked_by_both = false};
    }

    Result<GpuMap> modern(const MapVariant& variant) const {
        perception::JudgeOptions how = judging();
        how.display = display(variant.block);
        if (how.gaze_px) *how.gaze_px /= static_cast<double>(variant.block);
        const auto [least, most] = std::ranges::minmax(variant.picture.values);
        auto tables = perception::judge_tables(variant.picture.width, variant.picture.height, least, most, how);
        if (!tables) return tables.error();
        if (variant.bands > 0 && tables->bands.size() > variant.bands) tables->bands.resize(variant.bands);
        auto up = upload(variant.picture);
        if (!up) return up.error();
        auto passes = render::VisibilityPasses::create(context_, *tables, up->texture());
        if (!passes) return passes.error();
        return timed(*passes, std::to_string(tables->bands.size()) + " bands", [&]() -> Result<void> {
            if (auto set = passes->set_reference(up->texture()); !set) return set;
            return passes->map_thresholds();
        });
    }

    Result<GpuMap> rpg99(const MapVariant& variant) const {
        const int width = variant.picture.width, height = variant.picture.height;
        const auto tables = perception::rpg99_tables(width, rpg99_options(width, variant.block));
        if (!tables) return tables.error();
        auto up = upload(variant.picture);
        if (!up) return up.error();
        auto passes = render::ElevationPasses::create(context_, width, height, *tables);
        if (!passes) return passes.error();
        return timed(*passes, "against rpg99's", [&] { return passes->map_thresholds(up->texture()); });
    }

private:
    perception::Display display(int block) const {
        perception::Display display = observer_.display;
        if (block > 1)
            perception::set_pixels_per_degree(
                display, perception::PixelsPerDegree(perception::pixels_per_degree(display).value() / block));
        return display;
    }
    Result<render::LuminanceImage> upload(const perception::Image& picture) const {
        return render::LuminanceImage::create(context_, picture.width, picture.height, picture.values);
    }
    template <class Passes, class Make>
    Result<GpuMap> timed(Passes& passes, std::string note, Make&& make) const {
        GpuMap map;
        map.note = std::move(note);
        std::vector<double> times;
        for (int i = 0; i <= repeats_; ++i) {
            const auto start = BenchClock::now();
            if (auto made = make(); !made) return made.error();
            auto read = passes.read_thresholds();
            if (!read) return read.error();
            map.thresholds = std::move(*read);
            if (i > 0) times.push_back(1e3 * seconds_since(start)); // the first one compiles
        }
        map.milliseconds = median(std::move(times));
        return map;
    }

    const render::Context& context_;
    const session::Observer& observer_;
    int repeats_;
};

double median_ratio(const perception::Image& map, const perception::Image& other) {
    std::vector<double> ratios;
    for (std::size_t i = 0; i < map.values.size(); ++i)
        ratios.push_back(static_cast<double>(map.values[i]) / static_cast<double>(other.values[i]));
    return quantile(std::move(ratios), 0.5);
}

// Sensitivities to random stimuli: each way's time and error.
class CsfLookups {
public:
    explicit CsfLookups(int repeats) : stimuli_(random_stimuli(count)), repeats_(repeats), truth_(count) {}

    // The first is the truth that the others are held against.
    template <class LookUp>
    void add(const std::string& name, LookUp&& look_up, double bytes = 0, const std::string& note = {},
             bool is_default = false) {
        std::vector<double> found(count), times, errors;
        for (int i = 0; i < repeats_; ++i) {
            const auto start = BenchClock::now();
            for (std::size_t k = 0; k < count; ++k)
                found[k] = look_up(stimuli_.cpd[k], stimuli_.degrees[k], stimuli_.cdm2[k]);
            times.push_back(1e9 * seconds_since(start) / count);
        }
        if (points.empty()) truth_ = found;
        for (std::size_t k = 0; k < count; ++k)
            if (truth_[k] > 1) errors.push_back(std::abs(found[k] / truth_[k] - 1));
        points.push_back(
            {.subject = "castleCSF",
             .name = name,
             .values = {median(std::move(times)), *std::ranges::max_element(errors), quantile(errors, 0.95), bytes},
             .note = note,
             .is_default = is_default});
    }
    void add(const std::string& name, const perception::CsfTable& table, bool is_default = false) {
        const perception::CsfSamples& s = table.samples();
        add(
            name,
            [&](double f, double e, double l) {
                return table.sensitivity(CyclesPerDegree(f), Degrees(e), Luminance(l));
            },
            static_cast<double>(sizeof(double) * s.sensitivity.size()),
            std::to_string(s.frequency_cpd.size()) + " x " + std::to_string(s.eccentricity_deg.size()) + " x " +
                std::to_string(s.luminance_cdm2.size()) + " samples",
            is_default);
    }

    AccuracyPoints points;

private:
    static constexpr std::size_t count = 100'000;
    Stimuli stimuli_;
    int repeats_;
    std::vector<double> truth_;
};

} // namespace

Result<AccuracyPoints> csf_points(const AccuracyBenchOptions& options) {
    CsfLookups lookups(std::max(1, options.repeats / 3));
    lookups.add("closed form, double", [](double f, double e, double l) {
        return perception::sensitivity(perception::CsfModel::castle,
                                       perception::stimulus_of({}, CyclesPerDegree(f), Degrees(e), Luminance(l)));
    });
    lookups.add(
        "closed form, float",
        [](double f, double e, double l) {
            return static_cast<double>(
                castle_twin(static_cast<float>(f), static_cast<float>(e), static_cast<float>(l)));
        },
        0, "a twin, for static gratings alone");
    for (const int samples : {16, 32, 64}) {
        perception::CsfSamples s = samples_of(samples);
        const CubicTable cubic(s);
        const auto table = perception::CsfTable::create(std::move(s));
        if (!table) return table.error();
        const std::string name = "table, " + std::to_string(samples) + " an axis, ";
        lookups.add(name + "linear", *table);
        lookups.add(
            name + "cubic", [&](double f, double e, double l) { return cubic.sensitivity(f, e, l); },
            static_cast<double>(cubic.bytes()), "a twin");
    }
    lookups.add("the program's table", perception::CsfTable::standard(), true);
    return std::move(lookups.points);
}

Result<AccuracyPoints> map_points(AccuracySubject& subject, const AccuracyBenchOptions& options) {
    auto renderer = session::SceneRenderer::create(subject.context, subject.session);
    if (!renderer) return renderer.error();
    render::DrawOptions drawing;
    drawing.samples = std::min(options.samples, 16);
    drawing.background = subject.session.background();
    const auto whole = session::whole_cuts(subject.session);
    const auto frame = renderer->draw(session::drawn_cuts(whole), subject.view, drawing);
    if (!frame) return frame.error();
    const perception::Image picture = session::luminance_image(*frame, subject.session.observer().display);
    const MapMaker maker(subject, std::max(1, options.repeats / 3));

    // The CPU's are the truth.
    AccuracyPoints points;
    auto start = BenchClock::now();
    const auto modern = perception::threshold_map_modern(picture, maker.judging());
    if (!modern) return modern.error();
    points.push_back({.name = "modern, CPU", .values = {1e3 * seconds_since(start), 0, 0, 4}});
    start = BenchClock::now();
    const auto rpg99 = perception::rpg99_map(picture, picture, maker.rpg99_options(picture.width, 1));
    if (!rpg99) return rpg99.error();
    points.push_back({.name = "rpg99, CPU",
                      .values = {1e3 * seconds_since(start), 0, 0, 4},
                      .note = "thresholds are " + rounded(median_ratio(rpg99->threshold, *modern), 2) +
                              " x modern's at the median pixel"});

    const perception::Image half = block_means(picture, 2), quarter = block_means(picture, 4),
                            rounded_picture = in_half_floats(picture);
    const std::string twin = ", a twin: the picture is rounded before";
    const MapVariant variants[] = {{"modern", picture},
                                   {"modern, 16 bits", rounded_picture, 1, 0, 2, twin},
                                   {"modern, half the resolution", half, 2},
                                   {"modern, a quarter", quarter, 4},
                                   {"modern, 1 band", picture, 1, 1},
                                   {"modern, 2 bands", picture, 1, 2},
                                   {"modern, 3 bands", picture, 1, 3},
                                   {"modern, 4 bands", picture, 1, 4},
                                   {"modern, 5 bands", picture, 1, 5},
                                   {"rpg99", picture},
                                   {"rpg99, 16 bits", rounded_picture, 1, 0, 2, twin},
                                   {"rpg99, half the resolution", half, 2},
                                   {"rpg99, a quarter", quarter, 4}};
    for (const MapVariant& variant : variants) {
        const bool is_modern = variant.name.starts_with("modern");
        const auto map = is_modern ? maker.modern(variant) : maker.rpg99(variant);
        if (!map) return map.error();
        const std::vector<double> errors =
            map_errors(map->thresholds, variant.picture.width, variant.block, is_modern ? *modern : rpg99->threshold);
        constexpr double of_map = 4; // bytes
        const double share =
            static_cast<double>(variant.picture.values.size()) / static_cast<double>(picture.values.size());
        points.push_back({.name = variant.name,
                          .values = {map->milliseconds, quantile(errors, 0.99), quantile(errors, 0.5),
                                     share * (variant.picture_bytes + of_map)},
                          .note = map->note + variant.note,
                          .is_default = variant.name == "modern"});
    }
    return points;
}

} // namespace unseen::app
