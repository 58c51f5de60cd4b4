#include "perception_bench.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <memory>
#include <random>
#include <span>

#include <glm/geometric.hpp>

#include <hard_mesh.h>
#include <turning_light.h>
#include <unseen/perception/criterion.h>
#include <unseen/render/context.h>
#include <unseen/vdtree/internal/light_bounds.h>

#include "bench_tools.h"
#include "judged_model.h"
#include "load_model.h"
#include "progress_bar.h"
#include "terminal.h"

namespace unseen::app {
namespace {

namespace fs = std::filesystem;
using vdtree::Index;

constexpr FoldTest tests[] = {FoldTest::luebke_hallen, FoldTest::luebke_hallen_safe, FoldTest::error};
constexpr FoldTest geometric_tests[] = {FoldTest::displacement, FoldTest::extent};
constexpr FoldTest baseline = FoldTest::luebke_hallen;
constexpr FoldTest promised = FoldTest::error; // the one that the promises are about
constexpr double gaze_degrees = 29;
constexpr double gazes[] = {gaze_degrees, 0}; // 0: none, all is looked at
constexpr double fills[] = {0.9, 0.5, 0.2};   // of the window's height
constexpr Index large_mesh = 50'000;          // triangles, of the meshes that are looked at from afar
constexpr Index huge_mesh = 400'000;          // triangles, whose pictures take a minute each in software
constexpr std::size_t huge_views = 6;         // random ones, of each such mesh
constexpr Index lit_active = 100'000;         // triangles, under moving lights
// Of the group `aside`: where the viewer looks, from the window's centre, in degrees; 0: at everything.
constexpr double eccentricities[] = {0, 6, 12, 20, 29, 40, 50, 70};

const glm::dvec3 directions[] = {{0, 0, 1}, {1, 0, 0}, {1, 1, 1}};

std::string thousands(double triangles) {
    return triangles < 10'000 ? grouped(static_cast<std::uint64_t>(std::llround(triangles)))
                              : rounded(triangles / 1e3, 4) + "k";
}

std::string gaze_name(double degrees) { return degrees > 0 ? rounded(degrees, 2) + " degrees aside" : "fovea"; }
std::string percent(double share) { return rounded(100 * share, 3) + "%"; }

// How a model is looked at.
struct Look {
    ViewOptions view;
    std::optional<glm::dvec2> gaze_px;
    std::string text;
    struct Surroundings {
        perception::Display display;
        std::optional<perception::Luminance> background;
    };
    std::optional<Surroundings> around = {}; // none: the usual ones
};

Result<void> look(JudgedModel& model, const Look& how) {
    const Look::Surroundings around = how.around.value_or(Look::Surroundings());
    if (auto put = model.put(around.display, around.background); !put) return put;
    return model.look(how.view);
}

// What was seen of one cut.
struct Judged {
    std::string group;
    std::size_t model = 0;
    Look look;
    FoldTest test = baseline;
    Verdicts verdicts;
};

using Models = std::vector<std::unique_ptr<JudgedModel>>;

WhatOptions what_of(FoldTest test, const Look& look) {
    WhatOptions what;
    what.request.fold_test = test;
    what.gaze_px = look.gaze_px;
    return what;
}

// ---- sums over views

struct Totals {
    std::size_t views = 0, views_seen = 0; // with visible pixels
    std::uint64_t pixels = 0;
    double largest = 0; // V
    const Judged* worst = nullptr;
};

Totals total(const std::vector<Judged>& all, FoldTest test, std::size_t judge) {
    Totals totals;
    for (const Judged& one : all) {
        if (one.test != test) continue;
        ++totals.views;
        totals.views_seen += one.verdicts.visible_pixels[judge] > 0;
        totals.pixels += one.verdicts.visible_pixels[judge];
        const double v = one.verdicts.largest[judge];
        if (!totals.worst || !(v <= totals.largest)) {
            totals.largest = v;
            totals.worst = &one;
        }
    }
    return totals;
}

// ---- the work

class PerceptionBench {
public:
    PerceptionBench(const PerceptionBenchOptions& options, perception::CsfModel second)
        : options_(options), second_(second), bar_("judging") {}

