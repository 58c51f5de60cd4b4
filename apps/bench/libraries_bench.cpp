#include "libraries_bench.h"

#include <algorithm>
#include <filesystem>

#include <unistd.h>

#include <unseen/meshio/examine.h>
#include <unseen/meshio/mesh_file.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/tree_io.h>

#include "bench_tools.h"
#include "child_process.h"
#include "surface_distance.h"
#include "terminal.h"

namespace unseen::app {
namespace {

namespace fs = std::filesystem;

constexpr vdtree::Index kept_one_in = 10; // triangles of the cut that is compared
constexpr double millionths = 1e6;

// A folder that goes when it is done with.
class TreeFolder {
public:
    TreeFolder() : path_(fs::temp_directory_path() / ("unseen-libraries-" + std::to_string(getpid()))) {
        std::error_code ignored; // building says what is wrong
        fs::create_directory(path_, ignored);
    }
    TreeFolder(const TreeFolder&) = delete;
    TreeFolder& operator=(const TreeFolder&) = delete;
    ~TreeFolder() {
        std::error_code ignored;
        fs::remove_all(path_, ignored);
    }
    fs::path tree() const { return path_ / "tree.vdt"; }

private:
    fs::path path_;
};

// At most so many triangles; the largest displacement is the least. No viewer takes part.
vdtree::Mesh cut_to(const vdtree::VertexTree& tree, vdtree::Index triangles) {
    const float scale = 1 / tree.bounding_sphere().radius;
    const auto displacement = [=](const vdtree::VertexTree& t, std::span<const vdtree::NodeId> nodes,
                                  std::span<float> costs) {
        for (std::size_t i = 0; i < nodes.size(); ++i) costs[i] = t.displacement()[nodes[i]] * scale;
    };
    vdtree::Cut cut(tree);
    cut.adjust(displacement, {.triangle_budget = triangles});
    return vdtree::extract_mesh(cut);
}

vdtree::Mesh whole_mesh_of(const vdtree::VertexTree& tree) {
    vdtree::Cut cut(tree);
    cut.unfold_all();
    return vdtree::extract_mesh(cut);
}

std::uint64_t bad_edges(const meshio::Examination& e) {
    return e.boundary_edges + e.non_manifold_edges + e.inconsistent_edges;
}

// One build of a mesh: a row, and its cells for people.
Result<void> add_build(const std::string& file, const vdtree::Mesh& original, bool repairs,
                       const std::string& clusterer, const TreeFolder& folder, LibrariesBenchResult& result) {
    std::vector<std::string> words = {command_beside("unseen"),
                                      "build",
                                      file,
                                      "-o",
                                      folder.tree().string(),
                                      "--no-fold-errors",
                                      "--no-texture",
                                      "--json",
                                      "-",
                                      "--clusterer",
                                      clusterer};
    if (repairs) words.push_back("--repair");
    const auto outcome = run_child(words);
    if (!outcome) return outcome.error();
    const std::string name = fs::path(file).filename().string();
    Json& row = result.rows.emplace_back(Json{{"mesh", name}, {"repaired", repairs}, {"clusterer", clusterer}});
    auto& cells = result.table.rows.emplace_back(std::vector<std::string>{name, repairs ? "yes" : "", clusterer});
    const Json report = Json::parse(outcome->out, nullptr, false);
    if (outcome->status != 0 || !report.is_object()) { // not manifold, as a rule: stderr has said so
        row["refused"] = true;
        cells.insert(cells.end(), {"refused", "", "", "", "", ""});
        return {};
    }
    const auto tree = vdtree::read_tree(folder.tree());
    if (!tree) return tree.error();
    const auto examined = meshio::examine(whole_mesh_of(*tree).view());
    if (!examined) return examined.error();
    const auto budget = std::max<vdtree::Index>(1, static_cast<vdtree::Index>(original.triangles.size()) / kept_one_in);
    const vdtree::Mesh small = cut_to(*tree, budget);
    const double error = small.triangles.empty() ? std::numeric_limits<double>::quiet_NaN()
                                                 : millionths * mean_surface_distance(original, small);
    const double mib = report.value("peak_bytes", 0.0) / (1 << 20);
    const Json repair = report.value("repair", Json());
    row["triangles"] = tree->triangle_count();
    row["bad_edges"] = bad_edges(*examined);
    row["error_millionths"] = number_or_null(error);
    row["seconds"] = outcome->seconds;
    row["peak_mib"] = mib;
    row["repair"] = repair;
    cells.insert(cells.end(), {grouped(tree->triangle_count()), grouped(bad_edges(*examined)),
                               repair.is_object() ? grouped(repair.value("capped_holes", std::uint64_t{0})) : "",
                               rounded(error, 3), rounded(outcome->seconds, 2) + " s", rounded(mib, 3) + " MiB"});
    return {};
}

} // namespace

Result<LibrariesBenchResult> bench_libraries(const std::vector<std::string>& meshes) {
    const TreeFolder folder;
    LibrariesBenchResult result;
    result.table.rows = {{"mesh", "repaired", "clusterer", "triangles", "border or irregular edges", "holes capped",
                          "error at a tenth", "time", "memory"}};
    for (const std::string& file : meshes) {
        const auto read = meshio::read_mesh(file);
        if (!read) return read.error();
        for (const bool repairs : {false, true})
            for (const std::string clusterer : {"quadric", "octree", "openmesh"})
                if (auto added = add_build(file, read->mesh, repairs, clusterer, folder, result); !added)
                    return added.error();
    }
    return result;
}

} // namespace unseen::app
