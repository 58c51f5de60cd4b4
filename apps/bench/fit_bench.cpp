#include <algorithm>
#include <array>
#include <cmath>

#include <hard_mesh.h>
#include <unseen/perception/criterion.h>

#include "bench_tools.h"
#include "benches.h"
#include "judged_model.h"
#include "progress_bar.h"
#include "terminal.h"

namespace unseen::app {
namespace {

using perception::FoldModel;
using vdtree::WedgeId;

// Where the viewer looks, from the window's centre; 0: at everything.
constexpr auto aside_degrees = FoldModel::needed_at_degrees;

// Sets the model's sensitivity at one of aside_degrees; the others keep it from rising.
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
    double triangles = 0, visible_pixels = 0;
    std::array<double, aside_degrees.size()> largest = {}; // V
    std::array<std::string, aside_degrees.size()> worst;   // their meshes
};

std::vector<Setting> settings_of(const std::string& factor) {
    std::vector<Setting> settings;
    for (const Factor& one : factors()) {
        if (!factor.empty() && factor != one.name) continue;
        for (const double value : one.values) {
            Setting& setting = settings.emplace_back(Setting{one.name, value, {}, 0, 0, {}, {}});
            one.set(setting.model, value);
        }
    }
    return settings;
}

// One look at a model by each setting's criterion; settings often come to the same cut.
void judge_all(JudgedModel& model, const std::vector<vdtree::DistanceCriterion>& criteria, std::size_t aside,
               std::vector<Setting>& settings) {
    session::Session& session = model.session(FoldTest::error);
    const session::CutRecipe recipe = require(session.recipe(
        model.view(), {.fold_test = FoldTest::error, .purpose = session::Purpose::picture})); // but for its criterion
    std::vector<std::pair<std::vector<WedgeId>, session::PictureVerdict>> known;
    for (std::size_t i = 0; i < settings.size(); ++i) {
        vdtree::Cut cut(session.tree());
        require(cut.follow(criteria[i], recipe.viewpoint, recipe.options));
        const std::span<const WedgeId> indices = cut.indices();
        auto shown =
            std::ranges::find_if(known, [&](const auto& one) { return std::ranges::equal(one.first, indices); });
        if (shown == known.end())
            shown = known.insert(shown, {{indices.begin(), indices.end()}, model.judge(cut).verdict});
        Setting& setting = settings[i];
        setting.triangles += cut.triangle_count();
        setting.visible_pixels += static_cast<double>(shown->second.visible_pixels);
        if (shown->second.v <= setting.largest[aside]) continue;
        setting.largest[aside] = shown->second.v;
        setting.worst[aside] = model.name();
    }
}

// From near to far, from random directions; looked at and aside, with criteria that do for all directions.
void look_from_all_around(JudgedModel& model, Random& random, bool quick, std::vector<Setting>& settings) {
    std::vector<Look> looks;
    for (const double share : {0.9, 0.3, 0.08}) { // of the window's height
        ViewOptions& view = looks.emplace_back().view;
        view.direction = random.direction();
        view.fill = share * random.between(0.8, 1.2);
    }
    if (quick) looks.resize(1);
    session::Session& session = model.session(FoldTest::error);
    for (std::size_t aside = 0; aside < aside_degrees.size(); ++aside) {
        model.look(looks.front());
        perception::FoldTestOptions test;
        test.display = session.observer().display;
        test.scene = require(session.luminance(model.view()));
        if (aside_degrees[aside] > 0)
            test.gaze_px = session::gaze_aside(test.display, model.view(), aside_degrees[aside]);
        session.set_gaze(test.gaze_px ? std::optional(session::Gaze{*test.gaze_px}) : std::nullopt);
        std::vector<vdtree::DistanceCriterion> criteria;
        for (const Setting& setting : settings) {
            test.model = setting.model;
            criteria.push_back(require(perception::error_distances(session.tree(), model.view(), test)));
        }
        for (Look& look : looks) {
            look.gaze_px = test.gaze_px;
            model.look(look);
            judge_all(model, criteria, aside, settings);
        }
    }
}

BenchReport report_of(const std::vector<Setting>& settings, std::string title) {
    BenchTable table{.title = std::move(title), .columns = {{"factor"}, {}, {}, {}, {}, {}}};
    Json rows = Json::array();
    double own = 0;
    for (const Setting& s : settings)
        if (s.model == FoldModel()) own = s.triangles;
    for (const Setting& s : settings) {
        const bool is_own = s.model == FoldModel();
        const double ratio = s.triangles / own;
        if (table.rows.empty() || table.rows.back().front().text != s.factor) table.rows.push_back({s.factor});
        std::string largest;
        for (const double v : s.largest) largest += (largest.empty() ? "" : " ") + with_decimals(v, 2);
        table.rows.back().push_back(rounded(s.value, 3) + (is_own ? "*: " : ": ") + with_decimals(ratio, 3) + "; " +
                                    largest + "; " + count(s.visible_pixels).text);
        Json& row = rows.emplace_back(Json{{"factor", s.factor},
                                           {"value", s.value},
                                           {"is_own", is_own},
                                           {"triangles", s.triangles},
                                           {"of_own", ratio},
                                           {"visible_pixels", s.visible_pixels}});
        for (std::size_t i = 0; i < aside_degrees.size(); ++i)
            row["seen"].push_back({{"degrees_aside", aside_degrees[i]},
                                   {"largest_v", number_or_null(s.largest[i])},
                                   {"mesh", s.worst[i]}});
    }
    return {{std::move(table)}, {{"rows", std::move(rows)}}};
}

} // namespace

std::vector<std::string> fit_factors() {
    std::vector<std::string> names;
    for (const Factor& factor : factors()) names.emplace_back(factor.name);
    return names;
}

BenchReport bench_fit(const FitOptions& options) {
    const render::Context context = require(render::Context::headless());
    std::vector<Setting> settings = settings_of(options.factor);
    constexpr std::uint64_t seed = 30; // of the views
    Random random(seed);
    std::vector<HardMesh> meshes = tuning_meshes(options.quick ? 1'500 : 8'000);
    if (options.quick) meshes.resize(2);
    std::string title;
    ProgressBar bar("fitting");
    for (std::size_t i = 0; i < meshes.size(); ++i) {
        bar(static_cast<double>(i) / static_cast<double>(meshes.size()), meshes[i].name.c_str());
        JudgedModel model(context, meshes[i].name, require(build_hard_tree(meshes[i])), options.quick ? 128 : 256);
        look_from_all_around(model, random, options.quick, settings);
        title += model.name() + " (" + grouped(model.triangles()) + "), ";
    }
    return report_of(settings, title + "each from " + (options.quick ? "one place" : "three places") +
                                   ", looked at, and 12, 29 and 50 degrees aside. Value of the factor: triangles "
                                   "kept, over those of the model's own value (*); largest V at these four; visible "
                                   "pixels.");
}

} // namespace unseen::app