    Result<PerceptionBenchResult> run() {
        if (needs_models() || is_wanted("hard")) { // the other groups draw nothing
            auto context = render::Context::headless();
            if (!context) return context.error();
            context_ = std::move(*context);
        }
        if (auto loaded = load(); !loaded) return loaded.error();
        const struct {
            const char* group;
            Result<void> (PerceptionBench::*measure)();
        } steps[] = {{"savings", &PerceptionBench::savings},
                     {"aside", &PerceptionBench::aside},
                     {"random", &PerceptionBench::random_views},
                     {"far", &PerceptionBench::far_away},
                     {"hard", &PerceptionBench::hard},
                     {"tolerance", &PerceptionBench::tolerance},
                     {"csf", &PerceptionBench::csf},
                     {"observers", &PerceptionBench::observers},
                     {"speed", &PerceptionBench::speed}};
        for (const auto& [group, measure] : steps)
            if (is_wanted(group))
                if (auto measured = (this->*measure)(); !measured) return measured.error();
        return std::move(result_);
    }

private:
    bool is_wanted(const std::string& group) const {
        return options_.only.empty() ||
               std::find(options_.only.begin(), options_.only.end(), group) != options_.only.end();
    }
    Target target(std::string_view figure) const { return options_.targets.of("perception", figure); }
    bool needs_models() const {
        return is_wanted("savings") || is_wanted("aside") || is_wanted("random") || is_wanted("far") ||
               is_wanted("tolerance") || is_wanted("speed");
    }

    // ---- models

    Result<void> load() {
        if (!needs_models()) {
            result_.title = "made-up meshes";
            return {};
        }
        for (const std::string& file : options_.meshes.empty() ? installed_meshes() : options_.meshes)
            if (auto added = add_file(file); !added) return added;
        main_models_ = models_.size();
        if (options_.meshes.empty()) settle_huge_models();
        if (models_.empty()) {
            auto tree = sample_tree();
            if (!tree) return tree.error();
            if (auto added = add("sphere", std::move(*tree)); !added) return added;
            main_models_ = 1;
        }
        if (is_wanted("random") || is_wanted("far"))
            for (const std::string& file : options_.others)
                if (auto added = add_file(file); !added) return added;
        for (std::size_t i = 0; i < models_.size(); ++i)
            result_.title += (i ? (i == main_models_ ? "; and " : ", ") : "") + models_[i]->name() + " (" +
                             grouped(models_[i]->triangles()) + ")";
        result_.title += "; " + grouped(static_cast<std::uint64_t>(options_.window_px)) + " pixels a side";
        if (options_.judges_on_gpu) result_.title += ", judged on the GPU (" + context_->renderer_name() + ")";
        return {};
    }
    // Where nobody named the meshes, huge ones are looked at only at random, from afar and for speed, and with --quick
    // not at all.
    void settle_huge_models() {
        const auto huge = std::stable_partition(models_.begin(), models_.end(),
                                                [](const auto& model) { return model->triangles() <= huge_mesh; });
        if (huge == models_.begin()) return; // there are no others
        main_models_ = static_cast<std::size_t>(huge - models_.begin());
        if (options_.quick) models_.erase(huge, models_.end());
    }
    Result<void> add_file(const fs::path& file) {
        auto tree = load_tree(file);
        if (!tree) return tree.error();
        return add(file.stem().string(), std::move(*tree));
    }
    Result<void> add(std::string name, vdtree::VertexTree tree) {
        return add(models_, std::move(name), std::move(tree));
    }
    Result<void> add_hard(Models& models, const HardMesh& mesh) {
        auto tree = build_hard_tree(mesh);
        return tree ? add(models, mesh.name, std::move(*tree)) : tree.error();
    }
    Result<void> add(Models& models, std::string name, vdtree::VertexTree tree) {
        auto model = JudgedModel::create(*context_, std::move(name), std::move(tree), options_.window_px, second_,
                                         options_.judges_on_gpu ? JudgeDevice::gpu : JudgeDevice::cpu);
        if (!model) return model.error();
        models.push_back(std::make_unique<JudgedModel>(std::move(*model)));
        return {};
    }

    // ---- views

    Look look(glm::dvec3 direction, double fill, double aside_degrees) const {
        Look look;
        look.view.width = look.view.height = options_.window_px;
        look.view.direction = direction;
        look.view.fill = fill;
        if (aside_degrees > 0) look.gaze_px = session::gaze_aside({}, window(), aside_degrees);
        look.text = "from " + rounded(direction.x, 2) + " " + rounded(direction.y, 2) + " " + rounded(direction.z, 2) +
                    ", " + percent(fill) + " of the height, " + gaze_name(aside_degrees);
        return look;
    }
    vdtree::View window() const {
        vdtree::View view;
        view.width = view.height = options_.window_px;
        return view;
    }
    std::size_t direction_count() const { return options_.quick ? 1 : std::size(directions); }
    std::vector<double> wanted_fills() const {
        return options_.quick ? std::vector{0.9, 0.2} : std::vector(std::begin(fills), std::end(fills));
    }

