// unseen build: a mesh becomes a vertex tree, once and for all.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <unseen/perception/fold_measurement.h>
#include <unseen/perception/internal/lit_folds.h>
#include <unseen/session/load.h>
#include <unseen/vdtree/internal/stopwatch.h>

#include "option_names.h"
#include "options.h"
#include "other_libraries.h"
#include "output_files.h"
#include "process_team.h"
#include "progress_bar.h"
#include "report.h"
#include "session_options.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

struct BuildArguments {
    TextureOptions& texture;
    std::string mesh = {}, out = {}, json = {};
    std::string clusterer_name = "quadric";
    meshio::ColourEncoding colours = meshio::ColourEncoding::srgb;
    int threads = 0;
    bool repairs = false;
    double gap = 1e-6, largest_hole = 0.1; // of repairs; shares of the mesh's and the part's diagonal
    bool no_fold_errors = false, lit_fold_errors = false, is_verbose = false;

    bool is_by_openmesh() const { return clusterer_name == "openmesh"; }
    vdtree::ClustererKind clusterer() const {
        return clusterer_name == "octree" ? vdtree::ClustererKind::octree : vdtree::ClustererKind::quadric;
    }
};

constexpr int most_threads = 1024;

Result<void> write(const std::string& file, const vdtree::VertexTree& tree) {
    ProgressBar bar("writing " + file);
    return vdtree::write_tree(file, tree, std::ref(bar));
}

// The most memory that this process has had resident, or nothing where the system does not tell.
Json peak_bytes() {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);)
        if (line.starts_with("VmHWM:")) return std::strtoull(line.c_str() + 6, nullptr, 10) * 1024; // it counts KiB
    return nullptr;
}

Json to_json(const vdtree::VertexTree& tree, double seconds, const Json& repair) {
    return {{"repair", repair},
            {"vertices", tree.leaf_count()},
            {"triangles", tree.triangle_count()},
            {"dropped", tree.dropped_triangles()},
            {"nodes", tree.node_count()},
            {"bytes", tree.byte_size()},
            {"build_seconds", number_or_null(seconds)},
            {"peak_bytes", peak_bytes()},
            {"fold_errors", perception::has_fold_measurement(tree)},
            {"lit_fold_errors", perception::has_lit_folds(tree)},
            {"texture", texture_json(tree)},
            {"creases", creases_json(tree.creases())},
            {"protected", protection_json(tree)}};
}

void print_details(const vdtree::VertexTree& tree) {
    const double bytes_per_triangle = static_cast<double>(tree.byte_size()) / tree.triangle_count();
    print_table({{"vertices", grouped(tree.leaf_count())},
                 {"triangles", grouped(tree.triangle_count())},
                 {"dropped", grouped(tree.dropped_triangles())},
                 {"nodes", grouped(tree.node_count())},
                 {"bytes", grouped(tree.byte_size())},
                 {"bytes a triangle", rounded(bytes_per_triangle, 4)},
                 {"texture", texture_text(tree)},
                 {"hard edges", creases_text(tree.creases())},
                 {"protected", protection_text(tree)}});
}

meshio::ReadOptions reading(const BuildArguments& a) {
    meshio::ReadOptions options;
    options.colours = a.colours;
    return options;
}

// Members of a team share the cores of their machine; the first one gets all of them when the others are done.
vdtree::BuildOptions building(const BuildArguments& a, ProcessTeam* team) {
    vdtree::BuildOptions options;
    options.clusterer = a.clusterer();
    options.threads = a.threads;
    options.prelit = a.texture.is_prelit;
    options.crease = a.texture.crease;
    options.border_weight = session::border_weight(a.texture.protect);
    if (team && team->size() > 1) {
        options.team = team;
        options.threads = a.threads > 0 ? a.threads : std::max(1, team->cores() / team->members_on_machine());
        options.threads_alone = a.threads == 0 ? team->cores() : a.threads * team->members_on_machine();
    }
    return options;
}

Result<void> check_names(const BuildArguments& a) {
    if (const auto ready = check_outputs({a.mesh, a.texture.file}, {a.out, a.json}); !ready) return ready;
    if (vdtree::is_tree_file(a.mesh))
        return Error{ErrorCode::invalid_argument, "'" + a.mesh + "' is a tree already; give a mesh."};
    return {};
}

// Without words.
Result<meshio::ReadResult> read_quietly(const std::filesystem::path& file, const meshio::ReadOptions& options,
                                        const TextureOptions& texture) {
    return session::read_textured_mesh(file,
                                       {.texture = texture.file,
                                        .without_textures = texture.is_left_out,
                                        .drop = texture.drop,
                                        .skip_bad = texture.skips_bad,
                                        .weld = !texture.is_unwelded,
                                        .protect = texture.protect},
                                       options);
}

