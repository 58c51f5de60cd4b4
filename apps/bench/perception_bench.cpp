#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <span>

#include <glm/geometric.hpp>

#include <hard_mesh.h>
#include <unseen/session_gpu/checked.h>

#include "bench_tools.h"
#include "benches.h"
#include "judged_model.h"
#include "progress_bar.h"
#include "session_options.h"
#include "terminal.h"

namespace unseen::app {
namespace {

using vdtree::Index;

constexpr FoldTest tests[] = {FoldTest::luebke_hallen, FoldTest::luebke_hallen_safe, FoldTest::error};
constexpr FoldTest geometric_tests[] = {FoldTest::displacement, FoldTest::extent};
constexpr FoldTest baseline = FoldTest::luebke_hallen;
constexpr FoldTest promised = FoldTest::error;  // the one that the promises are about
constexpr std::string_view foliage = "foliage"; // the savings of crowns of leaves, which nothing is promised of
constexpr double gaze_degrees = 29;
constexpr double gazes[] = {gaze_degrees, 0}; // 0: none, all is looked at
constexpr Index large_mesh = 50'000;          // triangles, of the meshes that are looked at from afar
constexpr Index huge_mesh = 400'000;          // triangles, whose pictures take a minute each in software
// Where the viewer looks in the group `aside`, from the window's centre, in degrees; 0: at everything.
constexpr double eccentricities[] = {0, 6, 12, 20, 29, 40, 50, 70};
const glm::dvec3 directions[] = {{0, 0, 1}, {1, 0, 0}, {1, 1, 1}};

// The least factors by which the promised test keeps fewer triangles than the baseline.
struct SavingTarget {
    double gaze, fill, factor;
};
constexpr SavingTarget saving_targets[] = {{29, 0.9, 2.7}, {29, 0.5, 3.4}, {29, 0.2, 3.3},
                                           {0, 0.9, 1.25}, {0, 0.5, 1.33}, {0, 0.2, 1.55}};

std::string thousands(double triangles) {
    return triangles < 10'000 ? count(triangles).text : rounded(triangles / 1e3, 4) + "k";
}
std::string gaze_name(double degrees) { return degrees > 0 ? rounded(degrees, 2) + " degrees aside" : "fovea"; }

// From where a model is looked at, and how that is told.
struct ToldLook : Look {
    double fill = 0, aside_degrees = 0;
    std::string text = {};
};

// What was seen of one cut.
struct Judged {
    const JudgedModel* model;
    ToldLook look;
    FoldTest test;
    Index triangles;
    std::array<std::uint64_t, 2> visible; // pixels, by the judge and the second one
    std::array<double, 2> v;              // the largest, by the same
};
using AllJudged = std::vector<Judged>;

template <class Takes>
AllJudged those(const AllJudged& all, Takes&& takes) {
    AllJudged some;
    std::ranges::copy_if(all, std::back_inserter(some), takes);
    return some;
}

// Sums over views, for one judge.
struct Totals {
    std::size_t views = 0, views_seen = 0; // with visible pixels
    std::uint64_t pixels = 0;
    double largest = 0; // V
    const Judged* worst = nullptr;

    Totals(const AllJudged& all, FoldTest test, std::size_t judge) {
        for (const Judged& one : all) {
            if (one.test != test) continue;
            ++views;
            views_seen += one.visible[judge] > 0;
            pixels += one.visible[judge];
            if (!worst || !(one.v[judge] <= largest)) largest = one.v[judge], worst = &one;
        }
    }
};

using Models = std::vector<std::unique_ptr<JudgedModel>>;

class PerceptionBench {
public:
    explicit PerceptionBench(const PerceptionOptions& options)
        : options_(options), context_(require(render::Context::headless())), bar_("judging") {}

