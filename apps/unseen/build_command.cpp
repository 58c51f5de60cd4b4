// unseen build: a mesh becomes a vertex tree, once and for all.
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>

#include "command.h"
#include "model_file.h"
#include "options.h"
#include "progress_bar.h"
#include "report.h"
#include "terminal.h"

namespace unseen::app {
namespace {

struct BuildArguments {
    std::string mesh, out, json;
    vdtree::ClustererKind clusterer = vdtree::ClustererKind::quadric;
    vdtree::ColourEncoding colours = vdtree::ColourEncoding::srgb;
    int threads = 0;
};

constexpr int most_threads = 1024;

Result<void> write(const std::string& file, const vdtree::VertexTree& tree) {
    ProgressBar bar("writing " + file);
    return vdtree::write_tree(file, tree, bar);
}

// The most memory that this process has had resident, or nothing where the system does not tell.
Json peak_bytes() {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);)
        if (line.starts_with("VmHWM:")) return std::strtoull(line.c_str() + 6, nullptr, 10) * 1024; // it counts KiB
    return nullptr;
}

Json to_json(const vdtree::VertexTree& tree, double seconds) {
    return {{"vertices", tree.leaf_count()},       {"triangles", tree.triangle_count()},
            {"dropped", tree.dropped_triangles()}, {"nodes", tree.node_count()},
            {"bytes", tree.byte_size()},           {"build_seconds", number_or_null(seconds)},
            {"peak_bytes", peak_bytes()}};
}

void print(const vdtree::VertexTree& tree, double seconds) {
    const double bytes_per_triangle = static_cast<double>(tree.byte_size()) / tree.triangle_count();
    print_table({{"vertices", grouped(tree.leaf_count())},
                 {"triangles", grouped(tree.triangle_count())},
                 {"dropped", grouped(tree.dropped_triangles())},
                 {"nodes", grouped(tree.node_count())},
                 {"bytes", grouped(tree.byte_size())},
                 {"bytes a triangle", rounded(bytes_per_triangle, 4)},
                 {"built in", rounded(seconds, 3) + " s"}});
}

Result<int> run(const BuildArguments& a) {
    std::error_code unknown;
    if (std::filesystem::equivalent(a.mesh, a.out, unknown))
        return Error{ErrorCode::invalid_argument, "'" + a.out + "' is the mesh itself: give the tree another name."};
    if (vdtree::is_tree_file(a.mesh))
        return Error{ErrorCode::invalid_argument, "'" + a.mesh + "' is a tree already; give a mesh."};
    auto report = JsonReport::open(a.json);
    if (!report) return report.error();
    vdtree::ReadOptions reading;
    reading.colours = a.colours;
    auto read = read_mesh_file(a.mesh, reading);
    if (!read) return read.error();

    vdtree::BuildOptions building;
    building.clusterer = a.clusterer;
    building.threads = a.threads;
    const auto start = std::chrono::steady_clock::now();
    auto tree = build_tree_of(std::move(*read), building);
    if (!tree) return tree.error();
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();

    if (auto ok = report->prepare(to_json(*tree, seconds)); !ok) return ok.error();
    if (auto ok = write(a.out, *tree); !ok) return ok.error();
    if (auto ok = report->publish(); !ok) return ok.error();
    if (!report->is_on_stdout()) print(*tree, seconds);
    return exit_done;
}

} // namespace

Command build_command(CLI::App& app) {
    auto a = std::make_shared<BuildArguments>();
    CLI::App* verb = app.add_subcommand("build", "Build the vertex tree of a mesh");
    verb->add_option("MESH", a->mesh, "PLY, OBJ, OFF, STL or glTF")->required();
    verb->add_option("-o,--output", a->out, "The tree")->type_name("TREE.vdt")->required()->check(ending_in({".vdt"}));
    const std::map<std::string, vdtree::ClustererKind> kinds = {{"quadric", vdtree::ClustererKind::quadric},
                                                                {"octree", vdtree::ClustererKind::octree}};
    verb->add_option("--clusterer", a->clusterer, "quadric (best; default) or octree (fast)")
        ->type_name("NAME")
        ->transform(CLI::CheckedTransformer(kinds).description(""));
    const std::map<std::string, vdtree::ColourEncoding> encodings = {{"srgb", vdtree::ColourEncoding::srgb},
                                                                     {"linear", vdtree::ColourEncoding::linear}};
    verb->add_option("--colours", a->colours, "How the file's colours are encoded: srgb (default) or linear")
        ->type_name("NAME")
        ->transform(CLI::CheckedTransformer(encodings).description(""));
    verb->add_option("--threads", a->threads, "Threads to build with; the tree is the same (default: all cores)")
        ->type_name("N")
        ->check(within(1, most_threads));
    verb->add_option("--json", a->json, "Report as JSON, to a file or to stdout (-)")->type_name("FILE|-");
    verb->footer("Examples:\n  unseen build bunny.ply -o bunny.vdt\n"
                 "  unseen build city.obj -o city.vdt --clusterer octree --threads 4");
    return {verb, [a] { return run(*a); }};
}

} // namespace unseen::app
