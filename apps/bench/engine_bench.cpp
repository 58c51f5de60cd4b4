#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <numbers>
#include <unordered_map>

#include <scene_parts.h>
#include <subdivide.h>
#include <unseen/meshio/mesh_file.h>
#include <unseen/perception/criterion.h>
#include <unseen/perception/fold_measurement.h>
#include <unseen/vdtree/active_triangles.h>
#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/tree_io.h>

#include "bench_tools.h"
#include "benches.h"
#include "progress_bar.h"
#include "session_options.h"
#include "terminal.h"

namespace unseen::app {
namespace {

namespace fs = std::filesystem;

constexpr vdtree::Index wanted_active = 100'000; // triangles of the cuts that are measured
constexpr vdtree::Index budget_triangles = 100'000;
constexpr double most_of_mesh = 0.5;              // at small meshes: so much of them is active
constexpr double fill = 0.9;                      // of the window's height
constexpr std::array orbit_steps = {0.1, 1., 5.}; // degrees a frame

// "0.9 M", "70 k"
std::string size_name(std::uint64_t triangles) {
    return triangles < 500'000 ? rounded(static_cast<double>(triangles) / 1e3, 3) + " k"
                               : rounded(static_cast<double>(triangles) / 1e6, 2) + " M";
}

// ---- meshes and trees, in a folder

struct NamedMesh {
    vdtree::Mesh mesh;
    std::string name;
};

NamedMesh base_mesh(const EngineOptions& options) {
    const fs::path file = options.inputs.empty() ? find_in_checkout(dragon_file) : fs::path(options.inputs.front());
    if (file.empty()) {
        print_note("the dragon is not there ('./quickstart --dragon' fetches it): a sphere with bumps stands in.");
        constexpr int rows = 466; // 868,624 triangles, about as many as the dragon
        return {bumpy_sphere(rows), "sphere"};
    }
    return {require(read_mesh_file(file)).mesh, file.stem().string()};
}

vdtree::Mesh simplified(const vdtree::Mesh& mesh, std::uint64_t triangles) {
    vdtree::BuildOptions building;
    ProgressBar bar("simplifying");
    building.progress = std::ref(bar);
    const vdtree::VertexTree tree = require(vdtree::build_tree(mesh.view(), building));
    const vdtree::Sphere sphere = tree.bounding_sphere();
    vdtree::View view; // from so far that the extents alone count
    view.target = tree.origin() + glm::dvec3(sphere.centre);
    view.eye = view.target + glm::dvec3(0, 0, 100 * sphere.radius);
    vdtree::FollowOptions options;
    options.triangle_budget = static_cast<vdtree::Index>(triangles);
    vdtree::Cut cut(tree);
    require(cut.follow(require(vdtree::extent_criterion(tree, view, 1)), {.eye = vdtree::eye_in_tree(tree, view, {})},
                       options));
    return vdtree::extract_mesh(cut);
}

vdtree::Mesh mesh_of_size(const vdtree::Mesh& base, std::uint64_t triangles) {
    if (triangles < base.triangles.size()) return simplified(base, triangles);
    ProgressBar bar("subdividing");
    SubdivideOptions options;
    options.triangles = triangles;
    options.progress = std::ref(bar);
    return require(subdivide(base, options));
}

// The mesh of a size, as a file. The base itself is taken for sizes about its own: 0.9 M is the dragon.
fs::path mesh_file(const BenchFolder& shop, const NamedMesh& base, std::uint64_t triangles) {
    const double ratio = static_cast<double>(base.mesh.triangles.size()) / static_cast<double>(triangles);
    const bool is_base = ratio > 0.9 && ratio < 1.1;
    fs::path file =
        shop / (base.name + "-" + std::to_string(is_base ? base.mesh.triangles.size() : triangles) + ".ply");
    std::error_code unknown;
    if (!fs::exists(file, unknown))
        require(meshio::write_mesh(file, is_base ? base.mesh.view() : mesh_of_size(base.mesh, triangles).view()));
    return file;
}

struct Building {
    double seconds = 0; // of building alone, without reading and writing
    double wall_seconds = 0;
    double peak_bytes = 0; // of the whole process
    double triangles = 0;
};

Result<Building> build(const fs::path& mesh, const fs::path& tree, const std::vector<std::string>& more,
                       const std::vector<std::string>& launcher = {}) {
    std::vector<std::string> words = {"build", mesh.string(), "-o", tree.string(), "--no-fold-errors", "--json", "-"};
    words.insert(words.end(), more.begin(), more.end());
    print_note("building " + tree.filename().string() + " ...");
    const auto outcome = run_unseen(words, launcher);
    if (!outcome) return outcome.error();
    const Json report = Json::parse(outcome->out, nullptr, false);
    if (outcome->status != 0 || !report.is_object())
        return Error{ErrorCode::io_failure, "'unseen build' of '" + mesh.string() + "' failed; its message is above."};
    return Building{report.value("build_seconds", 0.0), outcome->seconds, report.value("peak_bytes", 0.0),
                    report.value("triangles", 0.0)};
}

// A tree that is kept, or is made now.
template <class Make>
vdtree::VertexTree kept_tree(const fs::path& file, Make&& make) {
    std::error_code unknown;
    if (fs::exists(file, unknown))
        if (auto kept = load_tree(file); kept) return std::move(*kept);
    return make();
}

vdtree::VertexTree tree_of_size(const BenchFolder& shop, const NamedMesh& base, std::uint64_t triangles, Json& json) {
    const fs::path mesh = mesh_file(shop, base, triangles), file = fs::path(mesh).replace_extension(".vdt");
    return kept_tree(file, [&] {
        const Building built = require(build(mesh, file, {"--threads", "1"}));
        json["build_seconds"] = built.seconds;
        json["build_peak_bytes_a_triangle"] = built.peak_bytes / built.triangles;
        return require(load_tree(file));
    });
}

// The same tree with the errors of its folds, for the fold test `error`.
vdtree::VertexTree with_errors(const BenchFolder& shop, const NamedMesh& base, const vdtree::VertexTree& tree) {
    const fs::path file = shop / (base.name + "-" + std::to_string(tree.triangle_count()) + "-fold-errors.vdt");
    return kept_tree(file, [&] {
        print_note("measuring fold errors ...");
        auto measured = require(perception::measure_folds(tree));
        require(vdtree::write_tree(file, measured));
        return measured;
    });
}

// ---- cuts

// A model in the window of the default display, whose eye goes around the vertical axis. A gaze goes with it.
class Subject {
public:
    explicit Subject(const vdtree::VertexTree& tree, FoldTest test = FoldTest::error, bool with_gaze = false)
        : tree(tree) {
        window_.fov_y_degrees = perception::physical_field(options_.display, window_.height).value();
        const vdtree::LuminanceRange range = tree.luminance_range();
        const auto background =
            static_cast<float>(perception::to_relative(options_.display, perception::Luminance(20)));
        options_.scene = {std::min(range.lo, background), std::max(range.hi, background)};
        if (with_gaze) options_.gaze_px = session::gaze_aside(options_.display, window_, session::usual_degrees_aside);
        criterion_ = require(test == FoldTest::error ? perception::error_distances(tree, view(0), options_)
                                                     : perception::luebke_hallen_distances(tree, view(0), options_));
    }