    BenchReport run() {
        load();
        const std::pair<const char*, void (PerceptionBench::*)()> steps[] = {
            {"savings", &PerceptionBench::savings},     {"aside", &PerceptionBench::aside},
            {"random", &PerceptionBench::random_views}, {"far", &PerceptionBench::far_away},
            {"hard", &PerceptionBench::hard},           {"tolerance", &PerceptionBench::tolerance},
            {"checked", &PerceptionBench::checked},     {"foliage", &PerceptionBench::savings}};
        for (const auto& [group, measure] : steps) {
            group_ = group;
            if (is_wanted(group)) (this->*measure)();
        }
        report_.tables.insert(report_.tables.begin(), table_of(title_, rows_));
        report_.json["title"] = title_;
        report_.json["rows"] = to_json(rows_);
        return std::move(report_);
    }

private:
    bool is_wanted(const std::string& group) const {
        if (options_.only.empty()) return group != foliage;
        return std::ranges::find(options_.only, group) != options_.only.end();
    }

    // ---- models

    void load() {
        title_ = "made-up meshes";
        if (options_.only == std::vector<std::string>{"hard"}) return;
        for (const std::string& file : options_.meshes.empty() ? installed_meshes() : options_.meshes) add_file(file);
        main_models_ = models_.size();
        if (options_.meshes.empty()) settle_huge_models();
        if (models_.empty()) {
            add(models_, "sphere", sample_tree());
            main_models_ = 1;
        }
        if (is_wanted("random") || is_wanted("far"))
            for (const std::string& file : options_.others) add_file(file);
        title_.clear();
        for (std::size_t i = 0; i < models_.size(); ++i)
            title_ += (i ? (i == main_models_ ? "; and " : ", ") : "") + models_[i]->name() + " (" +
                      grouped(models_[i]->triangles()) + ")";
        title_ += "; " + grouped(static_cast<std::uint64_t>(options_.window_px)) + " pixels a side";
    }
    // If nobody named the meshes, huge ones are looked at only at random and from afar, and with --quick not at all.
    void settle_huge_models() {
        const auto huge = std::stable_partition(models_.begin(), models_.end(),
                                                [](const auto& model) { return model->triangles() <= huge_mesh; });
        if (huge == models_.begin()) return; // there are no others
        main_models_ = static_cast<std::size_t>(huge - models_.begin());
        if (options_.quick) models_.erase(huge, models_.end());
    }
    void add_file(const std::filesystem::path& file) { add(models_, file.stem().string(), require(load_tree(file))); }
    void add(Models& models, const HardMesh& mesh) { add(models, mesh.name, require(build_hard_tree(mesh))); }
    void add(Models& models, std::string name, vdtree::VertexTree tree) {
        models.push_back(std::make_unique<JudgedModel>(context_, std::move(name), std::move(tree), options_.window_px));
    }
    std::span<const std::unique_ptr<JudgedModel>> main_models() const { return std::span(models_).first(main_models_); }

    // ---- views

    ToldLook look(glm::dvec3 direction, double fill, double aside_degrees) const {
        ToldLook look;
        look.view.direction = direction;
        look.view.fill = look.fill = fill;
        look.aside_degrees = aside_degrees;
        if (aside_degrees > 0) look.gaze_px = session::gaze_aside({}, window(), aside_degrees);
        look.text = "from " + rounded(direction.x, 2) + " " + rounded(direction.y, 2) + " " + rounded(direction.z, 2) +
                    ", " + percent(fill, 3).text + " of the height, " + gaze_name(aside_degrees);
        return look;
    }
    vdtree::View window() const {
        vdtree::View view;
        view.width = view.height = options_.window_px;
        return view;
    }
    std::span<const glm::dvec3> some_directions() const {
        return std::span(directions).first(options_.quick ? 1 : std::size(directions));
    }
    std::vector<double> fills() const { // of the window's height
        if (group_ == foliage) return {0.9, 0.2, 0.1, 0.02};
        return options_.quick ? std::vector{0.9, 0.2} : std::vector{0.9, 0.5, 0.2};
    }