    // Judges a look by all tests, or those asked for; what was found goes into `found`.
    Result<void> judge(const std::string& group, Models& models, std::size_t model, const Look& how,
                       std::vector<Judged>& found, std::span<const FoldTest> by = tests) {
        if (auto looked = app::look(*models[model], how); !looked) return looked;
        for (const FoldTest test : by) {
            const auto verdicts = models[model]->judge(what_of(test, how));
            if (!verdicts) return verdicts.error();
            found.push_back({group, model, how, test, *verdicts});
            add_json(found.back(), *models[model]);
        }
        return {};
    }
    void progress(std::size_t done, std::size_t all, const char* group) {
        bar_(static_cast<double>(done) / static_cast<double>(all), group);
    }

    void add_json(const Judged& judged, const JudgedModel& model) {
        const Verdicts& v = judged.verdicts;
        result_.views.push_back({{"group", judged.group},
                                 {"mesh", model.name()},
                                 {"view", judged.look.text},
                                 {"test", name_of(judged.test)},
                                 {"triangles", v.triangles},
                                 {"of", model.triangles()},
                                 {"visible_pixels", v.visible_pixels[0]},
                                 {"largest_v", number_or_null(v.largest[0])},
                                 {"second_visible_pixels", v.visible_pixels[1]},
                                 {"second_largest_v", number_or_null(v.largest[1])}});
    }

    // ---- rows

    void add_visibility_rows(const std::string& what, const std::vector<Judged>& found, const Models& models) {
        if (found.empty()) return;
        for (const FoldTest test : tests) {
            for (std::size_t j = 0; j < judges.size(); ++j) {
                const Totals t = total(found, test, j);
                if (t.views == 0) continue;
                const std::string where = t.worst ? models[t.worst->model]->name() + ", " + t.worst->look.text : "";
                BenchRow row{"visible pixels, " + what + ", " + name_of(test),
                             "",
                             std::to_string(t.views_seen) + " of " + std::to_string(t.views) +
                                 " views with any; largest V " + rounded(t.largest, 3) + ": " + where,
                             static_cast<double>(t.pixels),
                             target(judges[j] == Judge::modern ? "visible pixels" : "visible pixels, second judge"),
                             false,
                             0};
                if (judges[j] != Judge::modern)
                    row.name = "the same by the second judge, " + std::string(perception::name(second_));
                result_.rows.push_back(std::move(row));
            }
        }
    }

    // ---- what is saved against the baseline

    // Of one setting and test.
    struct Saved {
        std::vector<Judged> views;
        std::vector<double> triangles; // by model, the mean of the directions
    };
    struct Setting {
        double gaze, fill;
        std::array<Saved, std::size(tests)> by_test;
    };

    Result<void> savings() {
        std::vector<Setting> settings;
        for (const double gaze : gazes)
            for (const double fill : wanted_fills()) settings.push_back({gaze, fill, {}});
        std::vector<Judged> found;
        if (auto judged = judge_savings(settings, found); !judged) return judged;
        BenchTable details{
            "Triangles kept, mean of " + std::to_string(direction_count()) + " directions and " +
                std::to_string(main_models_) +
                " meshes; what can be seen of it in the worst view; V, and by the second judge",
            {{"setting", "test", "triangles", "over luebke-hallen's", "visible", "largest V", "second: visible", "V"}}};
        for (const Setting& setting : settings)
            for (std::size_t t = 0; t < std::size(tests); ++t) add_saved(setting, t, details);
        result_.details.push_back(std::move(details));
        add_visibility_rows("these " + std::to_string(found.size() / std::size(tests)) + " views", found, models_);
        return {};
    }

    Result<void> judge_savings(std::vector<Setting>& settings, std::vector<Judged>& found) {
        for (Setting& setting : settings)
            for (Saved& saved : setting.by_test) saved.triangles.assign(main_models_, 0);
        const std::size_t all = main_models_ * settings.size() * direction_count();
        for (std::size_t model = 0; model < main_models_; ++model)
            for (const double fill : wanted_fills())
                for (std::size_t d = 0; d < direction_count(); ++d)
                    for (Setting& setting : settings) { // gazes inside: the full model is drawn once for all
                        if (setting.fill != fill) continue;
                        progress(found.size() / std::size(tests), all, "savings");
                        const std::size_t first = found.size();
                        if (auto ok = judge("savings", models_, model, look(directions[d], fill, setting.gaze), found);
                            !ok)
                            return ok;
                        for (std::size_t t = 0; t < std::size(tests); ++t) {
                            setting.by_test[t].views.push_back(found[first + t]);
                            setting.by_test[t].triangles[model] +=
                                found[first + t].verdicts.triangles / static_cast<double>(direction_count());
                        }
                    }
        return {};
    }

