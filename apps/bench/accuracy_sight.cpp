// What is known of contrast sensitivity, and of the thresholds that a picture raises: formulas, tables and maps.
#include <algorithm>
#include <cmath>
#include <utility>

#include <unseen/perception/csf.h>
#include <unseen/perception/internal/judge_tables.h>
#include <unseen/perception/judge.h>
#include <unseen/render/internal/elevation.h>
#include <unseen/render/internal/visibility_passes.h>
#include <unseen/session_gpu/gpu_judge.h>
#include <unseen/session_gpu/picture_judge.h>
#include <unseen/session_gpu/scene_renderer.h>

#include "accuracy.h"
#include "terminal.h"

namespace unseen::app {
namespace {

using perception::CyclesPerDegree;
using perception::Degrees;
using perception::Luminance;

// ---- contrast sensitivity

struct Stimuli {
    std::vector<double> cpd, degrees, cdm2;
};

Stimuli random_stimuli(std::size_t count) {
    Random random(1);
    Stimuli all;
    for (std::size_t i = 0; i < count; ++i) {
        all.cpd.push_back(std::exp2(random.between(-3, 5)));
        all.degrees.push_back(random.between(0, 60));
        all.cdm2.push_back(std::exp2(random.between(-3, 8)));
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

// ---- maps

// Of each pixel of the truth.
std::vector<double> relative_errors(const std::vector<float>& map, const perception::Image& truth) {
    std::vector<double> errors;
    for (std::size_t i = 0; i < map.size(); ++i) {
        const auto wanted = static_cast<double>(truth.values[i]);
        errors.push_back(std::abs(static_cast<double>(map[i]) - wanted) / wanted);
    }
    return errors;
}

// A way to make a map on the GPU.
struct MapVariant {
    std::string name;
    bool is_modern;        // else rpg99's
    std::size_t bands = 0; // at most; 0: all
};

struct GpuMap {
    std::vector<float> thresholds;
    double milliseconds = 0; // median
    std::string note;
};

class MapMaker {
public:
    explicit MapMaker(AccuracySubject& subject) : context_(subject.context), observer_(subject.session.observer()) {}

    perception::JudgeOptions judging() const { return session::judge_options(observer_); }
    double field_degrees(int width) const { return perception::physical_field(observer_.display, width).value(); }

    GpuMap make(const perception::Image& picture, const MapVariant& variant) const {
        return variant.is_modern ? modern(picture, variant) : rpg99(picture);
    }

private:
    GpuMap modern(const perception::Image& picture, const MapVariant& variant) const {
        const auto [least, most] = std::ranges::minmax(picture.values);
        auto tables = require(perception::judge_tables(picture.width, picture.height, least, most, judging()));
        if (variant.bands > 0 && tables.bands.size() > variant.bands) tables.bands.resize(variant.bands);
        auto up = upload(picture);
        auto passes = require(render::VisibilityPasses::create(context_, tables, up.texture()));
        return timed(passes, std::to_string(tables.bands.size()) + " bands", [&] {
            require(passes.set_reference(up.texture()));
            require(passes.map_thresholds());
        });
    }
    GpuMap rpg99(const perception::Image& picture) const {
        const auto tables = require(perception::rpg99_tables(picture.width, field_degrees(picture.width)));
        auto up = upload(picture);
        auto passes = require(render::ElevationPasses::create(context_, picture.width, picture.height, tables));
        return timed(passes, "against rpg99's", [&] { require(passes.map_thresholds(up.texture())); });
    }
    render::LuminanceImage upload(const perception::Image& picture) const {
        return require(render::LuminanceImage::create(context_, picture.width, picture.height, picture.values));
    }
    template <class Passes, class Make>
    static GpuMap timed(Passes& passes, std::string note, Make&& make) {
        GpuMap map;
        map.note = std::move(note);
        const auto once = [&] {
            make();
            map.thresholds = require(passes.read_thresholds());
        };
        once(); // the first one compiles
        map.milliseconds = 1e3 * median_seconds(few_repeats, once);
        return map;
    }

    const render::Context& context_;
    const session::Observer& observer_;
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
    // The first is the truth that the others are held against.
    template <class LookUp>
    void add(const std::string& name, LookUp&& look_up, double bytes = 0, const std::string& note = {}) {
        std::vector<double> found(count), errors;
        const double seconds = median_seconds(few_repeats, [&] {
            for (std::size_t k = 0; k < count; ++k)
                found[k] = look_up(stimuli_.cpd[k], stimuli_.degrees[k], stimuli_.cdm2[k]);
        });
        if (points.empty()) truth_ = found;
        for (std::size_t k = 0; k < count; ++k)
            if (truth_[k] > 1) errors.push_back(std::abs(found[k] / truth_[k] - 1));
        points.push_back({.name = name,
                          .values = {1e9 / count * seconds, std::ranges::max(errors), quantile(errors, 0.95), bytes},
                          .note = note});
    }
    void add_table(const std::string& name, const perception::CsfTable& table) {
        const perception::CsfSamples& s = table.samples();
        add(
            name,
            [&](double f, double e, double l) {
                return table.sensitivity(CyclesPerDegree(f), Degrees(e), Luminance(l));
            },
            static_cast<double>(sizeof(double) * s.sensitivity.size()),
            std::to_string(s.frequency_cpd.size()) + " x " + std::to_string(s.eccentricity_deg.size()) + " x " +
                std::to_string(s.luminance_cdm2.size()) + " samples");
    }

    AccuracyPoints points;

private:
    static constexpr std::size_t count = 100'000;
    Stimuli stimuli_ = random_stimuli(count);
    std::vector<double> truth_;
};

} // namespace

AccuracyPoints csf_points() {
    CsfLookups lookups;
    lookups.add("closed form, double", [](double f, double e, double l) {
        return perception::sensitivity(perception::CsfModel::castle,
                                       perception::stimulus_of({}, CyclesPerDegree(f), Degrees(e), Luminance(l)));
    });
    for (const int samples : {16, 32, 64}) {
        perception::CsfSamples s = samples_of(samples);
        const CubicTable cubic(s);
        const std::string name = "table, " + std::to_string(samples) + " an axis, ";
        lookups.add_table(name + "linear", require(perception::CsfTable::create(std::move(s))));
        lookups.add(
            name + "cubic", [&](double f, double e, double l) { return cubic.sensitivity(f, e, l); },
            static_cast<double>(cubic.bytes()), "a twin");
    }
    lookups.add_table("the program's table", perception::CsfTable::standard());
    lookups.points.back().is_default = true;
    return std::move(lookups.points);
}

AccuracyPoints map_points(AccuracySubject& subject) {
    auto renderer = require(session::SceneRenderer::create(subject.context, subject.session));
    const auto whole = session::whole_cuts(subject.session);
    const auto frame = require(renderer.draw(session::drawn_cuts(whole), subject.view,
                                             {.samples = 16, .background = subject.session.background()}));
    const perception::Image picture = session::luminance_image(frame, subject.session.observer().display);
    const MapMaker maker(subject);

    // The CPU's are the truth.
    perception::Image modern;
    perception::Rpg99Map rpg99;
    const double modern_s =
        seconds_of([&] { modern = require(perception::threshold_map_modern(picture, maker.judging())); });
    const double rpg99_s = seconds_of(
        [&] { rpg99 = require(perception::rpg99_map(picture, picture, maker.field_degrees(picture.width))); });
    AccuracyPoints points = {{.name = "modern, CPU", .values = {1e3 * modern_s, 0, 0, 4}},
                             {.name = "rpg99, CPU",
                              .values = {1e3 * rpg99_s, 0, 0, 4},
                              .note = "thresholds are " + rounded(median_ratio(rpg99.threshold, modern), 2) +
                                      " x modern's at the median pixel"}};
    for (const MapVariant& variant : {MapVariant{"modern", true},
                                      {"modern, 1 band", true, 1},
                                      {"modern, 2 bands", true, 2},
                                      {"modern, 3 bands", true, 3},
                                      {"modern, 4 bands", true, 4},
                                      {"modern, 5 bands", true, 5},
                                      {"rpg99", false}}) {
        const GpuMap map = maker.make(picture, variant);
        const std::vector<double> errors =
            relative_errors(map.thresholds, variant.is_modern ? modern : rpg99.threshold);
        constexpr double of_picture = 4, of_map = 4; // bytes a pixel
        points.push_back(
            {.name = variant.name,
             .values = {map.milliseconds, quantile(errors, 0.99), quantile(errors, 0.5), of_picture + of_map},
             .note = map.note,
             .is_default = variant.name == "modern"});
    }
    return points;
}

} // namespace unseen::app