    // Judges a look by some tests.
    void judge(JudgedModel& model, const ToldLook& how, AllJudged& found, std::span<const FoldTest> by = tests) {
        model.look(how);
        for (const FoldTest test : by) {
            const auto [triangles, verdict] = model.judge(session::Request{.fold_test = test});
            found.push_back({&model,
                             how,
                             test,
                             triangles,
                             {verdict.visible_pixels, verdict.second_visible_pixels},
                             {verdict.v, verdict.second_v}});
            report_.json["views"].push_back({{"group", group_},
                                             {"mesh", model.name()},
                                             {"view", how.text},
                                             {"test", name_of(test)},
                                             {"triangles", triangles},
                                             {"of", model.triangles()},
                                             {"visible_pixels", verdict.visible_pixels},
                                             {"largest_v", number_or_null(verdict.v)},
                                             {"second_visible_pixels", verdict.second_visible_pixels},
                                             {"second_largest_v", number_or_null(verdict.second_v)}});
        }
    }
    void progress(std::size_t done, std::size_t all) {
        bar_(static_cast<double>(done) / static_cast<double>(all), group_);
    }

    // ---- rows

    void add_visibility_rows(const std::string& what, const AllJudged& found) {
        for (const FoldTest test : tests)
            for (const std::size_t judge : {0, 1}) {
                const Totals t(found, test, judge);
                if (t.views == 0) continue;
                rows_.push_back({judge == 0 ? "visible pixels, " + what + ", " + name_of(test)
                                            : "the same by the second judge, barten-fitted",
                                 "", static_cast<double>(t.pixels), 0, 0,
                                 std::to_string(t.views_seen) + " of " + std::to_string(t.views) +
                                     " views with any; largest V " + rounded(t.largest, 3) + ": " +
                                     t.worst->model->name() + ", " + t.worst->look.text});
            }
    }
    static void add_seen(std::vector<Cell>& row, const AllJudged& found, FoldTest test) {
        for (const std::size_t judge : {0, 1}) {
            const Totals t(found, test, judge);
            row.insert(row.end(), {count(static_cast<double>(t.pixels)), number(t.largest, 2)});
        }
    }

    // ---- what is saved against the baseline

    void savings() {
        AllJudged found;
        const std::size_t all = main_models_ * std::size(gazes) * fills().size() * some_directions().size();
        for (const auto& model : main_models())
            for (const double fill : fills())
                for (const glm::dvec3& direction : some_directions())
                    for (const double gaze : gazes) {
                        progress(found.size() / std::size(tests), all);
                        judge(*model, look(direction, fill, gaze), found);
                    }
        BenchTable details{"Triangles kept, mean of " + std::to_string(some_directions().size()) + " directions and " +
                               std::to_string(main_models_) +
                               " meshes; what can be seen of it in the worst view; V, and by the second judge",
                           {{"setting"},
                            {"test"},
                            {"triangles"},
                            {"over luebke-hallen's"},
                            {"visible"},
                            {"largest V"},
                            {"second: visible"},
                            {"V"}}};
        for (const double gaze : gazes)
            for (const double fill : fills()) {
                const AllJudged here =
                    those(found, [&](const Judged& j) { return j.look.aside_degrees == gaze && j.look.fill == fill; });
                for (const FoldTest test : tests) add_saved(here, gaze, fill, test, details);
            }
        report_.tables.push_back(std::move(details));
        add_visibility_rows("these " + std::to_string(found.size() / std::size(tests)) + " views", found);
    }

    void add_saved(const AllJudged& here, double gaze, double fill, FoldTest test, BenchTable& details) {
        const auto triangles_of = [&](const JudgedModel& model, FoldTest by) { // mean of the directions
            double sum = 0;
            for (const Judged& j : here)
                if (j.model == &model && j.test == by)
                    sum += j.triangles / static_cast<double>(some_directions().size());
            return sum;
        };
        const std::string where = gaze_name(gaze) + ", " + percent(fill, 3).text;
        double fewer = 0, kept = 0;
        std::string note;
        for (const auto& model : main_models()) {
            const double base = triangles_of(*model, baseline), saved = triangles_of(*model, test);
            fewer += base / saved / static_cast<double>(main_models_);
            kept += saved / static_cast<double>(main_models_);
            note += (note.empty() ? "" : ", ") + model->name() + " " + thousands(base) + " -> " + thousands(saved);
        }
        details.rows.push_back({where, name_of(test), thousands(kept), rounded(1 / fewer, 3)});
        add_seen(details.rows.back(), here, test);
        if (test == baseline) return;
        BenchRow& row =
            rows_.emplace_back(BenchRow{"fewer triangles, " + where + ", " + name_of(test), "x", fewer, 2, {}, note});
        for (const SavingTarget& target : saving_targets)
            if (test == promised && group_ != foliage && target.gaze == gaze && target.fill == fill)
                row.target = target.factor;
    }