    void add_saved(const Setting& setting, std::size_t t, BenchTable& details) {
        const std::string where = gaze_name(setting.gaze) + ", " + percent(setting.fill);
        const Saved &saved = setting.by_test[t], &base = setting.by_test[0];
        double fewer = 0, kept = 0;
        std::string note;
        for (std::size_t m = 0; m < main_models_; ++m) {
            fewer += base.triangles[m] / saved.triangles[m] / static_cast<double>(main_models_);
            kept += saved.triangles[m] / static_cast<double>(main_models_);
            note += (m ? ", " : "") + models_[m]->name() + " " + thousands(base.triangles[m]) + " -> " +
                    thousands(saved.triangles[m]);
        }
        const Totals first = total(saved.views, tests[t], 0), second = total(saved.views, tests[t], 1);
        details.rows.push_back({where, name_of(tests[t]), thousands(kept), rounded(1 / fewer, 3), grouped(first.pixels),
                                rounded(first.largest, 2), grouped(second.pixels), rounded(second.largest, 2)});
        if (tests[t] == baseline) return;
        BenchRow row{"fewer triangles, " + where + ", " + name_of(tests[t]), "x", note, fewer, {}, true, 2};
        if (tests[t] == promised) row.target = target("fewer triangles, " + where + ", x");
        result_.rows.push_back(std::move(row));
    }

    // ---- random views

    // The models in turn, those that are huge only so often.
    static std::vector<std::size_t> models_of_random_views(std::size_t count, const Models& models) {
        const auto is_huge = [&](std::size_t m) { return models[m]->triangles() > huge_mesh; };
        bool all_huge = true;
        for (std::size_t m = 0; m < models.size(); ++m) all_huge = all_huge && is_huge(m);
        std::vector<std::size_t> order, views(models.size());
        for (std::size_t m = 0; order.size() < count; m = (m + 1) % models.size()) {
            if (is_huge(m) && !all_huge && views[m] >= huge_views) continue;
            ++views[m];
            order.push_back(m);
        }
        return order;
    }

    // `uniform`: draws a number between two.
    template <class Uniform>
    Look random_look(std::size_t i, Uniform&& uniform) const {
        const double z = uniform(-1, 1), turn = uniform(0, 2 * std::numbers::pi), across = std::sqrt(1 - z * z);
        const double fill = 0.03 * std::pow(50.0, uniform(0, 1)); // 3% to 150%
        Look how = look({across * std::cos(turn), across * std::sin(turn), z}, fill, 0);
        if (i % 3 == 2) {
            how.view.fov_degrees = uniform(10, 70);
            how.text += ", field " + rounded(*how.view.fov_degrees, 3);
        }
        perception::Display display;
        std::optional<perception::Luminance> background;
        if (i % 4 >= 2) {
            const double ppd = 20 * std::pow(6.0, uniform(0, 1)); // to 120
            set_pixels_per_degree(display, perception::PixelsPerDegree(ppd));
            if (uniform(0, 1) < 0.5) display.peak = perception::Luminance(1000);
            background = to_luminance(display, std::pow(uniform(0, 1), 3));
            how.text += ", " + rounded(ppd, 3) + " pixels per degree, " + rounded(display.peak.value(), 4) +
                        " cd/m2, before " + rounded(background->value(), 3);
        }
        how.around = {display, background};
        if (i % 2) {
            const double degrees = uniform(0, 70), where = uniform(0, 2 * std::numbers::pi);
            const glm::dvec2 centre(options_.window_px * 0.5);
            const double px = session::gaze_aside(display, window(), degrees).x - centre.x;
            how.gaze_px = centre + px * glm::dvec2(std::cos(where), std::sin(where));
            how.text.replace(how.text.rfind("fovea"), 5, "gaze " + rounded(degrees, 3) + " degrees aside");
        }
        return how;
    }