    // All of the model is in the window, but a frustum has to find that out.
    vdtree::Viewpoint at(double degrees) const { return perception::viewpoint_of(tree, view(degrees), options_); }
    // The cut and its index buffer, as a renderer would ask for them.
    vdtree::AdjustStats follow(vdtree::Cut& cut, const vdtree::Viewpoint& viewpoint,
                               const vdtree::FollowOptions& options) const {
        const vdtree::AdjustStats stats = require(cut.follow(*criterion_, viewpoint, options));
        static_cast<void>(cut.indices());
        return stats;
    }
    vdtree::AdjustStats follow(vdtree::Cut& cut, const vdtree::Viewpoint& viewpoint) const {
        return follow(cut, viewpoint, with_threshold(threshold));
    }
    vdtree::AdjustStats follow_only(vdtree::Cut& cut, const vdtree::Viewpoint& viewpoint) const {
        return require(cut.follow(*criterion_, viewpoint, with_threshold(threshold)));
    }
    static vdtree::FollowOptions with_threshold(float threshold) {
        vdtree::FollowOptions options;
        options.threshold = threshold;
        return options;
    }
    // One by one, nodes a second.
    double full_tests_per_second(int repeats) const {
        const vdtree::Viewpoint viewpoint = at(0);
        return static_cast<double>(tree.interior_count()) / median_seconds(repeats, [&] {
                   require(vdtree::test_every_node(tree, *criterion_, viewpoint, with_threshold(threshold)));
               });
    }
    // Chooses the threshold at which about so many triangles are active; returns how many are.
    vdtree::Index aim_for(vdtree::Index triangles) {
        constexpr double close_enough = 0.002; // of the triangles asked for
        constexpr int steps = 24;
        double low = -20, high = 20; // log2
        vdtree::Cut cut(tree);
        vdtree::Index active = 0;
        for (int step = 0; step < steps; ++step) {
            const double middle = (low + high) / 2;
            threshold = static_cast<float>(std::exp2(middle));
            active = require(cut.follow(*criterion_, at(0), with_threshold(threshold))).triangles;
            if (std::abs(static_cast<double>(active) - triangles) <= close_enough * triangles) break;
            (active > triangles ? low : high) = middle;
        }
        return active;
    }