    // ---- random views

    // The models in turn, huge ones only so often.
    static std::vector<JudgedModel*> models_of_random_views(std::size_t views, const Models& models) {
        const auto is_huge = [](const auto& model) { return model->triangles() > huge_mesh; };
        const bool all_huge = std::ranges::all_of(models, is_huge);
        constexpr std::ptrdiff_t huge_views = 6; // of each such mesh
        std::vector<JudgedModel*> order;
        for (std::size_t m = 0; order.size() < views; m = (m + 1) % models.size())
            if (!is_huge(models[m]) || all_huge || std::ranges::count(order, models[m].get()) < huge_views)
                order.push_back(models[m].get());
        return order;
    }

    ToldLook random_look(std::size_t i, Random& random) const {
        const glm::dvec3 direction = random.direction();
        ToldLook how = look(direction, 0.03 * std::pow(50.0, random.between(0, 1)), 0); // 3% to 150%
        if (i % 3 == 2) {
            how.view.fov_degrees = random.between(10, 70);
            how.text += ", field " + rounded(*how.view.fov_degrees, 3);
        }
        if (i % 4 >= 2) {
            const double ppd = 20 * std::pow(6.0, random.between(0, 1)); // to 120
            set_pixels_per_degree(how.display, perception::PixelsPerDegree(ppd));
            if (random.between(0, 1) < 0.5) how.display.peak = perception::Luminance(1000);
            how.background = to_luminance(how.display, std::pow(random.between(0, 1), 3));
            how.text += ", " + rounded(ppd, 3) + " pixels per degree, " + rounded(how.display.peak.value(), 4) +
                        " cd/m2, before " + rounded(how.background->value(), 3);
        }
        if (i % 2) {
            const double degrees = random.between(0, 70), where = random.between(0, 2 * std::numbers::pi);
            const glm::dvec2 centre(options_.window_px * 0.5);
            const double px = session::gaze_aside(how.display, window(), degrees).x - centre.x;
            how.gaze_px = centre + px * glm::dvec2(std::cos(where), std::sin(where));
            how.text.replace(how.text.rfind("fovea"), 5, "gaze " + rounded(degrees, 3) + " degrees aside");
        }
        return how;
    }

    // On all kinds of displays, before anything from black to white, at all sizes, looked at and aside. Of the models,
    // and of regular waves drawn at random, which no factor was fitted on.
    void random_views() {
        const std::uint64_t seed = options_.seed ? *options_.seed : std::random_device()();
        Random random(seed);
        const std::size_t own = models_.size(), waved = options_.quick ? 1 : 4;
        for (std::size_t i = 0; i < waved; ++i) {
            const double waves = 2 * std::pow(16.0, random.between(0, 1)),
                         height = 0.0005 * std::pow(64.0, random.between(0, 1));
            HardMesh mesh = waved_square(options_.quick ? 3'000 : 60'000, height, waves);
            mesh.name = rounded(waves, 3) + " waves " + rounded(height, 2) + " high";
            add(models_, mesh);
        }
        const std::size_t views = options_.quick ? std::min<std::size_t>(models_.size(), 6) : options_.random_views;
        const std::vector<JudgedModel*> order = models_of_random_views(views, models_);
        AllJudged found;
        for (std::size_t i = 0; i < views; ++i) {
            progress(i, views);
            judge(*order[i], random_look(i, random), found);
        }
        add_visibility_rows(std::to_string(views) + " random views, seed " + std::to_string(seed), found);
        models_.resize(own);
    }