    // On all kinds of displays, before anything from black to white, at all sizes, looked at and aside. Of the models, and
    // of regular waves drawn at random, which no factor was fitted on.
    Result<void> random_views() {
        const std::uint64_t seed = options_.seed ? *options_.seed : std::random_device()();
        std::mt19937_64 random(seed);
        const auto uniform = [&](double low, double high) {
            return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
        };
        const std::size_t own = models_.size(), waved = options_.quick ? 1 : 4;
        for (std::size_t i = 0; i < waved; ++i) {
            const double waves = 2 * std::pow(16.0, uniform(0, 1)), height = 0.0005 * std::pow(64.0, uniform(0, 1));
            HardMesh mesh = waved_square(options_.quick ? 3'000 : 60'000, height, waves);
            mesh.name = rounded(waves, 3) + " waves " + rounded(height, 2) + " high";
            if (auto added = add_hard(models_, mesh); !added) return added;
        }
        const std::size_t count = options_.quick ? std::min<std::size_t>(models_.size(), 6) : options_.random_views;
        const std::vector<std::size_t> order = models_of_random_views(count, models_);
        std::vector<Judged> found;
        for (std::size_t i = 0; i < count; ++i) {
            progress(i, count, "random views");
            const Look how = random_look(i, uniform);
            if (auto ok = judge("random", models_, order[i], how, found); !ok) return ok;
        }
        add_visibility_rows(std::to_string(count) + " random views, seed " + std::to_string(seed), found, models_);
        models_.resize(own);
        return {};
    }

    // ---- where the viewer looks

    // The promised test by eccentricity: of the models, and of regular patterns, whose errors are alike everywhere.
    Result<void> aside() {
        Models models;
        for (std::size_t m = 0; m < main_models_; ++m) models.push_back(std::move(models_[m]));
        for (const HardMesh& mesh : open_sheets(options_.quick ? 3'000 : 60'000)) {
            if (mesh.name.find("waves") == mesh.name.npos) continue;
            if (auto added = add_hard(models, mesh); !added) return added;
            if (options_.quick) break;
        }
        const double near_and_far[] = {0.9, 0.3}; // of the window's height
        std::vector<Judged> found;
        const std::size_t fill_count = options_.quick ? 1 : std::size(near_and_far);
        const std::size_t all = models.size() * fill_count * direction_count();
        std::size_t done = 0;
        for (std::size_t m = 0; m < models.size(); ++m)
            for (std::size_t f = 0; f < fill_count; ++f)
                for (std::size_t d = 0; d < direction_count(); ++d) {
                    progress(done++, all, "aside");
                    for (const double degrees : eccentricities)
                        if (auto ok = judge("aside", models, m, look(directions[d], near_and_far[f], degrees), found,
                                            {&promised, 1});
                            !ok)
                            return ok;
                }
        BenchTable details{
            "By where the viewer looks, degrees from the window's centre; " + std::to_string(all) + " views each, of " +
                std::to_string(models.size()) + " meshes: V of the default observer by both judges, median and largest",
            {{"degrees aside", "triangles of the models", "V", "largest", "second: V", "largest", "visible pixels"}}};
        for (std::size_t e = 0; e < std::size(eccentricities); ++e) {
            std::vector<double> v[judges.size()];
            std::uint64_t pixels = 0, kept = 0;
            for (std::size_t i = e; i < found.size(); i += std::size(eccentricities)) {
                for (std::size_t j = 0; j < judges.size(); ++j) {
                    v[j].push_back(found[i].verdicts.largest[j]);
                    pixels += found[i].verdicts.visible_pixels[j];
                }
                if (found[i].model < main_models_) kept += found[i].verdicts.triangles;
            }
            std::vector<std::string> row = {eccentricities[e] > 0 ? rounded(eccentricities[e], 2) : "looked at",
                                            grouped(kept)};
            for (auto& of_judge : v) {
                row.push_back(rounded(median(of_judge), 2));
                row.push_back(rounded(*std::max_element(of_judge.begin(), of_judge.end()), 3));
            }
            row.push_back(grouped(pixels));
            details.rows.push_back(std::move(row));
        }
        result_.details.push_back(std::move(details));
        add_visibility_rows(std::to_string(found.size()) + " views by where the viewer looks", found, models);
        for (std::size_t m = 0; m < main_models_; ++m) models_[m] = std::move(models[m]);
        return {};
    }

    // ---- far away

