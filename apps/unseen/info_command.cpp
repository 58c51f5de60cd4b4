// unseen info: what a mesh or a tree is, and whether it is sound.
#include <algorithm>
#include <filesystem>
#include <memory>

#include "model_file.h"
#include "options.h"
#include "progress_bar.h"
#include "report.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

struct InfoArguments {
    std::string file;
    bool verify = false, json = false;
};

using Rows = std::vector<std::vector<std::string>>;

void output(bool as_json, const Json& json, const Rows& rows) {
    if (as_json) std::printf("%s\n", json.dump(2, ' ', false, Json::error_handler_t::replace).c_str());
    else print_table(rows);
}

const char* text_of(vdtree::Closedness closedness) {
    switch (closedness) {
    case vdtree::Closedness::closed_outward: return "closed";
    case vdtree::Closedness::closed_inward: return "closed, inside out";
    case vdtree::Closedness::open: break;
    }
    return "open, non-manifold or inconsistently oriented";
}

std::string text_of_colours(const vdtree::VertexTree& tree) {
    if (tree.colours().empty() && tree.texture().empty()) return "none";
    return tree.is_prelit() ? "pre-lit" : "reflectance";
}

template <class T>
std::uint64_t bytes_of(const std::vector<T>& values) {
    return values.size() * sizeof(T);
}

std::uint64_t file_bytes_of(const std::string& file) {
    std::error_code code;
    const auto size = std::filesystem::file_size(file, code);
    return code ? 0 : size;
}

Result<int> describe_tree(const InfoArguments& a) {
    auto tree = load_tree(a.file);
    if (!tree) return tree.error();
    if (a.verify) {
        if (auto sound = vdtree::verify(*tree); !sound)
            return Error{sound.error().code, a.file + ": " + sound.error().message};
    }
    const std::uint64_t file_bytes = file_bytes_of(a.file);
    const vdtree::LuminanceRange range = tree->luminance_range();
    Json json = {{"kind", "tree"},
                 {"vertices", tree->leaf_count()},
                 {"triangles", tree->triangle_count()},
                 {"dropped", tree->dropped_triangles()},
                 {"nodes", tree->node_count()},
                 {"bytes", tree->byte_size()},
                 {"file_bytes", file_bytes},
                 {"closed", tree->closedness() != vdtree::Closedness::open},
                 {"prelit", tree->is_prelit()},
                 {"texture", texture_json(*tree)},
                 {"ranges", tree->ranges().size()}};
    if (a.verify) json["verified"] = true;
    Rows rows = {
        {"kind", "tree"},
        {"vertices", grouped(tree->leaf_count())},
        {"triangles", grouped(tree->triangle_count())},
        {"dropped", grouped(tree->dropped_triangles())},
        {"nodes", grouped(tree->node_count())},
        {"bytes in memory", grouped(tree->byte_size())},
        {"bytes on disk", grouped(file_bytes)},
        {"surface", text_of(tree->closedness())},
        {"luminance", rounded(static_cast<double>(range.lo), 3) + " to " + rounded(static_cast<double>(range.hi), 3)},
        {"colours", text_of_colours(*tree)},
        {"texture", texture_text(*tree)},
        {"groups and materials", grouped(tree->ranges().size())}};
    if (a.verify) rows.push_back({"verified", "sound"});
    output(a.json, json, rows);
    return exit_done;
}

Result<int> describe_mesh(const InfoArguments& a) {
    auto read = read_mesh_file(a.file);
    if (!read) return read.error();
    const vdtree::Mesh& mesh = read->mesh;
    if (a.verify) {
        if (auto valid = vdtree::validate(mesh.view()); !valid)
            return Error{valid.error().code, a.file + ": " + valid.error().message};
    }
    const std::uint64_t bytes = bytes_of(mesh.positions) + bytes_of(mesh.triangles) + bytes_of(mesh.normals) +
                                bytes_of(mesh.colours) + bytes_of(mesh.uvs);
    const std::uint64_t file_bytes = file_bytes_of(a.file);
    const auto images = std::count_if(read->materials.begin(), read->materials.end(),
                                      [](const meshio::Material& m) { return m.has_image(); });
    Json json = {{"kind", "mesh"},
                 {"vertices", mesh.positions.size()},
                 {"triangles", mesh.triangles.size()},
                 {"dropped", read->dropped_triangles},
                 {"nodes", nullptr},
                 {"bytes", bytes},
                 {"file_bytes", file_bytes},
                 {"faces", read->source_faces},
                 {"images", images},
                 {"ranges", mesh.ranges.size()}};
    if (a.verify) json["verified"] = true;
    const auto yes = [](bool has) { return std::string(has ? "yes" : "no"); };
    Rows rows = {{"kind", "mesh"},
                 {"vertices", grouped(mesh.positions.size())},
                 {"faces", grouped(read->source_faces)},
                 {"triangles", grouped(mesh.triangles.size())},
                 {"dropped", grouped(read->dropped_triangles)},
                 {"bytes in memory", grouped(bytes)},
                 {"bytes on disk", grouped(file_bytes)},
                 {"normals", yes(!mesh.normals.empty())},
                 {"colours", yes(!mesh.colours.empty())},
                 {"texture coordinates", yes(!mesh.uvs.empty())},
                 {"materials with images", std::to_string(images)},
                 {"groups and materials", grouped(mesh.ranges.size())}};
    if (a.verify) rows.push_back({"verified", "sound"});
    output(a.json, json, rows);
    return exit_done;
}

Result<int> run(const InfoArguments& a) { return vdtree::is_tree_file(a.file) ? describe_tree(a) : describe_mesh(a); }

} // namespace

Command info_command(CLI::App& app) {
    auto a = std::make_shared<InfoArguments>();
    CLI::App* verb = app.add_subcommand("info", "Say what a mesh or a tree holds");
    verb->add_option("FILE", a->file, "A mesh or a tree")->required()->type_name("MESH|TREE.vdt");
    verb->add_flag("--verify", a->verify, "Check everything: checksums, ranges, nesting of the bounds");
    verb->add_flag("--json", a->json, "JSON instead of a table");
    verb->footer("Examples:\n  unseen info bunny.ply\n  unseen info bunny.vdt --verify --json");
    return {verb, [a] { return run(*a); }};
}

} // namespace unseen::app