    // ---- where the viewer looks

    // The promised test by eccentricity: of the models, and of regular patterns, whose errors are alike everywhere.
    void aside() {
        Models waves;
        for (const HardMesh& mesh : open_sheets(options_.quick ? 3'000 : 60'000))
            if (mesh.name.find("waves") != mesh.name.npos && (waves.empty() || !options_.quick)) add(waves, mesh);
        std::vector<JudgedModel*> models;
        for (const auto& model : main_models()) models.push_back(model.get());
        for (const auto& model : waves) models.push_back(model.get());
        const std::vector<double> near_and_far = options_.quick ? std::vector{0.9} : std::vector{0.9, 0.3};
        AllJudged found;
        const std::size_t all = models.size() * near_and_far.size() * some_directions().size();
        for (JudgedModel* const model : models)
            for (const double fill : near_and_far)
                for (const glm::dvec3& direction : some_directions()) {
                    progress(found.size() / std::size(eccentricities), all);
                    for (const double degrees : eccentricities)
                        judge(*model, look(direction, fill, degrees), found, {&promised, 1});
                }
        BenchTable details{"By where the viewer looks, degrees from the window's centre; " + std::to_string(all) +
                               " views each, of " + std::to_string(models.size()) +
                               " meshes: V of the default observer by both judges, median and largest",
                           {{"degrees aside"},
                            {"triangles of the models"},
                            {"V"},
                            {"largest"},
                            {"second: V"},
                            {"largest"},
                            {"visible pixels"}}};
        for (const double degrees : eccentricities) {
            const AllJudged here = those(found, [&](const Judged& j) { return j.look.aside_degrees == degrees; });
            double pixels = 0, kept = 0;
            for (const Judged& j : here) {
                pixels += static_cast<double>(j.visible[0] + j.visible[1]);
                if (std::ranges::find(main_models(), j.model, &std::unique_ptr<JudgedModel>::get) !=
                    main_models().end())
                    kept += j.triangles;
            }
            std::vector<Cell> row = {degrees > 0 ? rounded(degrees, 2) : "looked at", count(kept)};
            for (const std::size_t judge : {0, 1}) {
                std::vector<double> v;
                for (const Judged& j : here) v.push_back(j.v[judge]);
                row.insert(row.end(), {number(median(v), 2), number(std::ranges::max(v), 3)});
            }
            row.push_back(count(pixels));
            details.rows.push_back(std::move(row));
        }
        report_.tables.push_back(std::move(details));
        add_visibility_rows(std::to_string(found.size()) + " views by where the viewer looks", found);
    }

    // ---- far away

    void far_away() {
        std::vector<JudgedModel*> models;
        for (const auto& model : models_)
            if (model->triangles() > large_mesh) models.push_back(model.get());
        const bool has_large = !models.empty();
        if (!has_large)
            for (const auto& model : models_) models.push_back(model.get());
        const struct {
            std::string name;
            double fill;
            bool by_share;
            double target;
        } distances[] = {{"2 pixels", 2.0 / options_.window_px, false, 200},
                         {"20 pixels", 20.0 / options_.window_px, true, 5},
                         {"5% of the height", 0.05, true, 50}};
        AllJudged found;
        const std::size_t all = std::size(distances) * models.size() * some_directions().size();
        for (const auto& distance : distances) {
            AllJudged here;
            for (JudgedModel* const model : models)
                for (const glm::dvec3& direction : some_directions()) {
                    progress((found.size() + here.size()) / std::size(tests), all);
                    judge(*model, look(direction, distance.fill, 0), here);
                }
            for (const FoldTest test : tests) {
                double most = 0, sum = 0, views = 0;
                std::string worst;
                for (const Judged& one : here) {
                    if (one.test != test) continue;
                    const double kept = one.triangles;
                    const double value = distance.by_share ? 100 * kept / one.model->triangles() : kept;
                    sum += value, ++views;
                    if (!(value <= most)) most = value, worst = one.model->name();
                }
                BenchRow& row = rows_.emplace_back(BenchRow{"kept at " + distance.name + ", " + name_of(test),
                                                            distance.by_share ? "%" : "triangles", most,
                                                            distance.by_share ? 1 : 0});
                row.note = "the most, of " + worst + "; mean " + rounded(sum / views, 3) +
                           (has_large ? "" : "; no mesh has more than " + grouped(large_mesh) + " triangles");
                if (test == promised) row.target = distance.target;
            }
            found.insert(found.end(), here.begin(), here.end());
        }
        add_visibility_rows("far away", found);
    }