    Result<void> far_away() {
        std::vector<std::size_t> large;
        for (std::size_t m = 0; m < models_.size(); ++m)
            if (models_[m]->triangles() > large_mesh) large.push_back(m);
        const bool has_large = !large.empty();
        if (!has_large)
            for (std::size_t m = 0; m < models_.size(); ++m) large.push_back(m);
        const struct {
            const char* name;
            double fill;
            bool by_share;
        } distances[] = {{"2 pixels", 2.0 / options_.window_px, false},
                         {"20 pixels", 20.0 / options_.window_px, true},
                         {"5% of the height", 0.05, true}};
        std::vector<Judged> found;
        std::size_t done = 0;
        const std::size_t all = std::size(distances) * large.size() * direction_count();
        for (const auto& distance : distances) {
            std::vector<Judged> here;
            for (const std::size_t m : large) {
                for (std::size_t d = 0; d < direction_count(); ++d) {
                    progress(done++, all, "far away");
                    if (auto ok = judge("far", models_, m, look(directions[d], distance.fill, 0), here); !ok) return ok;
                }
            }
            for (const FoldTest test : tests) {
                double most = 0, sum = 0, count = 0;
                std::string worst;
                for (const Judged& one : here) {
                    if (one.test != test) continue;
                    const double kept = one.verdicts.triangles;
                    const double value = distance.by_share ? 100 * kept / models_[one.model]->triangles() : kept;
                    sum += value;
                    ++count;
                    if (!(value <= most)) {
                        most = value;
                        worst = models_[one.model]->name();
                    }
                }
                BenchRow row{std::string("kept at ") + distance.name + ", " + name_of(test),
                             distance.by_share ? "%" : "triangles",
                             "the most, of " + worst + "; mean " + rounded(sum / count, 3) +
                                 (has_large ? "" : "; no mesh has more than " + grouped(large_mesh) + " triangles"),
                             most,
                             {},
                             false,
                             distance.by_share ? 1 : 0};
                if (test == promised) row.target = target(std::string("kept at ") + distance.name + ", " + row.unit);
                result_.rows.push_back(std::move(row));
            }
            found.insert(found.end(), here.begin(), here.end());
        }
        add_visibility_rows("far away", found, models_);
        return {};
    }

    // ---- meshes made to be hard

    Result<void> hard() {
        Models hard_models;
        const int triangles = options_.quick ? 3'000 : 24'000;
        for (const HardMesh& mesh : hard_meshes(triangles)) {
            if (auto added = add_hard(hard_models, mesh); !added) return added;
        }
        const std::vector<double> distances = options_.quick ? std::vector{0.85} : std::vector{0.85, 0.3, 0.08};
        const glm::dvec3 direction(0.3, 0.5, 1);
        std::vector<Judged> found;
        const std::size_t all = hard_models.size() * distances.size() * std::size(gazes);
        for (std::size_t m = 0; m < hard_models.size(); ++m)
            for (const double fill : distances)
                for (const double gaze : gazes) {
                    progress(found.size() / std::size(tests), all, "hard meshes");
                    if (auto ok = judge("hard", hard_models, m, look(direction, fill, gaze), found); !ok) return ok;
                }
        BenchTable details{"Hard meshes: triangles kept of all, in all views; visible pixels; largest V; largest V "
                           "of the second judge",
                           {{"mesh", "test", "kept", "visible", "largest V", "second: visible", "V"}}};
        for (std::size_t m = 0; m < hard_models.size(); ++m) {
            std::vector<Judged> of_mesh;
            for (const Judged& one : found)
                if (one.model == m) of_mesh.push_back(one);
            for (const FoldTest test : tests) {
                const Totals first = total(of_mesh, test, 0), second = total(of_mesh, test, 1);
                double kept = 0;
                for (const Judged& one : of_mesh)
                    if (one.test == test)
                        kept += one.verdicts.triangles / static_cast<double>(first.views) / hard_models[m]->triangles();
                details.rows.push_back({hard_models[m]->name(), name_of(test), percent(kept), grouped(first.pixels),
                                        rounded(first.largest, 2), grouped(second.pixels), rounded(second.largest, 2)});
            }
        }
        result_.details.push_back(std::move(details));
        add_visibility_rows("hard meshes", found, hard_models);
        return {};
    }

    // ---- a tolerance in pixels

    // The largest tolerances of which nothing can be seen in any of the looks.
    struct SafeTolerances {
        static constexpr double largest_px = 32, precision = 1.05;
        double px[std::size(geometric_tests)][std::size(gazes)];
        SafeTolerances() { std::fill_n(&px[0][0], std::size(geometric_tests) * std::size(gazes), largest_px); }
    };

    // By bisection, and only where the one so far is not safe; view by view, so that the full model is drawn once for
    // all tests and gazes.
    Result<SafeTolerances> safe_tolerances() {
        SafeTolerances safe;
        std::size_t done = 0;
        const std::size_t all = main_models_ * wanted_fills().size() * direction_count();
        for (std::size_t model = 0; model < main_models_; ++model)
            for (const double fill : wanted_fills())
                for (std::size_t d = 0; d < direction_count(); ++d) {
                    progress(done++, all, "tolerances in pixels");
                    for (std::size_t g = 0; g < std::size(gazes); ++g)
                        for (std::size_t t = 0; t < std::size(geometric_tests); ++t)
                            if (auto ok = lower_tolerance(safe.px[t][g], geometric_tests[t], model,
                                                          look(directions[d], fill, gazes[g]));
                                !ok)
                                return ok.error();
                }
        return safe;
    }

