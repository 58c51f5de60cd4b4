#include "fit_bench.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include <hard_mesh.h>
#include <unseen/perception/criterion.h>
#include <unseen/render/context.h>

#include "judged_model.h"
#include "progress_bar.h"
#include "terminal.h"

namespace unseen::app {
namespace {

using perception::FoldModel;
using vdtree::NodeId;

constexpr std::uint64_t seed = 30; // of the views
// Where the viewer looks, from the window's centre; 0: at everything.
constexpr auto aside_degrees = FoldModel::needed_at_degrees;

// Of the model's sensitivity at one of aside_degrees; the others keep it from rising.
template <std::size_t I>
void set_needed(FoldModel& model, double value) {
    model.needed[I] = value;
    for (std::size_t i = 0; i < I; ++i) model.needed[i] = std::max(model.needed[i], value);
    for (std::size_t i = I + 1; i < model.needed.size(); ++i) model.needed[i] = std::min(model.needed[i], value);
}

struct Factor {
    const char* name;
    void (*set)(FoldModel& model, double value);
    std::vector<double> values; // rising, the model's own among them
};

const std::vector<Factor>& factors() {
    static const std::vector<Factor> all = {
        {"neighbourhood", [](FoldModel& m, double v) { m.neighbourhood = v; }, {2, 3, 4, 6, 9}},
        {"needed_at_12_degrees", set_needed<1>, {0.6, 0.8, 0.95, 1}},
        {"needed_at_29_degrees", set_needed<2>, {0.3, 0.4, 0.6, 0.8, 0.95}},
        {"needed_at_50_degrees", set_needed<3>, {0.2, 0.35, 0.5, 0.6}},
        {"needed_by_outlines", [](FoldModel& m, double v) { m.needed_by_outlines = v; }, {0.1, 0.2, 0.3, 0.4, 1}},
        {"contact_reach", [](FoldModel& m, double v) { m.contact_reach = v; }, {0, 1.5, 3, 6, 12}},
        {"least_sine", [](FoldModel& m, double v) { m.least_sine = v; }, {0.05, 0.1, 0.2, 0.4, 1}},
    };
    return all;
}

// A model with one factor of another value, and what came of it.
struct Setting {
    std::string factor;
    double value = 0;
    FoldModel model;
    std::uint64_t triangles = 0, visible_pixels = 0;
    std::array<double, aside_degrees.size()> largest = {}; // V
    std::array<std::string, aside_degrees.size()> worst;   // their meshes
};

std::vector<Setting> settings_of(const std::string& factor) {
    std::vector<Setting> settings;
    for (const Factor& one : factors()) {
        if (!factor.empty() && factor != one.name) continue;
        for (const double value : one.values) {
            Setting& setting = settings.emplace_back();
            setting.factor = one.name;
            setting.value = value;
            one.set(setting.model, value);
        }
    }
    return settings;
}

// What one cut showed; settings often come to the same.
struct Shown {
    std::vector<NodeId> indices;
    double largest = 0;
    std::uint64_t visible_pixels = 0;
};

class Fit {
public:
    explicit Fit(const FitBenchOptions& options)
        : options_(options), settings_(settings_of(options.factor)), random_(seed), bar_("fitting") {}

    Result<FitBenchResult> run() {
        const auto context = render::Context::headless();
        if (!context) return context.error();
        std::vector<HardMesh> meshes = tuning_meshes(options_.quick ? 1'500 : 8'000);
        if (options_.quick) meshes.resize(2);
        for (std::size_t i = 0; i < meshes.size(); ++i) {
            bar_(static_cast<double>(i) / static_cast<double>(meshes.size()), meshes[i].name.c_str());
            auto tree = build_hard_tree(meshes[i]);
            if (!tree) return tree.error();
            auto model = JudgedModel::create(*context, meshes[i].name, std::move(*tree), options_.quick ? 128 : 256);
            if (!model) return model.error();
            if (auto ok = look_from_all_around(*model); !ok) return ok.error();
            result_.table.title += meshes[i].name + " (" + grouped(model->triangles()) + "), ";
        }
        return finished();
    }

private:
    // From near to far, from random directions; looked at and aside, with criteria that do for all directions.
    Result<void> look_from_all_around(JudgedModel& model) {
        std::vector<ViewOptions> views;
        for (const double share : {0.9, 0.3, 0.08}) { // of the window's height
            const double z = uniform(-1, 1), turn = uniform(0, 2 * std::numbers::pi), across = std::sqrt(1 - z * z);
            ViewOptions& view = views.emplace_back();
            view.direction = {across * std::cos(turn), across * std::sin(turn), z};
            view.fill = share * uniform(0.8, 1.2);
        }
        if (options_.quick) views.resize(1);
        const auto session = model.session(FoldTest::error);
        if (!session) return session.error();
        for (std::size_t aside = 0; aside < aside_degrees.size(); ++aside) {
            if (auto looked = model.look(views.front()); !looked) return looked;
            const auto test = test_options(**session, model.view(), aside_degrees[aside]);
            if (!test) return test.error();
            const auto criteria = criteria_of((*session)->tree(), model.view(), *test);
            if (!criteria) return criteria.error();
            for (const ViewOptions& view : views) {
                if (auto looked = model.look(view); !looked) return looked;
                if (auto judged = judge_all(model, **session, *criteria, test->gaze_px, aside); !judged) return judged;
            }
        }
        return {};
    }