// The mesh, if a tree can be built of it. `read_file` reads it, with or without printing. `repair` receives what was
// repaired.
template <class ReadFile>
Result<meshio::ReadResult> read_source(const BuildArguments& a, ReadFile&& read_file, Repaired& repair) {
    Result<meshio::ReadResult> read = read_file(a.mesh, reading(a), a.texture);
    if (!read) return read.error();
    if (a.repairs && !read->mesh.weights.empty())
        return Error{ErrorCode::invalid_argument,
                     "--repair makes other vertices than those that --protect names: repair the mesh first."};
    if (a.repairs) {
        auto repaired = repair_by_cgal(std::move(read->mesh), a.gap, a.largest_hole);
        if (!repaired) return Error{repaired.error().code, a.mesh + ": " + repaired.error().message};
        read->mesh = std::move(repaired->mesh);
        repair = std::move(*repaired);
    }
    if (const auto ok = vdtree::check_buildable(read->mesh.view()); !ok) return ok.error();
    return read;
}

// What there has to be before anything is built.
struct Source {
    JsonReport report;
    meshio::ReadResult read;
    Repaired repair; // without its mesh
};

Result<Source> open_source(const BuildArguments& a) {
    if (const auto ok = check_names(a); !ok) return ok.error();
    auto report = JsonReport::open(a.json);
    if (!report) return report.error();
    if (const auto ok = vdtree::prepare_tree_file(a.out); !ok) return ok.error();
    Repaired repair;
    auto read = read_source(a, read_textured_mesh, repair);
    if (!read) return read.error();
    return Source{std::move(*report), std::move(*read), std::move(repair)};
}

Result<vdtree::VertexTree> build(const BuildArguments& a, meshio::ReadResult&& read, ProcessTeam* team) {
    auto tree = build_tree_of(std::move(read), building(a, team), a.is_by_openmesh() ? build_by_openmesh : TreeMaker());
    if (team && tree) team->leave(); // else the others go when this one ends
    return tree;
}

Result<vdtree::VertexTree> measure(const BuildArguments& a, vdtree::VertexTree&& tree) {
    ProgressBar bar("measuring what folds change");
    return session::measured(tree, a.threads, std::ref(bar));
}

Result<vdtree::VertexTree> measure_under_lights(const BuildArguments& a, const vdtree::VertexTree& tree) {
    if (!perception::knows_lit_texture(tree))
        return Error{ErrorCode::unsupported,
                     a.mesh +
                         " has a texture over vertices of several hues, and what folds change of it under lights is "
                         "not measured: leave out --lit-fold-errors, or add --texture none."};
    ProgressBar bar("measuring what folds change under lights");
    return session::measured_under_lights(tree, a.threads, std::ref(bar));
}

// The first of a team, or the only one.
Result<int> lead(const BuildArguments& a, ProcessTeam* team) {
    auto source = open_source(a);
    if (team) {
        const Result<void> own = source ? Result<void>() : Result<void>(source.error());
        const auto ok = agree(*team, own, source ? fingerprint(source->read.mesh.view(), building(a, nullptr)) : 0);
        if (!ok) {
            print_error(ok.error().message); // before anybody leaves: mpirun ends all when the first one fails
            team->leave();
            return exit_failed;
        }
    }
    if (!source) return source.error();
    const auto start = vdtree::Clock::now();
    auto tree = build(a, std::move(source->read), team);
    if (!tree) return tree.error();
    if (const Message hint = session::hint_at_baked_light(*tree); !hint.empty())
        print_note(with_option_names(a.mesh + ": " + hint));
    if (!a.no_fold_errors) tree = measure(a, std::move(*tree));
    if (tree && a.lit_fold_errors) tree = measure_under_lights(a, *tree);
    if (!tree) return tree.error();
    const double seconds = vdtree::seconds_since(start);

    JsonReport& report = source->report;
    if (auto ok = report.prepare(to_json(*tree, seconds, source->repair.json)); !ok) return ok.error();
    if (auto ok = write(a.out, *tree); !ok) return ok.error();
    if (auto ok = report.publish(); !ok) return ok.error();
    if (report.is_on_stdout()) return exit_done;
    if (a.repairs) print_line(source->repair.sentence);
    const std::string dropped = tree->dropped_triangles() == 0 ? std::string()
                                                               : " (" + grouped(tree->dropped_triangles()) +
                                                                     " that use a vertex twice were dropped)";
    print_line("built a tree over " + grouped(tree->triangle_count()) + " triangles" + dropped + " in " +
               duration(1000 * seconds));
    print_written({a.out, a.json});
    if (a.is_verbose) print_details(*tree);
    return exit_done;
}

// The others: they write nothing, and print nothing unless they fail alone.
Result<int> help(const BuildArguments& a, ProcessTeam& team) {
    Repaired repair;
    const auto read = read_source(a, read_quietly, repair);
    const Result<void> own = read ? Result<void>() : Result<void>(read.error());
    const auto ok = agree(team, own, read ? fingerprint(read->mesh.view(), building(a, nullptr)) : 0);
    if (ok)
        if (const auto helped = vdtree::help_build_tree(read->mesh.view(), building(a, &team)); !helped)
            return helped.error();
    team.leave();
    return ok ? exit_done : exit_failed;
}