    Result<void> lower_tolerance(double& tolerance, FoldTest test, std::size_t model, const Look& how) {
        if (auto looked = models_[model]->look(how.view); !looked) return looked;
        const auto is_safe = [&](double px) -> Result<bool> {
            WhatOptions what = what_of(test, how);
            what.request.goal = Goal::pixels(px);
            const auto verdict = models_[model]->judge(what, Judge::modern);
            if (!verdict) return verdict.error();
            return verdict->visible_pixels == 0;
        };
        const auto safe = is_safe(tolerance);
        if (!safe) return safe.error();
        if (*safe) return {};
        double low = 1e-3, high = tolerance;
        while (high > low * SafeTolerances::precision) {
            const double middle = std::sqrt(low * high);
            const auto is = is_safe(middle);
            if (!is) return is.error();
            (*is ? low : high) = middle;
        }
        tolerance = low;
        return {};
    }

    // The mean of the looks.
    Result<double> kept_by(FoldTest test, double pixels, const std::vector<std::pair<std::size_t, Look>>& looks) {
        double sum = 0;
        for (const auto& [model, how] : looks) {
            if (auto looked = models_[model]->look(how.view); !looked) return looked.error();
            WhatOptions what = what_of(test, how);
            if (pixels > 0) what.request.goal = Goal::pixels(pixels);
            const auto count = models_[model]->count(what);
            if (!count) return count.error();
            sum += *count;
        }
        return sum / static_cast<double>(looks.size());
    }

    Result<void> tolerance() {
        using Looks = std::vector<std::pair<std::size_t, Look>>;
        const auto looks_of = [&](double gaze, double fill) {
            Looks looks;
            for (std::size_t m = 0; m < main_models_; ++m)
                for (std::size_t d = 0; d < direction_count(); ++d)
                    looks.emplace_back(m, look(directions[d], fill, gaze));
            return looks;
        };
        BenchTable details{
            "One tolerance for all views against one threshold: what each keeps, in triangles, mean of " +
                std::to_string(direction_count()) + " directions and " + std::to_string(main_models_) + " meshes",
            {{"test", "tolerance", "looked at"}}};
        for (const double gaze : {0.0, gaze_degrees})
            for (const double fill : wanted_fills()) details.rows[0].push_back(gaze_name(gaze) + ", " + percent(fill));
        const auto add_line = [&](FoldTest test, double pixels, const std::string& text,
                                  const std::string& where) -> Result<void> {
            std::vector<std::string> line = {name_of(test), text, where};
            for (const double gaze : {0.0, gaze_degrees})
                for (const double fill : wanted_fills()) {
                    const auto kept = kept_by(test, pixels, looks_of(gaze, fill));
                    if (!kept) return kept.error();
                    line.push_back(thousands(*kept));
                }
            details.rows.push_back(std::move(line));
            return {};
        };
        const auto found = safe_tolerances();
        if (!found) return found.error();
        for (std::size_t t = 0; t < std::size(geometric_tests); ++t) {
            const FoldTest test = geometric_tests[t];
            double safe[2] = {};
            for (const double gaze : {0.0, gaze_degrees}) {
                const double px = safe[gaze > 0] = found->px[t][gaze > 0 ? 0 : 1]; // as `gazes` has them
                if (auto added = add_line(test, px, rounded(px, 2) + " px", "safe: " + gaze_name(gaze)); !added)
                    return added;
            }
            result_.rows.push_back(
                {"safe " + name_of(test) + " at " + gaze_name(gaze_degrees) + " over that at the fovea",
                 "x",
                 rounded(safe[1], 3) + " px over " + rounded(safe[0], 3) +
                     " px: no one tolerance does for both; the perceptual threshold is 1 everywhere",
                 safe[1] / safe[0],
                 {},
                 true,
                 1});
        }
        for (const FoldTest test : tests)
            if (auto added = add_line(test, 0, "threshold 1", "everywhere"); !added) return added;
        result_.details.push_back(std::move(details));
        return {};
    }

    // ---- models of sight

    SensitivityBenchOptions sensitivity_options() const {
        return {options_.reference, options_.quick, options_.targets};
    }
    Result<void> add(Result<std::vector<BenchRow>> rows) {
        if (!rows) return rows.error();
        std::move(rows->begin(), rows->end(), std::back_inserter(result_.rows));
        return {};
    }
    Result<void> csf() { return add(bench_csf(sensitivity_options())); }
    Result<void> observers() { return add(bench_observers(sensitivity_options())); }

    // ---- what it costs