    static Result<perception::FoldTestOptions> test_options(session::Session& session, const vdtree::View& view,
                                                            double degrees) {
        const auto scene = session.luminance(view);
        if (!scene) return scene.error();
        perception::FoldTestOptions test;
        test.display = session.observer().display;
        test.scene = *scene;
        if (degrees > 0) test.gaze_px = session::gaze_aside(test.display, view, degrees);
        return test;
    }

    Result<std::vector<vdtree::DistanceCriterion>> criteria_of(const vdtree::VertexTree& tree, const vdtree::View& view,
                                                               perception::FoldTestOptions test) const {
        std::vector<vdtree::DistanceCriterion> criteria;
        for (const Setting& setting : settings_) {
            test.model = setting.model;
            auto criterion = perception::error_distances(tree, view, test);
            if (!criterion) return criterion.error();
            criteria.push_back(std::move(*criterion));
        }
        return criteria;
    }

    Result<void> judge_all(JudgedModel& model, session::Session& session,
                           const std::vector<vdtree::DistanceCriterion>& criteria,
                           const std::optional<glm::dvec2>& gaze_px, std::size_t aside) {
        session.set_gaze(gaze_px ? std::optional(session::Gaze{*gaze_px}) : std::nullopt);
        const auto recipe =
            session.recipe(model.view(), {.fold_test = FoldTest::error,
                                          .purpose = session::Purpose::picture}); // but for its criterion
        if (!recipe) return recipe.error();
        std::vector<Shown> known;
        for (std::size_t i = 0; i < settings_.size(); ++i) {
            vdtree::Cut cut(session.tree());
            if (const auto made = cut.follow(criteria[i], recipe->viewpoint, recipe->options); !made)
                return made.error();
            const auto shown = show(model, cut, gaze_px, known);
            if (!shown) return shown.error();
            Setting& setting = settings_[i];
            setting.triangles += cut.triangle_count();
            setting.visible_pixels += (*shown)->visible_pixels;
            if (double& largest = setting.largest[aside]; !((*shown)->largest <= largest)) {
                largest = (*shown)->largest;
                setting.worst[aside] = model.name();
            }
        }
        return {};
    }

    static Result<const Shown*> show(JudgedModel& model, const vdtree::Cut& cut,
                                     const std::optional<glm::dvec2>& gaze_px, std::vector<Shown>& known) {
        const std::span<const NodeId> indices = cut.indices();
        for (const Shown& one : known)
            if (std::ranges::equal(one.indices, indices)) return &one;
        const auto judged = model.judge(cut, gaze_px);
        if (!judged) return judged.error();
        known.push_back({{indices.begin(), indices.end()}, judged->max_ratio, judged->visible_pixels});
        return &known.back();
    }

    FitBenchResult finished() {
        result_.table.title +=
            "each from " + std::string(options_.quick ? "one place" : "three places") +
            ", looked at, and 12, 29 and 50 degrees aside. Value of the factor: triangles kept, over "
            "those of the model's own value (*); largest V at these four; visible pixels.";
        result_.table.rows = {{"factor", "", "", "", "", ""}};
        double own = 0;
        for (const Setting& s : settings_)
            if (s.model == FoldModel()) own = static_cast<double>(s.triangles);
        for (const Setting& s : settings_) {
            const bool is_own = s.model == FoldModel();
            const double ratio = static_cast<double>(s.triangles) / own;
            if (result_.table.rows.back().front() != s.factor) result_.table.rows.push_back({s.factor});
            result_.table.rows.back().push_back(rounded(s.value, 3) + (is_own ? "*: " : ": ") +
                                                with_decimals(ratio, 3) + "; " + largest_text(s) + "; " +
                                                grouped(s.visible_pixels));
            Json row = {{"factor", s.factor},       {"value", s.value}, {"is_own", is_own},
                        {"triangles", s.triangles}, {"of_own", ratio},  {"visible_pixels", s.visible_pixels}};
            for (std::size_t i = 0; i < aside_degrees.size(); ++i)
                row["seen"].push_back({{"degrees_aside", aside_degrees[i]},
                                       {"largest_v", number_or_null(s.largest[i])},
                                       {"mesh", s.worst[i]}});
            result_.rows.push_back(std::move(row));
        }
        return std::move(result_);
    }

    static std::string largest_text(const Setting& setting) {
        std::string text;
        for (const double v : setting.largest) text += (text.empty() ? "" : " ") + with_decimals(v, 2);
        return text;
    }

    double uniform(double low, double high) {
        return low + (high - low) * static_cast<double>(random_() >> 11) * 0x1p-53;
    }

    const FitBenchOptions& options_;
    std::vector<Setting> settings_;
    std::mt19937_64 random_;
    ProgressBar bar_;
    FitBenchResult result_;
};

} // namespace

std::vector<std::string> fit_factors() {
    std::vector<std::string> names;
    for (const Factor& factor : factors()) names.emplace_back(factor.name);
    return names;
}

Result<FitBenchResult> bench_fit(const FitBenchOptions& options) { return Fit(options).run(); }

} // namespace unseen::app
