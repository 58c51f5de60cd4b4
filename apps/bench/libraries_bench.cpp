#include <algorithm>
#include <filesystem>

#include <unseen/meshio/examine.h>
#include <unseen/meshio/mesh_file.h>
#include <unseen/vdtree/tree_io.h>

#include "bench_tools.h"
#include "benches.h"
#include "surface_distance.h"
#include "terminal.h"

namespace unseen::app {
namespace {

namespace fs = std::filesystem;

// At most so many triangles; the largest displacement is the least. No viewer takes part.
vdtree::Mesh cut_to(const vdtree::VertexTree& tree, vdtree::Index triangles) {
    const float scale = 1 / tree.bounding_sphere().radius;
    const auto displacement = [=](const vdtree::VertexTree& t, std::span<const vdtree::NodeId> nodes,
                                  std::span<float> costs) {
        for (std::size_t i = 0; i < nodes.size(); ++i) costs[i] = t.displacement()[nodes[i]] * scale;
    };
    vdtree::Cut cut(tree);
    cut.adjust(displacement, triangles);
    return vdtree::extract_mesh(cut);
}

// A row: one build of a mesh, by the command `unseen` of this build.
std::vector<Cell> row_of_build(const std::string& file, const vdtree::Mesh& original, bool repairs,
                               const std::string& clusterer, const fs::path& tree_file) {
    std::vector<std::string> words = {"build",        file,     "-o", tree_file.string(), "--no-fold-errors",
                                      "--no-texture", "--json", "-",  "--clusterer",      clusterer};
    if (repairs) words.push_back("--repair");
    const ChildOutcome outcome = require(run_unseen(words));
    std::vector<Cell> cells = {fs::path(file).filename().string(), {repairs ? "yes" : "", repairs}, clusterer};
    const Cell empty("", Json());
    const Json report = Json::parse(outcome.out, nullptr, false);
    if (outcome.status != 0 || !report.is_object()) { // not manifold, as a rule: stderr has said so
        cells.insert(cells.end(), {Cell("refused", Json()), empty, empty, empty, empty, empty});
        return cells;
    }
    const vdtree::VertexTree tree = require(vdtree::read_tree(tree_file));
    const meshio::Examination examined = require(meshio::examine(whole_mesh(tree).view()));
    constexpr std::size_t kept_one_in = 10; // triangles of the cut that is compared
    const auto budget = static_cast<vdtree::Index>(std::max<std::size_t>(1, original.triangles.size() / kept_one_in));
    const vdtree::Mesh small = cut_to(tree, budget);
    const double error = 1e6 * mean_surface_distance(original, small);
    const double mib = report.value("peak_bytes", 0.0) / (1 << 20);
    const Json repair = report.value("repair", Json());
    const auto bad_edges = examined.boundary_edges + examined.non_manifold_edges + examined.inconsistent_edges;
    cells.insert(cells.end(),
                 {count(tree.triangle_count()), count(static_cast<double>(bad_edges)),
                  repair.is_object() ? count(repair.value("capped_holes", 0.0)) : empty, number(error, 3),
                  Cell(rounded(outcome.seconds, 2) + " s", outcome.seconds), Cell(rounded(mib, 3) + " MiB", mib)});
    return cells;
}

} // namespace

BenchReport bench_libraries(const BenchOptions& options) {
    const BenchFolder folder;
    BenchTable table{.columns = {{"mesh", "mesh"},
                                 {"repaired", "repaired"},
                                 {"clusterer", "clusterer"},
                                 {"triangles", "triangles"},
                                 {"border or irregular edges", "bad_edges"},
                                 {"holes capped", "capped_holes"},
                                 {"error at a tenth", "error_millionths"},
                                 {"time", "seconds"},
                                 {"memory", "peak_mib"}}};
    for (const std::string& file : options.inputs) {
        const meshio::ReadResult read = require(meshio::read_mesh(file));
        for (const bool repairs : {false, true})
            for (const char* clusterer : {"quadric", "octree", "openmesh"})
                table.rows.push_back(row_of_build(file, read.mesh, repairs, clusterer, folder / "tree.vdt"));
    }
    return {{std::move(table)}};
}

} // namespace unseen::app
