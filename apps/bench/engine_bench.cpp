#include "engine_bench.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <limits>
#include <numbers>
#include <unordered_map>
#include <utility>

#include <sample_mesh.h>
#include <subdivide.h>
#include <unseen/meshio/mesh_file.h>
#include <unseen/perception/criterion.h>
#include <unseen/perception/fold_measurement.h>
#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/tree_io.h>

#include "bench_tools.h"
#include "child_process.h"
#include "load_model.h"
#include "progress_bar.h"
#include "terminal.h"

namespace unseen::app {
namespace {

namespace fs = std::filesystem;
using Clock = BenchClock;

constexpr vdtree::Index wanted_active = 100'000; // triangles of the cuts that are measured
constexpr vdtree::Index budget_triangles = 100'000;
constexpr double most_of_mesh = 0.5;          // at small meshes: so much of them is active
constexpr double fill = 0.9;                  // of the window's height
constexpr int sphere_rows = 466;              // 868,624 triangles, about as many as the dragon
constexpr double orbit_steps[] = {0.1, 1, 5}; // degrees a frame
constexpr bool has_mpi = UNSEEN_HAS_MPI;      // the command `unseen` has

double share_below(std::vector<double> values, double share) {
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

// "0.9 M", "70 k"
std::string size_name(std::uint64_t triangles) {
    return triangles < 500'000 ? rounded(static_cast<double>(triangles) / 1e3, 3) + " k"
                               : rounded(static_cast<double>(triangles) / 1e6, 2) + " M";
}

// A folder for meshes and trees: the user's, or one that goes.
class Workshop {
public:
    static Result<Workshop> open(const std::string& keep) {
        Workshop shop;
        shop.is_kept_ = !keep.empty();
        shop.folder_ = keep;
        std::error_code failed;
        if (!keep.empty()) {
            fs::create_directories(keep, failed);
        } else {
            std::string name = (fs::temp_directory_path() / "unseen-bench-XXXXXX").string();
            if (!mkdtemp(name.data())) failed = std::error_code(errno, std::generic_category());
            shop.folder_ = name;
        }
        if (failed)
            return Error{ErrorCode::io_failure,
                         "Cannot make the folder '" + shop.folder_.string() + "': " + failed.message() + "."};
        return shop;
    }
    Workshop(Workshop&& other) noexcept
        : folder_(std::move(other.folder_)), is_kept_(std::exchange(other.is_kept_, true)) {}
    Workshop& operator=(Workshop&&) = delete;
    ~Workshop() {
        std::error_code ignored;
        if (!is_kept_) fs::remove_all(folder_, ignored);
    }
    fs::path operator/(const std::string& name) const { return folder_ / name; }

private:
    Workshop() = default;
    fs::path folder_;
    bool is_kept_ = true;
};

// ---- meshes

struct NamedMesh {
    vdtree::Mesh mesh;
    std::string name;
};

Result<NamedMesh> base_mesh(const EngineBenchOptions& options) {
    fs::path file = options.mesh.empty() ? find_in_checkout(dragon_file) : fs::path(options.mesh);
    if (file.empty()) {
        print_note("the dragon is not there ('./quickstart --dragon' fetches it): a sphere with bumps stands in.");
        return NamedMesh{bumpy_sphere(sphere_rows), "sphere"};
    }
    auto read = read_mesh_file(file);
    if (!read) return read.error();
    return NamedMesh{std::move(read->mesh), file.stem().string()};
}

Result<vdtree::Mesh> simplified(const vdtree::Mesh& mesh, std::uint64_t triangles) {
    vdtree::BuildOptions building;
    ProgressBar bar("simplifying");
    building.progress = std::ref(bar);
    const auto tree = vdtree::build_tree(mesh.view(), building);
    if (!tree) return tree.error();
    const vdtree::Sphere sphere = tree->bounding_sphere();
    vdtree::View view; // from so far that the extents alone count
    view.eye = tree->origin() + glm::dvec3(sphere.centre) + glm::dvec3(0, 0, 100 * sphere.radius);
    view.target = tree->origin() + glm::dvec3(sphere.centre);
    vdtree::FollowOptions options;
    options.triangle_budget = static_cast<vdtree::Index>(triangles);
    const auto extent = vdtree::extent_criterion(*tree, view, 1);
    if (!extent) return extent.error();
    vdtree::Cut cut(*tree);
    if (const auto made = cut.follow(*extent, {.eye = vdtree::eye_in_tree(*tree, view, {})}, options); !made)
        return made.error();
    return vdtree::extract_mesh(cut);
}

Result<vdtree::Mesh> mesh_of_size(const vdtree::Mesh& base, std::uint64_t triangles) {
    if (triangles < base.triangles.size()) return simplified(base, triangles);
    ProgressBar bar("subdividing");
    SubdivideOptions options;
    options.triangles = triangles;
    options.progress = std::ref(bar);
    return subdivide(base, options);
}

// Whether a mesh is of the size that is asked for, as it is: 0.9 M is the dragon.
bool is_about(std::uint64_t have, std::uint64_t wanted) {
    const double ratio = static_cast<double>(have) / static_cast<double>(wanted);
    return ratio > 0.9 && ratio < 1.1;
}

// The mesh of a size, as a file.
Result<fs::path> mesh_file(const Workshop& shop, const NamedMesh& base, std::uint64_t triangles) {
    const bool is_base = is_about(base.mesh.triangles.size(), triangles);
    const std::uint64_t count = is_base ? base.mesh.triangles.size() : triangles;
    const fs::path file = shop / (base.name + "-" + std::to_string(count) + ".ply");
    std::error_code unknown;
    if (fs::exists(file, unknown)) return file;
    Result<void> written;
    if (is_base) {
        written = meshio::write_mesh(file, base.mesh.view());
    } else {
        const auto mesh = mesh_of_size(base.mesh, triangles);
        if (!mesh) return mesh.error();
        written = meshio::write_mesh(file, mesh->view());
    }
    if (!written) return written.error();
    return file;
}

// ---- building

struct Building {
    fs::path tree;
    double seconds = 0; // of building alone, without reading and writing
    double wall_seconds = 0;
    double peak_bytes = 0; // of the whole process
    double triangles = 0;
};

Result<Building> build(const fs::path& mesh, const fs::path& tree, std::vector<std::string> more,
                       std::vector<std::string> launcher = {}) {
    std::vector<std::string> words = std::move(launcher);
    words.insert(words.end(), {command_beside("unseen"), "build", mesh.string(), "-o", tree.string(),
                               "--no-fold-errors", "--json", "-"});
    words.insert(words.end(), more.begin(), more.end());
    print_note("building " + tree.filename().string() + " ...");
    const auto outcome = run_child(words);
    if (!outcome) return outcome.error();
    const Json report = Json::parse(outcome->out, nullptr, false);
    if (outcome->status != 0 || !report.is_object())
        return Error{ErrorCode::io_failure, "'unseen build' of '" + mesh.string() + "' failed; its message is above."};
    return Building{tree, report.value("build_seconds", 0.0), outcome->seconds, report.value("peak_bytes", 0.0),
                    report.value("triangles", 0.0)};
}

// The tree of a size; built where it is not kept.
Result<vdtree::VertexTree> tree_of_size(const Workshop& shop, const NamedMesh& base, std::uint64_t triangles,
                                        Json& json) {
    const auto mesh = mesh_file(shop, base, triangles);
    if (!mesh) return mesh.error();
    fs::path file = *mesh;
    file.replace_extension(".vdt");
    std::error_code unknown;
    if (fs::exists(file, unknown))
        if (auto tree = load_tree(file); tree) return tree;
    const auto built = build(*mesh, file, {"--threads", "1"});
    if (!built) return built.error();
    json["build_seconds"] = built->seconds;
    json["build_peak_bytes_a_triangle"] = built->peak_bytes / built->triangles;
    return load_tree(file);
}

// The same tree with the errors of its folds, for the fold test 'error'; measured where it is not kept.
Result<vdtree::VertexTree> with_errors(const Workshop& shop, const NamedMesh& base, const vdtree::VertexTree& tree) {
    const fs::path file = shop / (base.name + "-" + std::to_string(tree.triangle_count()) + "-fold-errors.vdt");
    std::error_code unknown;
    if (fs::exists(file, unknown))
        if (auto kept = load_tree(file); kept) return kept;
    print_note("measuring fold errors ...");
    auto measured = perception::measure_folds(tree);
    if (!measured) return measured.error();
    if (const auto written = vdtree::write_tree(file, *measured); !written) return written.error();
    return measured;
}

// ---- views

enum class FoldTest { luebke_hallen, error };
std::string name_of(FoldTest test) { return test == FoldTest::error ? "error" : "luebke-hallen"; }

// The model in the window of the default display, around the vertical axis.
class Orbit {
public:
    struct Kind {
        FoldTest test = FoldTest::luebke_hallen;
        bool with_gaze = false, with_frustum = false;
    };

    Orbit(const vdtree::VertexTree& tree, const Kind& kind) : tree_(tree), kind_(kind) {
        window_.fov_y_degrees = perception::physical_field(options_.display, window_.height).value();
        const vdtree::LuminanceRange range = tree.luminance_range();
        const auto background =
            static_cast<float>(perception::to_relative(options_.display, perception::Luminance(20)));
        options_.scene = {std::min(range.lo, background), std::max(range.hi, background)};
        if (!kind.with_gaze) return;
        options_.gaze_px = session::gaze_aside(options_.display, window_, session::usual_degrees_aside);
    }

    vdtree::View view(double degrees) const {
        const double angle = degrees * std::numbers::pi / 180;
        const vdtree::Sphere sphere = tree_.bounding_sphere();
        return vdtree::frame_sphere(tree_.origin() + glm::dvec3(sphere.centre), sphere.radius,
                                    {std::sin(angle), 0, std::cos(angle)}, fill, window_);
    }
    // All of the model is in the window: there is nothing to cull, with a frustum or without.
    vdtree::Viewpoint at(double degrees) const {
        return perception::viewpoint_of(tree_, view(degrees), options_, {}, kind_.with_frustum);
    }
    Result<vdtree::DistanceCriterion> criterion() const {
        if (kind_.test == FoldTest::error) return perception::error_distances(tree_, view(0), options_);
        return perception::luebke_hallen_distances(tree_, view(0), options_);
    }

private:
    const vdtree::VertexTree& tree_;
    Kind kind_;
    perception::FoldTestOptions options_;
    vdtree::View window_;
};

// ---- cuts

// Follows one criterion; errors (there are none for views that are made here) end the program's run.
class Subject {
public:
    static Result<Subject> create(const vdtree::VertexTree& tree, const Orbit::Kind& kind) {
        Orbit orbit(tree, kind);
        auto criterion = orbit.criterion();
        if (!criterion) return criterion.error();
        return Subject(tree, orbit, std::move(*criterion));
    }

    const vdtree::VertexTree& tree() const { return tree_; }
    const Orbit& orbit() const { return orbit_; }
    float threshold() const { return threshold_; }

    vdtree::AdjustStats follow(vdtree::Cut& cut, double degrees) const {
        return follow(cut, orbit_.at(degrees), threshold_);
    }
    vdtree::AdjustStats follow(vdtree::Cut& cut, const vdtree::Viewpoint& viewpoint, float threshold) const {
        vdtree::FollowOptions options;
        options.threshold = threshold;
        return follow(cut, viewpoint, options);
    }
    vdtree::AdjustStats follow(vdtree::Cut& cut, const vdtree::Viewpoint& viewpoint,
                               const vdtree::FollowOptions& options) const {
        const auto stats = cut.follow(criterion_, viewpoint, options);
        return stats ? *stats : vdtree::AdjustStats{};
    }
    double full_tests_per_second(int repeats) const {
        vdtree::FollowOptions options;
        options.threshold = threshold_;
        return app::full_tests_per_second(tree_, criterion_, orbit_.at(0), options, repeats);
    }

    // Chooses the threshold at which about so many triangles are active, by bisection.
    vdtree::Index aim_for(vdtree::Index triangles) {
        vdtree::Cut cut(tree_);
        const AimedThreshold aimed =
            app::aim_for(triangles, [&](float threshold) { return follow(cut, orbit_.at(0), threshold).triangles; });
        threshold_ = aimed.threshold;
        return aimed.triangles;
    }

private:
    Subject(const vdtree::VertexTree& tree, Orbit orbit, vdtree::DistanceCriterion criterion)
        : tree_(tree), orbit_(std::move(orbit)), criterion_(std::move(criterion)) {}

    const vdtree::VertexTree& tree_;
    Orbit orbit_;
    vdtree::DistanceCriterion criterion_;
    float threshold_ = 1;
};

struct OrbitFigures {
    double median_us = 0, us_of_99 = 0, changes = 0, tests = 0, triangles = 0, writes = 0;
};

// The cut and its index buffer, as a renderer would ask for them.
OrbitFigures measure_orbit(const Subject& subject, double step, int frames) {
    vdtree::Cut cut(subject.tree());
    constexpr int warm_up = 5; // the cut is made, and patching begins
    std::vector<double> microseconds, changes, tests, triangles, writes;
    for (int frame = 0; frame < frames + warm_up; ++frame) {
        const vdtree::Viewpoint viewpoint = subject.orbit().at(frame * step);
        const auto start = Clock::now();
        const auto stats = subject.follow(cut, viewpoint, subject.threshold());
        static_cast<void>(cut.indices());
        const double seconds = seconds_since(start);
        if (frame < warm_up) continue;
        microseconds.push_back(seconds * 1e6);
        changes.push_back(static_cast<double>(stats.folds + stats.unfolds));
        tests.push_back(static_cast<double>(stats.node_tests));
        triangles.push_back(stats.triangles);
        const auto written = cut.index_writes();
        writes.push_back(written ? static_cast<double>(written->size()) : static_cast<double>(cut.indices().size()));
    }
    return {median(microseconds), share_below(microseconds, 0.99), median(changes), median(tests), median(triangles),
            median(writes)};
}

Json to_json(const OrbitFigures& f) {
    return {{"median_us", f.median_us}, {"us_of_99_percent", f.us_of_99}, {"changes", f.changes},
            {"node_tests", f.tests},    {"triangles", f.triangles},       {"index_writes", f.writes}};
}

double still_us(const Subject& subject, int batches) {
    vdtree::Cut cut(subject.tree());
    const vdtree::Viewpoint viewpoint = subject.orbit().at(0);
    constexpr int batch = 1000; // the clock itself takes tens of nanoseconds
    std::vector<double> microseconds;
    for (int i = 0; i < batches; ++i) {
        const auto start = Clock::now();
        for (int j = 0; j < batch; ++j) {
            subject.follow(cut, viewpoint, subject.threshold());
            static_cast<void>(cut.indices());
        }
        microseconds.push_back(seconds_since(start) / batch * 1e6);
    }
    return median(microseconds);
}

// To the other side of the model, with its index buffer.
double teleport_ms(const Subject& subject, int jumps) {
    vdtree::Cut cut(subject.tree());
    std::vector<double> milliseconds;
    for (int jump = 0; jump <= jumps; ++jump) {
        const vdtree::Viewpoint viewpoint = subject.orbit().at(jump * 180 + jump % 3);
        const auto start = Clock::now();
        subject.follow(cut, viewpoint, subject.threshold());
        static_cast<void>(cut.indices());
        if (jump > 0) milliseconds.push_back(seconds_since(start) * 1e3);
    }
    return median(milliseconds);
}

struct Budget {
    double cold_ms = 0, frame_ms = 0;
    double flicker_percent = 0; // changes that are undone within `flicker_frames`
};

constexpr int flicker_frames = 10;
constexpr float usual_hysteresis = 1.1f;

// A change counts as flicker where the node changed the other way no more than so many frames before.
class FlickerMeter {
public:
    void count(const vdtree::Cut& cut, int frame) {
        for (const vdtree::FoldChange& change : cut.changes()) {
            const auto [last, is_new] = last_change_.try_emplace(change.node, frame);
            if (!is_new && frame - last->second <= flicker_frames) ++undone_;
            last->second = frame;
            ++changes_;
        }
    }
    double percent() const {
        return changes_ > 0 ? 100.0 * static_cast<double>(undone_) / static_cast<double>(changes_) : 0;
    }

private:
    std::unordered_map<vdtree::NodeId, int> last_change_;
    std::uint64_t changes_ = 0, undone_ = 0;
};

Budget measure_budget(const Subject& subject, double step, float hysteresis, int frames) {
    vdtree::FollowOptions options;
    options.triangle_budget = budget_triangles;
    options.hysteresis = hysteresis;
    vdtree::Cut cut(subject.tree());
    constexpr int warm_up = 5;
    Budget budget;
    FlickerMeter flicker;
    std::vector<double> milliseconds;
    for (int frame = 0; frame < frames + warm_up; ++frame) {
        const vdtree::Viewpoint viewpoint = subject.orbit().at(frame * step);
        const auto start = Clock::now();
        subject.follow(cut, viewpoint, options);
        static_cast<void>(cut.indices());
        const double ms = seconds_since(start) * 1e3;
        if (frame == 0) budget.cold_ms = ms;
        if (frame < warm_up) continue;
        milliseconds.push_back(ms);
        flicker.count(cut, frame);
    }
    budget.frame_ms = median(milliseconds);
    budget.flicker_percent = flicker.percent();
    return budget;
}

struct Memory {
    double without_lists = 0, with_lists = 0, with_lists_of_all = 0; // bytes a triangle
};

Memory measure_memory(const Subject& subject) {
    const auto triangles = static_cast<double>(subject.tree().triangle_count());
    const auto bytes_with = [&](const vdtree::Cut& cut) {
        return static_cast<double>(subject.tree().byte_size() + cut.byte_size()) / triangles;
    };
    Memory memory;
    vdtree::Cut cut(subject.tree());
    subject.follow(cut, 0);
    static_cast<void>(cut.indices());
    memory.without_lists = bytes_with(cut);
    const auto patched = [&](vdtree::Cut& patching, float threshold) {
        for (int frame = 1; frame < 6; ++frame) {
            subject.follow(patching, subject.orbit().at(frame * 0.1), threshold);
            static_cast<void>(patching.indices());
        }
        return bytes_with(patching);
    };
    memory.with_lists = patched(cut, subject.threshold());
    vdtree::Cut whole(subject.tree());
    memory.with_lists_of_all = patched(whole, std::numeric_limits<float>::min());
    return memory;
}

// ---- the table

class Bench {
public:
    Bench(const EngineBenchOptions& options, Workshop shop, NamedMesh base)
        : options_(options), shop_(std::move(shop)), base_(std::move(base)) {}

    Result<EngineBenchResult> run() {
        result_.mesh = base_.name + ", " + grouped(base_.mesh.triangles.size()) + " triangles";
        for (const std::uint64_t size : options_.sizes) {
            Json json;
            const auto tree = tree_of_size(shop_, base_, size, json);
            if (!tree) return tree.error();
            if (auto measured = measure_cuts(size, *tree, json); !measured) return measured.error();
            result_.sizes.push_back(std::move(json));
        }
        add_growth();
        rows(at_main_);
        if (auto built = measure_building(); !built) return built.error();
        rows(building_);
        return std::move(result_);
    }

private:
    using Rows = std::vector<BenchRow>;

    Target target(std::string_view figure) const { return options_.targets.of("engine", figure); }

    void rows(Rows& more) { result_.rows.insert(result_.rows.end(), more.begin(), more.end()); }

    // The size that the table is about: the mesh itself, or the nearest that is measured.
    std::uint64_t main_size() const {
        const auto have = static_cast<double>(base_.mesh.triangles.size());
        return *std::min_element(options_.sizes.begin(), options_.sizes.end(), [&](auto a, auto b) {
            return std::abs(std::log(static_cast<double>(a) / have)) <
                   std::abs(std::log(static_cast<double>(b) / have));
        });
    }
    std::uint64_t teleport_size() const { // the largest up to 14 M
        std::uint64_t best = main_size();
        for (const std::uint64_t size : options_.sizes)
            if (size <= 15'000'000) best = std::max(best, size);
        return best;
    }

    Result<void> measure_cuts(std::uint64_t size, const vdtree::VertexTree& tree, Json& json) {
        print_note("measuring cuts at " + size_name(size) + " triangles ...");
        const Pinned pinned;
        auto subject = Subject::create(tree, {});
        if (!subject) return subject.error();
        // The same at all sizes that have it.
        const auto smaller =
            static_cast<double>(std::min<std::size_t>(tree.triangle_count(), base_.mesh.triangles.size()));
        const vdtree::Index active =
            subject->aim_for(std::min(wanted_active, static_cast<vdtree::Index>(most_of_mesh * smaller)));
        const int frames = options_.quick ? 40 : 400, jumps = options_.quick ? 6 : 40;
        json["size"] = size;
        json["triangles"] = tree.triangle_count();
        json["active"] = active;
        json["threshold"] = static_cast<double>(subject->threshold());
        json["bytes_a_triangle"] = static_cast<double>(tree.byte_size()) / tree.triangle_count();
        std::vector<OrbitFigures> orbits;
        for (const double step : orbit_steps) {
            orbits.push_back(measure_orbit(*subject, step, frames));
            json["orbit_" + shortest(step) + "_degrees"] = to_json(orbits.back());
        }
        const double jump_ms = teleport_ms(*subject, jumps);
        json["teleport_ms"] = jump_ms;
        if (size == main_size()) return measure_main(*subject, active, orbits, jump_ms);
        if (size == teleport_size())
            far_teleport_ = {"teleport, " + size_name(size),       "ms",  "", jump_ms,
                             target("teleport, largest mesh, ms"), false, 2};
        return {};
    }

    Result<void> measure_main(const Subject& subject, vdtree::Index active, const std::vector<OrbitFigures>& orbits,
                              double jump_ms) {
        const std::string how = grouped(active) + " active triangles, perceptual test with silhouettes, no gaze, " +
                                rounded(fill * 100, 2) + "% of the window's height; folds cost up to " +
                                rounded(static_cast<double>(subject.threshold()), 4) + " so that so many are left";
        for (std::size_t i = 0; i < orbits.size(); ++i)
            at_main_.push_back({"cut + index buffer, " + shortest(orbit_steps[i]) + " degrees a frame", "us",
                                how + "; " + rounded(orbits[i].changes, 4) + " changes and " +
                                    rounded(orbits[i].tests, 4) + " tests a frame",
                                orbits[i].median_us,
                                target("cut and index buffer, " + shortest(orbit_steps[i]) + " degrees a frame, us"),
                                false, 1});
        if (auto gazing = measure_gaze(subject.tree()); !gazing) return gazing;
        if (auto compared = measure_frusta(subject.tree(), active); !compared) return compared;
        growth_place_ = at_main_.size();
        at_main_.push_back(
            {"still view", "us", "", still_us(subject, options_.quick ? 20 : 200), target("still view, us"), false, 3});
        at_main_.push_back({"teleport, " + size_name(main_size()), "ms", "to the other side", jump_ms,
                            target("teleport, ms"), false, 2});
        teleport_place_ = at_main_.size();
        measure_budgets(subject);
        at_main_.push_back({"full perceptual tests", "M/s", "from scratch, every node of the tree, in order",
                            subject.full_tests_per_second(options_.quick ? 10 : 60) / 1e6, target("full tests, M/s"),
                            true, 1});
        const Memory memory = measure_memory(subject);
        at_main_.push_back({"resident bytes a triangle, without patch lists", "B", "tree, cut and index buffer",
                            memory.without_lists, target("resident bytes a triangle, without patch lists"), false, 1});
        at_main_.push_back({"with patch lists", "B", how, memory.with_lists,
                            target("resident bytes a triangle, with patch lists"), false, 1});
        at_main_.push_back(
            {"with patch lists, all triangles active", "B", "nothing folds", memory.with_lists_of_all, {}, false, 1});
        return {};
    }

    void measure_budgets(const Subject& subject) {
        const int frames = options_.quick ? 10 : 100, cold_starts = options_.quick ? 1 : 5;
        const std::string so_many = "budget of " + grouped(budget_triangles) + " triangles, ";
        std::vector<double> cold_ms;
        for (int i = 0; i < cold_starts; ++i) cold_ms.push_back(measure_budget(subject, 1, 1, 0).cold_ms);
        const Budget stable = measure_budget(subject, 1, usual_hysteresis, frames),
                     best = measure_budget(subject, 1, 1, frames);
        const Budget slow = measure_budget(subject, 0.1, usual_hysteresis, 2 * frames);
        at_main_.push_back({so_many + "cold", "ms", "a new cut, with its index buffer", median(cold_ms),
                            target("budget, cold, ms"), false, 2});
        at_main_.push_back(
            {so_many + "1 degree a frame", "ms",
             "within " + rounded(static_cast<double>(usual_hysteresis), 2) + " times the best largest cost",
             stable.frame_ms, target("budget, 1 degree a frame, ms"), false, 3});
        at_main_.push_back(
            {so_many + "1 degree a frame, the best always", "ms", "hysteresis 1", best.frame_ms, {}, false, 3});
        at_main_.push_back({so_many + "flicker at 0.1 degrees a frame",
                            "%",
                            "changes undone within " + std::to_string(flicker_frames) + " frames",
                            slow.flicker_percent,
                            {},
                            false,
                            2});
    }

    Result<void> measure_gaze(const vdtree::VertexTree& tree) {
        const auto subject = Subject::create(tree, {.with_gaze = true});
        if (!subject) return subject.error();
        const OrbitFigures f = measure_orbit(*subject, 1, options_.quick ? 20 : 200);
        at_main_.push_back(
            {"the same, gaze " + shortest(session::usual_degrees_aside) + " degrees aside, 1 degree a frame",
             "us",
             rounded(f.triangles, 6) + " active triangles, threshold 1",
             f.median_us,
             {},
             false,
             1});
        return {};
    }

    // What users run: both fold tests, with the window's frustum and without.
    Result<void> measure_frusta(const vdtree::VertexTree& plain, vdtree::Index active) {
        const auto measured = with_errors(shop_, base_, plain);
        if (!measured) return measured.error();
        const int frames = options_.quick ? 40 : 400;
        for (const FoldTest test : {FoldTest::luebke_hallen, FoldTest::error}) {
            const std::string of = "fold test " + name_of(test) + ", 1 degree a frame";
            double tests[2] = {};
            for (const bool with_frustum : {false, true}) {
                auto subject = Subject::create(test == FoldTest::error ? *measured : plain,
                                               {.test = test, .with_frustum = with_frustum});
                if (!subject) return subject.error();
                const vdtree::Index triangles = subject->aim_for(active);
                const OrbitFigures f = measure_orbit(*subject, 1, frames);
                const std::string name = of + (with_frustum ? ", with the frustum" : ", without frustum");
                const std::string note = grouped(triangles) + " active triangles, all in the window; " +
                                         rounded(f.changes, 4) + " changes a frame";
                at_main_.push_back({name, "us", note, f.median_us, {}, false, 1});
                at_main_.push_back({name, "tests", "", f.tests, {}, false, 0});
                tests[with_frustum] = f.tests;
            }
            BenchRow row{of + ", tests with the frustum over without",     "x",   "", {},
                         target("tests with the frustum over without, x"), false, 2};
            if (tests[0] > 0) row.value = tests[1] / tests[0];
            else row.note = "nothing was tested without a frustum";
            at_main_.push_back(row);
        }
        return {};
    }

    // From the mesh's size to the largest up to 14 M.
    void add_growth() {
        if (far_teleport_)
            at_main_.insert(at_main_.begin() + static_cast<std::ptrdiff_t>(teleport_place_), *far_teleport_);
        const Json *main = nullptr, *far = nullptr;
        for (const Json& json : result_.sizes) {
            if (json["size"] == main_size()) main = &json;
            if (json["size"] == teleport_size()) far = &json;
        }
        BenchRow row{"growth from " + size_name(main_size()) + " to " + size_name(teleport_size()),
                     "x",
                     "",
                     {},
                     target("growth to the largest mesh, x"),
                     false,
                     2};
        if (main && far && main != far) {
            double most = 0;
            for (const double step : orbit_steps) {
                const std::string key = "orbit_" + shortest(step) + "_degrees";
                const double ratio = (*far)[key]["median_us"].get<double>() / (*main)[key]["median_us"].get<double>();
                row.note += (row.note.empty() ? "" : ", ") + rounded(ratio, 3) + " at " + shortest(step);
                most = std::max(most, ratio);
            }
            row.value = most;
            row.note += " degrees a frame; the largest counts";
        } else {
            row.note = "needs --sizes beyond the mesh's own";
        }
        at_main_.insert(at_main_.begin() + static_cast<std::ptrdiff_t>(growth_place_), row);
    }

    Result<void> measure_building() {
        const auto mesh = mesh_file(shop_, base_, main_size());
        if (!mesh) return mesh.error();
        const fs::path tree = shop_ / "measured.vdt";
        double largest_peak = 0;
        for (const std::string name : {"octree", "quadric"}) {
            const auto one = build(*mesh, tree, {"--clusterer", name, "--threads", "1"});
            if (!one) return one.error();
            const auto two = build(*mesh, tree, {"--clusterer", name, "--threads", "2"});
            if (!two) return two.error();
            building_.push_back({"build, " + name + ", one thread", "Mtri/s", "all data of the tree",
                                 one->triangles / one->seconds / 1e6, target("build by " + name + ", Mtri/s"), true,
                                 3});
            building_.push_back({"build, " + name + ", two threads over one", "x", "", one->seconds / two->seconds,
                                 target("build, two threads over one, x"), true, 2});
            largest_peak = std::max(largest_peak, one->peak_bytes / one->triangles);
        }
        building_.push_back({"peak bytes a triangle while building", "B",
                             "the whole process, from reading the mesh on; the larger of both", largest_peak,
                             target("build, peak bytes a triangle"), false, 0});
        measure_ranks(*mesh);
        return {};
    }

    void measure_ranks(const fs::path& mesh) {
        BenchRow row{"mpirun -np 2 over 1", "x", "", {}, target("build, two processes over one, x"), true, 2};
        double seconds[2] = {};
        for (int ranks = 1; ranks <= 2 && has_mpi && row.note.empty(); ++ranks) {
            const auto built =
                build(mesh, shop_ / "measured.vdt", {"--threads", "1"},
                      {"mpirun", "--allow-run-as-root", "--oversubscribe", "-np", std::to_string(ranks)});
            if (built) seconds[ranks - 1] = built->wall_seconds;
            else row.note = "Open MPI's mpirun did not do: " + built.error().message;
        }
        if (!has_mpi) row.note = "this build of the command is without MPI";
        if (row.note.empty()) row.value = seconds[0] / seconds[1];
        building_.push_back(row);
    }

    const EngineBenchOptions& options_;
    Workshop shop_;
    NamedMesh base_;
    EngineBenchResult result_;
    Rows at_main_, building_;
    std::optional<BenchRow> far_teleport_;
    std::size_t growth_place_ = 0, teleport_place_ = 0;
};

} // namespace

Result<EngineBenchResult> bench_engine(const EngineBenchOptions& options) {
    auto shop = Workshop::open(options.keep);
    if (!shop) return shop.error();
    auto base = base_mesh(options);
    if (!base) return base.error();
    return Bench(options, std::move(*shop), std::move(*base)).run();
}

} // namespace unseen::app