    const vdtree::VertexTree& tree;
    float threshold = 1;

private:
    vdtree::View view(double degrees) const {
        const double angle = degrees * std::numbers::pi / 180;
        const vdtree::Sphere sphere = tree.bounding_sphere();
        return vdtree::frame_sphere(tree.origin() + glm::dvec3(sphere.centre), sphere.radius,
                                    {std::sin(angle), 0, std::cos(angle)}, fill, window_);
    }

    perception::FoldTestOptions options_;
    vdtree::View window_;
    std::optional<vdtree::DistanceCriterion> criterion_;
};

// The speed of this machine just now, which others may share: reads at random from 64 MB, each of which waits for the one
// before.
double machine_ms() {
    constexpr std::size_t words = std::size_t{1} << 24;
    static const std::vector<std::uint32_t> memory = [] {
        std::vector<std::uint32_t> values(words);
        std::mt19937 random(1);
        for (std::uint32_t& value : values) value = static_cast<std::uint32_t>(random());
        return values;
    }();
    return 1e3 * median_seconds(3, [] {
               std::uint32_t at = 1;
               for (int i = 0; i < 20'000; ++i) at = memory[at % words] ^ (at * 2654435761u);
               [[maybe_unused]] static volatile std::uint32_t kept;
               kept = at;
           });
}

// What is made of a cut for drawing it.
enum class Form {
    gpu,         // what the renderer asks for in frames that follow each other
    index_buffer // for others
};

struct OrbitFigures {
    double median_us = 0, us_of_99 = 0, changes = 0, tests = 0, triangles = 0, gpu_writes = 0; // of 16 bytes
};

OrbitFigures measure_orbit(const Subject& subject, double step, int frames, Form form = Form::gpu) {
    vdtree::Cut cut(subject.tree);
    vdtree::ActiveTriangles active(subject.tree);
    constexpr int warm_up = 5; // the cut is made, and patching begins
    std::vector<double> microseconds, changes, tests, triangles, writes;
    for (int frame = 0; frame < frames + warm_up; ++frame) {
        const vdtree::Viewpoint viewpoint = subject.at(frame * step);
        vdtree::AdjustStats stats;
        bool is_known = true;
        const double seconds = seconds_of([&] {
            if (form == Form::index_buffer) {
                stats = subject.follow(cut, viewpoint);
                return;
            }
            stats = subject.follow_only(cut, viewpoint);
            is_known = active.update(cut);
        });
        if (frame < warm_up) continue;
        microseconds.push_back(seconds * 1e6);
        changes.push_back(static_cast<double>(stats.folds + stats.unfolds));
        tests.push_back(static_cast<double>(stats.node_tests));
        triangles.push_back(stats.triangles);
        writes.push_back(static_cast<double>(is_known ? active.changed_slots().size() + active.changed_runs().size()
                                                      : active.leaves_at_corners().size()));
    }
    return {median(microseconds), quantile(microseconds, 0.99), median(changes), median(tests), median(triangles),
            median(writes)};
}

Json to_json(const OrbitFigures& f) {
    return {{"median_us", f.median_us}, {"us_of_99_percent", f.us_of_99}, {"changes", f.changes},
            {"node_tests", f.tests},    {"triangles", f.triangles},       {"gpu_writes", f.gpu_writes}};
}

double still_us(const Subject& subject, int batches) {
    vdtree::Cut cut(subject.tree);
    const vdtree::Viewpoint viewpoint = subject.at(0);
    constexpr int batch = 1000; // the clock itself takes tens of nanoseconds
    return 1e6 / batch * median_seconds(batches, [&] {
               for (int j = 0; j < batch; ++j) subject.follow(cut, viewpoint);
           });
}

// To the other side of the model.
double teleport_ms(const Subject& subject, int jumps) {
    vdtree::Cut cut(subject.tree);
    std::vector<double> milliseconds;
    for (int jump = 0; jump <= jumps; ++jump) {
        const vdtree::Viewpoint viewpoint = subject.at(jump * 180 + jump % 3);
        const double seconds = seconds_of([&] { subject.follow(cut, viewpoint); });
        if (jump > 0) milliseconds.push_back(seconds * 1e3);
    }
    return median(milliseconds);
}

constexpr int flicker_frames = 10;
constexpr float usual_hysteresis = 1.1f;

struct Budget {
    double cold_ms = 0, frame_ms = 0;
    double flicker_percent = 0; // changes of nodes that changed the other way no more than flicker_frames before
};

Budget measure_budget(const Subject& subject, double step, float hysteresis, int frames) {
    vdtree::FollowOptions options;
    options.triangle_budget = budget_triangles;
    options.hysteresis = hysteresis;
    vdtree::Cut cut(subject.tree);
    constexpr int warm_up = 5;
    Budget budget;
    std::unordered_map<vdtree::NodeId, int> last_change;
    double changes = 0, undone = 0;
    std::vector<double> milliseconds;
    for (int frame = 0; frame < frames + warm_up; ++frame) {
        const vdtree::Viewpoint viewpoint = subject.at(frame * step);
        const double ms = 1e3 * seconds_of([&] { subject.follow(cut, viewpoint, options); });
        if (frame == 0) budget.cold_ms = ms;
        if (frame < warm_up) continue;
        milliseconds.push_back(ms);
        for (const vdtree::FoldChange& change : cut.changes()) {
            const auto [last, is_new] = last_change.try_emplace(change.node, frame);
            undone += !is_new && frame - last->second <= flicker_frames;
            last->second = frame;
            ++changes;
        }
    }
    budget.frame_ms = median(milliseconds);
    if (changes > 0) budget.flicker_percent = 100 * undone / changes;
    return budget;
}

// ---- the table

class Bench {
public:
    explicit Bench(const EngineOptions& options)
        : options_(options), shop_(options.keep), base_(base_mesh(options)), frames_(options.quick ? 40 : 400) {}

    BenchReport run() {
        // Other sizes first: what is said about the main one goes by them.
        std::vector<Json> sizes(options_.sizes.size());
        const std::size_t main = main_size(), far = far_size();
        for (std::size_t i = 0; i < sizes.size(); ++i)
            if (i != main) measure(i, sizes[i], nullptr);
        measure(main, sizes[main], far != main ? &sizes[far] : nullptr);
        measure_building();
        const std::string mesh = base_.name + ", " + grouped(base_.mesh.triangles.size()) + " triangles";
        return {{table_of(mesh, rows_)}, {{"mesh", mesh}, {"rows", to_json(rows_)}, {"sizes", sizes}}};
    }

private:
    void add(const std::string& name, const std::string& unit, std::optional<double> value, int decimals,
             std::optional<double> target, const std::string& note = {}) {
        rows_.push_back({name, unit, value, decimals, target, note, machine_ms()});
    }

    // The size that the table is about: the mesh itself, or the nearest that is measured.
    std::size_t main_size() const {
        const auto have = static_cast<double>(base_.mesh.triangles.size());
        const auto off = [&](std::uint64_t size) { return std::abs(std::log(static_cast<double>(size) / have)); };
        return static_cast<std::size_t>(std::ranges::min_element(options_.sizes, {}, off) - options_.sizes.begin());
    }
    std::size_t far_size() const { // the largest up to 14 M
        std::size_t best = main_size();
        for (std::size_t i = best; i < options_.sizes.size(); ++i)
            if (options_.sizes[i] <= 15'000'000) best = i;
        return best;
    }
    std::string name_of_size(std::size_t i) const { return size_name(options_.sizes[i]); }

    // `far`: figures of a larger size, for the rows of the main one.
    void measure(std::size_t index, Json& json, const Json* far) {
        const std::uint64_t size = options_.sizes[index];
        const vdtree::VertexTree tree = tree_of_size(shop_, base_, size, json);
        print_note("measuring cuts at " + size_name(size) + " triangles ...");
        const Pinned pinned;
        Subject subject(tree, FoldTest::luebke_hallen);
        // The same at all sizes that have it.
        const auto smaller =
            static_cast<double>(std::min<std::size_t>(tree.triangle_count(), base_.mesh.triangles.size()));
        const vdtree::Index active =
            subject.aim_for(std::min(wanted_active, static_cast<vdtree::Index>(most_of_mesh * smaller)));
        json["size"] = size;
        json["triangles"] = tree.triangle_count();
        json["active"] = active;
        json["threshold"] = static_cast<double>(subject.threshold);
        json["bytes_a_triangle"] = static_cast<double>(tree.byte_size()) / tree.triangle_count();
        std::vector<OrbitFigures> orbits;
        for (const double step : orbit_steps) {
            orbits.push_back(measure_orbit(subject, step, frames_));
            json["orbit_" + shortest(step) + "_degrees"] = to_json(orbits.back());
        }
        json["teleport_ms"] = teleport_ms(subject, options_.quick ? 6 : 40);
        if (index == main_size()) add_main_rows(subject, active, orbits, json, far);
    }

    void add_main_rows(const Subject& subject, vdtree::Index active, const std::vector<OrbitFigures>& orbits,
                       const Json& json, const Json* far) {
        const vdtree::VertexTree measured = with_errors(shop_, base_, subject.tree);
        Subject users(measured), gazing(measured, FoldTest::error, true);
        users.aim_for(active);
        gazing.aim_for(active);
        add_orbits(users, gazing);
        for (std::size_t i = 0; i < orbits.size(); ++i)
            add_orbit("luebke-hallen, ", subject, orbits[i], orbit_steps[i], std::array{44, 345, 1200}[i]);
        add_growth(orbits, far);
        add("still view", "us", still_us(users, options_.quick ? 20 : 200), 3, 1);
        add_jumps(users, gazing, json, far);
        add_budgets(users);
        add("full perceptual tests", "M/s", users.full_tests_per_second(options_.quick ? 10 : 60) / 1e6, 1, 60,
            "from scratch, every node of the tree, in order");
        add_memory(subject); // without what is measured of folds
    }

    // What users run: the default fold test, what is imperceptible and so many triangles, without a gaze and with one.
    void add_orbits(const Subject& users, const Subject& gazing) {
        const Subject imperceptible(users.tree), gazing_imperceptible(users.tree, FoldTest::error, true);
        const std::string aside = "gaze " + shortest(session::usual_degrees_aside) + " degrees aside, ";
        const auto add_all = [&](const std::string& name, const Subject& of, std::array<double, 3> targets) {
            std::array<double, 3> twice{};
            for (std::size_t i = 0; i < orbit_steps.size(); ++i) {
                const OrbitFigures f = measure_orbit(of, orbit_steps[i], frames_);
                add_orbit(name, of, f, orbit_steps[i], targets[i]);
                twice[i] = 2 * f.median_us;
            }
            return twice;
        };
        add_all(aside, gazing, add_all("", users, {10, 40, 150}));
        for (const double step : orbit_steps)
            add_orbit("with an index buffer, ", users, measure_orbit(users, step, frames_, Form::index_buffer), step,
                      {});
        add_all("imperceptible, " + aside, gazing_imperceptible,
                add_all("imperceptible, ", imperceptible, {50, 300, 1200}));
    }

    void add_orbit(const std::string& name, const Subject& of, const OrbitFigures& f, double step,
                   std::optional<double> target) {
        add(name + shortest(step) + " degrees a frame", "us", f.median_us, 1, target,
            rounded(f.triangles, 6) + " active triangles, folds cost up to " +
                rounded(static_cast<double>(of.threshold), 4) + "; " + rounded(f.changes, 4) + " changes, " +
                rounded(f.tests, 4) + " tests" +
                (f.gpu_writes > 0 ? " and " + rounded(f.gpu_writes, 4) + " writes for the GPU" : "") + " a frame");
    }

    void add_jumps(const Subject& users, const Subject& gazing, const Json& json, const Json* far) {
        const int jumps = options_.quick ? 6 : 40;
        add("jump, " + name_of_size(main_size()), "ms", teleport_ms(users, jumps), 2, 2, "to the other side");
        if (far)
            add("jump, " + name_of_size(far_size()), "ms", (*far)["teleport_ms"].get<double>(), 2, 5,
                "luebke-hallen; " + rounded(json["teleport_ms"].get<double>(), 3) + " ms at " +
                    name_of_size(main_size()));
        add("jump with a gaze, " + name_of_size(main_size()), "ms", teleport_ms(gazing, jumps), 2, 5,
            "to the other side, and the gaze with it");
    }

    // From the mesh's size to the largest up to 14 M.
    void add_growth(const std::vector<OrbitFigures>& orbits, const Json* far) {
        std::optional<double> most;
        std::string note;
        for (std::size_t i = 0; i < orbits.size() && far; ++i) {
            const std::string step = shortest(orbit_steps[i]);
            const double ratio = (*far)["orbit_" + step + "_degrees"]["median_us"].get<double>() / orbits[i].median_us;
            note += (note.empty() ? "" : ", ") + rounded(ratio, 3) + " at " + step;
            most = std::max(most.value_or(0), ratio);
        }
        add("growth from " + name_of_size(main_size()) + " to " + name_of_size(far_size()), "x", most, 2, 1.5,
            far ? note + " degrees a frame; the largest counts" : "needs --sizes beyond the mesh's own");
    }

    void add_budgets(const Subject& subject) {
        const int frames = options_.quick ? 10 : 100;
        const std::string so_many = "budget of " + grouped(budget_triangles) + " triangles, ";
        std::vector<double> cold_ms;
        for (int i = 0; i < (options_.quick ? 1 : 5); ++i) cold_ms.push_back(measure_budget(subject, 1, 1, 0).cold_ms);
        add(so_many + "cold", "ms", median(cold_ms), 2, 3, "a new cut, with its index buffer");
        add(so_many + "1 degree a frame", "ms", measure_budget(subject, 1, usual_hysteresis, frames).frame_ms, 3, 0.5,
            "within " + rounded(static_cast<double>(usual_hysteresis), 2) + " times the best largest cost");
        add(so_many + "1 degree a frame, the best always", "ms", measure_budget(subject, 1, 1, frames).frame_ms, 3, {},
            "hysteresis 1");
        add(so_many + "flicker at 0.1 degrees a frame", "%",
            measure_budget(subject, 0.1, usual_hysteresis, 2 * frames).flicker_percent, 2, {},
            "changes undone within " + std::to_string(flicker_frames) + " frames");
    }

    void add_memory(const Subject& subject) {
        const auto bytes = [&](const vdtree::Cut& cut) {
            return static_cast<double>(subject.tree.byte_size() + cut.byte_size()) / subject.tree.triangle_count();
        };
        const auto patched = [&](vdtree::Cut& cut, float threshold) {
            for (int frame = 1; frame < 6; ++frame)
                subject.follow(cut, subject.at(frame * 0.1), Subject::with_threshold(threshold));
            return bytes(cut);
        };
        vdtree::Cut cut(subject.tree), whole(subject.tree);
        subject.follow(cut, subject.at(0));
        add("resident bytes a triangle, without patch lists", "B", bytes(cut), 1, 100, "tree, cut and index buffer");
        add("with patch lists", "B", patched(cut, subject.threshold), 1, 140);
        add("with patch lists, all triangles active", "B", patched(whole, std::numeric_limits<float>::min()), 1, {},
            "nothing folds");
    }

    void measure_building() {
        const fs::path mesh = mesh_file(shop_, base_, options_.sizes[main_size()]), tree = shop_ / "measured.vdt";
        double largest_peak = 0;
        for (const auto& [name, target] : {std::pair<std::string, double>{"octree", 2}, {"quadric", 0.4}}) {
            const Building one = require(build(mesh, tree, {"--clusterer", name, "--threads", "1"})),
                           two = require(build(mesh, tree, {"--clusterer", name, "--threads", "2"}));
            add("build, " + name + ", one thread", "Mtri/s", one.triangles / one.seconds / 1e6, 3, target,
                "all data of the tree");
            add("build, " + name + ", two threads over one", "x", one.seconds / two.seconds, 2, 1.7);
            largest_peak = std::max(largest_peak, one.peak_bytes / one.triangles);
        }
        add("peak bytes a triangle while building", "B", largest_peak, 0, 300,
            "the whole process, from reading the mesh on; the larger of both");
        double seconds[2] = {};
        std::string note = UNSEEN_HAS_MPI ? "" : "this build of the command is without MPI";
        for (int ranks = 1; ranks <= 2 && note.empty(); ++ranks) {
            const auto built =
                build(mesh, tree, {"--threads", "1"},
                      {"mpirun", "--allow-run-as-root", "--oversubscribe", "-np", std::to_string(ranks)});
            if (built) seconds[ranks - 1] = built->wall_seconds;
            else note = "Open MPI's mpirun did not do: " + built.error().message;
        }
        add("mpirun -np 2 over 1", "x", note.empty() ? std::optional(seconds[0] / seconds[1]) : std::nullopt, 2, 1.6,
            note);
    }

    const EngineOptions& options_;
    BenchFolder shop_;
    NamedMesh base_;
    int frames_;
    std::vector<BenchRow> rows_;
};

} // namespace

BenchReport bench_engine(const EngineOptions& options) { return Bench(options).run(); }

} // namespace unseen::app