    // The largest of the models, from +Z at 90% of the window's height.
    Result<JudgedModel*> subject() {
        const auto largest = std::max_element(models_.begin(), models_.end(), [](const auto& a, const auto& b) {
            return a->triangles() < b->triangles();
        });
        if (auto looked = (*largest)->look(look(directions[0], fills[0], 0).view); !looked) return looked.error();
        return largest->get();
    }

    Result<void> speed() {
        const auto model = subject();
        if (!model) return model.error();
        for (const FoldTest test : tests)
            if (auto measured = full_tests(**model, test); !measured) return measured;
        return moving_lights(**model);
    }

    Result<void> full_tests(JudgedModel& model, FoldTest test) {
        const auto session = model.session(test);
        if (!session) return session.error();
        (*session)->set_gaze(std::nullopt);
        const auto recipe = (*session)->recipe(model.view(), what_of(test, {}).request);
        if (!recipe) return recipe.error();
        const Pinned pinned;
        const double rate = full_tests_per_second((*session)->tree(), *recipe->criterion, recipe->viewpoint, {},
                                                  options_.quick ? 10 : 60);
        result_.rows.push_back({"full tests from scratch, " + name_of(test), "M/s",
                                model.name() + ", every node, one thread", rate / 1e6, target("full tests, M/s"), true,
                                1});
        return {};
    }

    // The light goes around the model by a degree a frame, the eye is still.
    Result<void> moving_lights(JudgedModel& model) {
        const auto bounds = vdtree::LightBounds::measure(model.tree());
        if (!bounds) return bounds.error();
        const auto shared = std::make_shared<const vdtree::LightBounds>(*bounds);
        const auto wanted = static_cast<Index>(std::min<double>(lit_active, 0.5 * model.triangles()));
        for (const auto& [kind, name] :
             {std::pair{TurningLight::directional, "directional"}, std::pair{TurningLight::point, "point"},
              std::pair{TurningLight::highlights, "directional with highlights"}})
            if (auto measured = moving_light(model, shared, wanted, kind, name); !measured) return measured;
        return {};
    }

    Result<void> moving_light(JudgedModel& model, const std::shared_ptr<const vdtree::LightBounds>& bounds,
                              Index wanted, TurningLight kind, const char* name) {
        const auto session = model.session(baseline);
        if (!session) return session.error();
        const vdtree::VertexTree& tree = (*session)->tree();
        perception::FoldTestOptions options;
        vdtree::Viewpoint viewpoint = perception::viewpoint_of(tree, model.view(), options, {}, false);
        options.scene =
            perception::lit_scene(tree, *bounds, lighting_at(tree, kind, 0), viewpoint.eye, (*session)->background());
        const auto made = perception::lit_distances(tree, bounds, model.view(), options);
        if (!made) return made.error();
        vdtree::Cut cut(tree);
        vdtree::FollowOptions following;
        const auto follow = [&](double degrees) {
            viewpoint.lighting = lighting_at(tree, kind, degrees);
            const auto stats = cut.follow(*made, viewpoint, following);
            return stats ? *stats : vdtree::AdjustStats{};
        };
        const AimedThreshold aimed = aim_for(wanted, [&](float threshold) {
            following.threshold = threshold;
            return follow(0).triangles;
        });
        following.threshold = aimed.threshold;
        const Pinned pinned;
        std::vector<double> milliseconds, changes;
        const int frames = options_.quick ? 20 : 200, warm_up = 10;
        for (int frame = 0; frame < frames + warm_up; ++frame) {
            const auto start = BenchClock::now();
            const auto stats = follow(frame);
            static_cast<void>(cut.indices());
            if (frame < warm_up) continue;
            milliseconds.push_back(seconds_since(start) * 1e3);
            changes.push_back(static_cast<double>(stats.folds + stats.unfolds));
        }
        result_.rows.push_back({std::string("moving light, ") + name + ", 1 degree a frame", "ms",
                                model.name() + ", " + grouped(aimed.triangles) + " triangles active, " +
                                    rounded(median(changes), 3) + " changes a frame",
                                median(milliseconds), target("moving light, ms"), false, 2});
        return {};
    }

    const PerceptionBenchOptions& options_;
    std::optional<render::Context> context_;
    perception::CsfModel second_; // of the second judge
    ProgressBar bar_;
    Models models_;
    std::size_t main_models_ = 0;
    PerceptionBenchResult result_;
};

} // namespace

Result<PerceptionBenchResult> bench_perception(const PerceptionBenchOptions& options) {
    const auto second =
        options.second_judge.empty() ? Result(usual_second) : perception::csf_model(options.second_judge);
    if (!second) return second.error();
    return PerceptionBench(options, *second).run();
}

} // namespace unseen::app