    // ---- meshes made to be hard

    void hard() {
        Models models;
        for (const HardMesh& mesh : hard_meshes(options_.quick ? 3'000 : 24'000)) add(models, mesh);
        const std::vector<double> distances = options_.quick ? std::vector{0.85} : std::vector{0.85, 0.3, 0.08};
        AllJudged found;
        const std::size_t all = models.size() * distances.size() * std::size(gazes);
        for (const auto& model : models)
            for (const double fill : distances)
                for (const double gaze : gazes) {
                    progress(found.size() / std::size(tests), all);
                    judge(*model, look({0.3, 0.5, 1}, fill, gaze), found);
                }
        BenchTable details{"Hard meshes: triangles kept of all, in all views; visible pixels; largest V; largest V "
                           "of the second judge",
                           {{"mesh"}, {"test"}, {"kept"}, {"visible"}, {"largest V"}, {"second: visible"}, {"V"}}};
        for (const auto& model : models) {
            const AllJudged of_mesh = those(found, [&](const Judged& j) { return j.model == model.get(); });
            for (const FoldTest test : tests) {
                double kept = 0;
                for (const Judged& one : of_mesh)
                    if (one.test == test)
                        kept +=
                            one.triangles / static_cast<double>(Totals(of_mesh, test, 0).views) / model->triangles();
                details.rows.push_back({model->name(), name_of(test), percent(kept, 3)});
                add_seen(details.rows.back(), of_mesh, test);
            }
        }
        report_.tables.push_back(std::move(details));
        add_visibility_rows("hard meshes", found);
    }

    // ---- a tolerance in pixels

    // The largest tolerance of which nothing can be seen in any of the looks, by bisection, and only in looks in which
    // the one so far is not safe.
    double safe_tolerance(FoldTest test, double gaze) {
        constexpr double precision = 1.05;
        double tolerance = 32;
        for (const auto& model : main_models())
            for (const double fill : fills())
                for (const glm::dvec3& direction : some_directions()) {
                    model->look(look(direction, fill, gaze));
                    const auto is_safe = [&](double px) {
                        return model->judge(session::Request{.goal = Goal::pixels(px), .fold_test = test})
                                   .verdict.visible_pixels == 0;
                    };
                    if (is_safe(tolerance)) continue;
                    double low = 1e-3, high = tolerance;
                    while (high > low * precision) {
                        const double middle = std::sqrt(low * high);
                        (is_safe(middle) ? low : high) = middle;
                    }
                    tolerance = low;
                }
        return tolerance;
    }

    // The mean of the models and directions.
    double kept_by(const session::Request& request, double gaze, double fill) {
        double sum = 0;
        for (const auto& model : main_models())
            for (const glm::dvec3& direction : some_directions()) {
                model->look(look(direction, fill, gaze));
                sum += model->count(request);
            }
        return sum / static_cast<double>(main_models_ * some_directions().size());
    }