// A build gives large blocks back and asks for others all the time. What the process keeps, the system need not clear
// again.
void keep_freed_memory() {
#ifdef __GLIBC__
    ::mallopt(M_MMAP_MAX, 0);
    ::mallopt(M_TRIM_THRESHOLD, std::numeric_limits<int>::max());
#endif
}

Result<int> run(const BuildArguments& a) {
    if (a.is_by_openmesh() && !has_openmesh()) return build_by_openmesh({}, {}).error();
    if (a.repairs && !has_cgal()) return repair_by_cgal({}, a.gap, a.largest_hole).error();
    keep_freed_memory();
    const auto team = ProcessTeam::join();
    if (!team) return team.error();
    ProcessTeam* members = team->get();
    if (a.is_by_openmesh() && members && members->size() > 1) {
        const bool is_first = members->rank() == 0;
        members->leave();
        if (!is_first) return exit_failed;
        return Error{
            ErrorCode::invalid_argument,
            "Several processes help with --clusterer quadric only: start one, or leave out --clusterer openmesh."};
    }
    return members && members->rank() != 0 ? help(a, *members) : lead(a, members);
}

} // namespace

Command build_command(CLI::App& app, Setup& setup) {
    auto a = std::make_shared<BuildArguments>(BuildArguments{setup.view_options().texture});
    CLI::App* verb = app.add_subcommand("build", "Build the vertex tree of a mesh");
    verb->add_option("MESH", a->mesh, "PLY, OBJ, OFF, STL, glTF or VTP")->required()->type_name("FILE");
    add_value(*verb, "-o,--output", a->out, ending_in({".vdt"}), "TREE.vdt", "The tree")->required();
    add_choice<std::string, std::string>(*verb, "--clusterer", a->clusterer_name,
                                         {{"quadric", "quadric"}, {"octree", "octree"}, {"openmesh", "openmesh"}},
                                         "quadric (best; default), octree (fast), or openmesh (the decimater of that "
                                         "library; manifold surfaces only)");
    add_choice<meshio::ColourEncoding, meshio::ColourEncoding>(
        *verb, "--colours", a->colours,
        {{"srgb", meshio::ColourEncoding::srgb}, {"linear", meshio::ColourEncoding::linear}},
        "How the file's colours are encoded: srgb (default) or linear");
    CLI::Option* repairs = verb->add_flag("--repair", a->repairs,
                                          "Before building: give parts one orientation, close cracks, cap small holes");
    add_value(*verb, "--stitch", a->gap, CLI::Range(0.0, 0.01), "SHARE",
              "With --repair: borders up to so far apart are joined, a share of the mesh's diagonal (default: 1e-6)")
        ->needs(repairs);
    add_value(*verb, "--largest-hole", a->largest_hole, CLI::Range(0.0, 1.0), "SHARE",
              "With --repair: holes up to so large are capped, a share of their part's diagonal (default: 0.1)")
        ->needs(repairs);
    add_value(*verb, "--threads", a->threads, whole(1, most_threads), "N",
              "Threads of each process; the tree is the same (default: all cores)");
    CLI::Option* leave =
        verb->add_flag("--no-fold-errors", a->no_fold_errors,
                       "Do not measure what every fold changes: faster, and a smaller file; the default "
                       "fold test then measures when it first needs to");
    verb->add_flag("--fold-errors")->group("")->excludes(leave); // the default
    verb->add_flag("--lit-fold-errors", a->lit_fold_errors,
                   "Measure also what every fold changes under lights, for scenes with lights that stand still; else "
                   "the first of them measures it");
    setup.act_in(*verb, Setup::files | Setup::skip_bad);
    add_json_option(*verb, a->json);
    add_verbose_option(*verb, a->is_verbose);
    verb->footer("Examples:\n  unseen build bunny.ply -o bunny.vdt\n"
                 "  unseen build city.obj -o city.vdt --clusterer octree --threads 4 --no-fold-errors\n"
                 "  unseen build part.stl -o part.vdt --crease 45\n"
                 "  unseen build tile.obj -o tile.vdt --lock-borders\n"
                 "  unseen build car.glb -o car.vdt --protect material=badge --protect material=glass:4\n"
                 "  unseen build scan.ply -o scan.vdt --texture scan.jpg\n"
                 "  unseen build parts.stl -o parts.vdt --repair --largest-hole 0.02" +
                 std::string(ProcessTeam::is_there() ? "\n  mpirun -np 4 unseen build city.obj -o city.vdt" : ""));
    return {verb, [a] { return run(*a); }};
}

} // namespace unseen::app