    void tolerance() {
        BenchTable details{
            "One tolerance for all views against one threshold: what each keeps, in triangles, mean of " +
                std::to_string(some_directions().size()) + " directions and " + std::to_string(main_models_) +
                " meshes",
            {{"test"}, {"tolerance"}, {"looked at"}}};
        constexpr double both[] = {0, gaze_degrees};
        for (const double gaze : both)
            for (const double fill : fills())
                details.columns.push_back({gaze_name(gaze) + ", " + percent(fill, 3).text});
        const auto add_line = [&](const session::Request& request, const std::string& text, const std::string& where) {
            std::vector<Cell>& line =
                details.rows.emplace_back(std::vector<Cell>{name_of(*request.fold_test), text, where});
            for (const double gaze : both)
                for (const double fill : fills()) line.push_back(thousands(kept_by(request, gaze, fill)));
        };
        std::size_t done = 0;
        for (const FoldTest test : geometric_tests) {
            double safe[2] = {};
            for (const double gaze : both) {
                progress(done++, std::size(geometric_tests) * std::size(both));
                const double px = safe[gaze > 0] = safe_tolerance(test, gaze);
                add_line({.goal = Goal::pixels(px), .fold_test = test}, rounded(px, 2) + " px",
                         "safe: " + gaze_name(gaze));
            }
            rows_.push_back({"safe " + name_of(test) + " at " + gaze_name(gaze_degrees) + " over that at the fovea",
                             "x",
                             safe[1] / safe[0],
                             1,
                             {},
                             rounded(safe[1], 3) + " px over " + rounded(safe[0], 3) +
                                 " px. No one tolerance does for both. The perceptual threshold is 1 everywhere"});
        }
        for (const FoldTest test : tests) add_line({.fold_test = test}, "threshold 1", "everywhere");
        report_.tables.push_back(std::move(details));
    }

    // ---- cells checked by pictures, in views that had no part in it

    void checked() {
        constexpr double cell_degrees = 5;
        const int views = options_.quick ? 5 : 50;
        BenchTable details{
            "One simplification for a cell of 5 degrees around a view, 80% of the height: by the model as a "
            "mesh, and checked by pictures; what both judges see in " +
                std::to_string(views) + " other views of the cell",
            {{"mesh"}, {"looked at"}, {"model"}, {"checked"}, {"of it"}, {"visible"}, {"largest V"}, {"s"}}};
        std::size_t done = 0;
        for (const auto& model : models_) {
            if (model->triangles() > huge_mesh) continue;
            for (const double gaze : gazes) {
                progress(done++, models_.size() * std::size(gazes));
                const ToldLook how = look({0.3, 0.2, 1}, 0.8, gaze);
                model->look(how);
                session::Session& session = model->session(promised);
                session.set_gaze(how.gaze_px ? std::optional(session::Gaze{*how.gaze_px}) : std::nullopt);
                const auto bounded = require(session.simplify(model->view(), {.reasons = false}));
                const auto made = require(session::simplify_checked(
                    session, context_, model->view(), {.reasons = false}, {.cell_degrees = cell_degrees}));
                const auto renderer = std::make_shared<session::SceneRenderer>(
                    require(session::SceneRenderer::create(context_, session)));
                std::uint64_t visible = 0;
                double v = 0;
                constexpr std::uint64_t other_views = 77'000'000'000; // that checking had nothing to do with
                for (const vdtree::View& view :
                     session::views_in_cell(model->view(), cell_degrees, views, other_views)) {
                    const auto seen = CarefulJudge(renderer, session, view).judge(*renderer, made.cuts);
                    visible += std::max(seen.visible_pixels, seen.second_visible_pixels);
                    v = std::max({v, seen.v, seen.second_v});
                }
                details.rows.push_back({model->name(), gaze_name(gaze), thousands(bounded.stats.triangles),
                                        thousands(made.stats.triangles),
                                        percent(static_cast<double>(made.stats.triangles) / bounded.stats.triangles, 3),
                                        count(static_cast<double>(visible)), number(v, 2),
                                        number(made.check->seconds, 2)});
            }
        }
        report_.tables.push_back(std::move(details));
    }

    const PerceptionOptions& options_;
    render::Context context_;
    ProgressBar bar_;
    const char* group_ = ""; // that is being measured
    Models models_;
    std::size_t main_models_ = 0;
    std::string title_;
    std::vector<BenchRow> rows_;
    BenchReport report_;
};

} // namespace

BenchReport bench_perception(const PerceptionOptions& options) { return PerceptionBench(options).run(); }

} // namespace unseen::app
