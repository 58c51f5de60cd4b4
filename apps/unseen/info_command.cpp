// unseen info: what a mesh or a tree is, and whether it is sound.
#include <algorithm>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>

#include <unseen/meshio/examine.h>
#include <unseen/meshio/mesh_file.h>
#include <unseen/meshio/scene_file.h>

#include "options.h"
#include "other_libraries.h"
#include "progress_bar.h"
#include "report.h"
#include "session_options.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

struct InfoArguments {
    const ViewOptions& view;
    std::string file = {};
    bool verify = false, is_exact = false, json = false, is_verbose = false;
};

using Facts = std::vector<Fact>;

void output(bool as_json, const Facts& facts) {
    if (as_json) std::fputs(json_text(to_json(facts)).c_str(), stdout);
    else print_facts(facts);
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

// Values of vertices: those that cuts are written with.
using Arrays = std::vector<meshio::VertexArray>;

Arrays values_among(Arrays arrays) {
    std::erase_if(arrays, [](const meshio::VertexArray& a) { return a.role != meshio::VertexArray::Role::value; });
    return arrays;
}

Json arrays_json(const Arrays& arrays) {
    Json json = Json::array();
    for (const meshio::VertexArray& array : arrays) {
        Json ranges = Json::array();
        std::uint64_t not_finite = 0;
        for (std::uint32_t c = 0; c < array.components; ++c) {
            const meshio::ValueRange range = meshio::range_of(array, c);
            ranges.push_back(range.low <= range.high ? Json{range.low, range.high} : Json());
            not_finite += range.not_finite;
        }
        json.push_back({{"name", array.name},
                        {"type", meshio::name_of(array.type)},
                        {"components", array.components},
                        {"ranges", std::move(ranges)},
                        {"not_finite", not_finite}});
    }
    return json;
}

// "values 'pressure': float32, 0.1 to 5", one line an array.
void print_arrays(const Arrays& arrays) {
    for (const Json& array : arrays_json(arrays)) {
        std::string name = array["name"], text;
        for (char& c : name)
            if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = '?'; // nothing that a terminal obeys
        for (const Json& range : array["ranges"]) {
            text += text.empty() ? ", " : "; ";
            text += range.is_null() ? "none finite"
                                    : rounded(range[0].get<double>(), 6) + " to " + rounded(range[1].get<double>(), 6);
        }
        const auto not_finite = array["not_finite"].get<std::uint64_t>();
        const auto components = array["components"].get<std::uint32_t>();
        print_line("values '" + name + "': " + array["type"].get<std::string>() +
                   (components > 1 ? " x " + std::to_string(components) : "") + text +
                   (not_finite > 0 ? "; " + grouped(not_finite) + " NaN or infinite" : ""));
    }
}

// What surfaces are made of, by name; images by the names of their files.
using Materials = std::vector<meshio::Material>;

std::string image_of(const meshio::Material& material) {
    if (!material.image.empty()) return material.image.generic_string();
    return material.image_bytes ? "in the file" : "";
}

Json materials_json(const Materials& materials) {
    Json json = Json::array();
    for (const meshio::Material& m : materials) {
        const std::string image = image_of(m);
        json.push_back({{"name", m.name},
                        {"colour", {m.colour.r, m.colour.g, m.colour.b, m.colour.a}},
                        {"image", image.empty() ? Json() : Json(image)}});
    }
    return json;
}

// "material 'bark': image oak.png", one line each.
void print_materials(const Materials& materials, bool with_all) {
    constexpr std::size_t most_lines = 40;
    const std::size_t shown = with_all ? materials.size() : std::min(materials.size(), most_lines);
    for (std::size_t i = 0; i < shown; ++i) {
        const std::string image = image_of(materials[i]);
        print_line("material '" + printable(materials[i].name) +
                   "': " + (image.empty() ? std::string("no image") : "image " + printable(image)));
    }
    if (shown < materials.size())
        print_line("and " + grouped(materials.size() - shown) + " more materials (--verbose lists them)");
}

// What the mesh's file said.
Result<Arrays> arrays_of(const vdtree::VertexTree& tree) {
    if (tree.document().empty()) return Arrays();
    auto document = meshio::unpack(tree.document());
    if (!document) return document.error();
    return values_among(std::move(document->arrays));
}

const Fact is_sound = {"verified", "verified", true, "sound"};

Result<int> describe_tree(const InfoArguments& a) {
    auto tree = load_tree(a.file);
    if (!tree) return tree.error();
    if (a.verify) {
        if (auto sound = vdtree::verify(*tree); !sound)
            return Error{sound.error().code, a.file + ": " + sound.error().message};
    }
    std::optional<ExactCheck> exact;
    if (a.is_exact) {
        ProgressBar bar("checking exactly");
        auto checked = verify_by_cgal(*tree, std::ref(bar));
        if (!checked) return Error{checked.error().code, a.file + ": " + checked.error().message};
        exact = *checked;
    }
    const auto arrays = arrays_of(*tree);
    if (!arrays) return Error{arrays.error().code, a.file + ": " + arrays.error().message};
    const vdtree::LuminanceRange range = tree->luminance_range();
    Facts facts = {{"kind", "kind", "tree", "tree"},
                   count_of("vertices", "vertices", tree->leaf_count()),
                   count_of("triangles", "triangles", tree->triangle_count()),
                   count_of("dropped", "dropped", tree->dropped_triangles()),
                   count_of("nodes", "nodes", tree->node_count()),
                   count_of("bytes", "bytes in memory", tree->byte_size()),
                   count_of("file_bytes", "bytes on disk", file_bytes_of(a.file)),
                   {"closed", "surface", tree->closedness() != vdtree::Closedness::open, text_of(tree->closedness())},
                   {"",
                    "luminance",
                    {},
                    rounded(static_cast<double>(range.lo), 3) + " to " + rounded(static_cast<double>(range.hi), 3)},
                   {"prelit", "colours", tree->is_prelit(), text_of_colours(*tree)},
                   {"texture", "texture", texture_json(*tree), texture_text(*tree)},
                   {"creases", "hard edges", creases_json(tree->creases()), creases_text(tree->creases())},
                   {"protected", "protected", protection_json(*tree), protection_text(*tree)},
                   {"arrays", "", arrays_json(*arrays)},
                   count_of("ranges", "groups and materials", tree->ranges().size())};
    if (a.verify) facts.push_back(is_sound);
    if (exact)
        facts.push_back({"verified_exactly",
                         "in exact arithmetic",
                         {{"comparisons", exact->comparisons}, {"in_rationals", exact->in_rationals}},
                         "sound: " + grouped(exact->comparisons) + " comparisons, " + grouped(exact->in_rationals) +
                             " of them in rationals"});
    output(a.json, facts);
    if (!a.json) print_arrays(*arrays);
    return exit_done;
}

// A count of something unusual, and what it means for simplification.
struct Finding {
    const char* key; // in JSON; with blanks for underscores, in the table
    std::uint64_t count;
    const char* meaning;
};

std::vector<Finding> findings(const meshio::ReadResult& read, const meshio::Examination& mesh) {
    return {
        {"bad_vertices", read.bad.vertices, "NaN or infinite coordinates: refused without --skip-bad"},
        {"bad_faces", read.bad.faces,
         "corners that are not there, or NaN or infinite ones of STL: refused without --skip-bad"},
        {"boundary_edges", mesh.boundary_edges,
         "open: both sides are drawn, and nothing folds for facing away or being hidden; borders are held in place"},
        {"boundary_loops", mesh.boundary_loops, "the holes and rims that these edges make"},
        {"non_manifold_edges", mesh.non_manifold_edges, "more than two triangles meet: the surface counts as open"},
        {"non_manifold_vertices", mesh.non_manifold_vertices,
         "surfaces touch in a point only: that alone does not make them open"},
        {"inconsistent_edges", mesh.inconsistent_edges,
         "neighbours face opposite ways: the surface counts as open, and normals computed there may point anywhere"},
        {"inside_out_components", mesh.inside_out_components,
         "closed parts that face inward: a model of such parts only is turned, beside others they count as cavities"},
        {"degenerate_triangles", mesh.degenerate_triangles,
         "zero area: never seen; those that use a vertex twice are dropped, the others cost triangles until they fold"},
        {"duplicate_triangles", mesh.duplicate_triangles,
         "on the corners of others: drawn twice, and their edges are non-manifold as a rule"},
        {"duplicate_vertices", mesh.duplicate_vertices,
         "equal to others in all attributes: they cost memory and hold folds back; weld them"},
        {"unreferenced_vertices", mesh.unreferenced_vertices, "in no triangle: they are not drawn"},
    };
}

Json examination_json(const meshio::ReadResult& read, const meshio::Examination& mesh) {
    Json json = {{"components", mesh.components},
                 {"closed_components", mesh.closed_components},
                 {"coincident_vertices", mesh.coincident_vertices},
                 {"unwelded", mesh.is_unwelded},
                 {"low", {mesh.low.x, mesh.low.y, mesh.low.z}},
                 {"high", {mesh.high.x, mesh.high.y, mesh.high.z}}};
    for (const Finding& finding : findings(read, mesh)) json[finding.key] = finding.count;
    return json;
}

// Nothing in a file says what a unit is: what the usual ones would make of it.
std::string text_of_extent(const meshio::Examination& mesh) {
    const glm::dvec3 extent = mesh.high - mesh.low;
    const double largest = std::max({extent.x, extent.y, extent.z});
    return rounded(extent.x, 4) + " x " + rounded(extent.y, 4) + " x " + rounded(extent.z, 4) +
           " units: " + rounded(largest, 4) + " m, or " + rounded(largest / 1000, 4) +
           " m with --unit 0.001 (millimetres)";
}

// The size, then one sentence for each finding; those that are fine only where asked for.
void print_findings(const meshio::ReadResult& read, const meshio::Examination& mesh, bool with_all) {
    print_line("extent: " + text_of_extent(mesh));
    bool all_fine = !mesh.is_unwelded;
    if (mesh.is_unwelded)
        print_line("unwelded: no two triangles share a vertex: more memory, and more triangles for the same picture; "
                   "weld it");
    for (const Finding& finding : findings(read, mesh)) {
        all_fine = all_fine && finding.count == 0;
        if (finding.count == 0 && !with_all) continue;
        std::string name = finding.key;
        std::replace(name.begin(), name.end(), '_', ' ');
        print_line(name + ": " + grouped(finding.count) +
                   (finding.count > 0 ? std::string(": ") + finding.meaning : std::string()));
    }
    if (all_fine) print_line("nothing unusual: closed, manifold and consistently oriented");
}

Result<int> describe_mesh(const InfoArguments& a) {
    auto read = read_mesh_file(a.file, !a.verify);
    if (!read) return read.error();
    const vdtree::Mesh& mesh = read->mesh;
    const auto examined = meshio::examine(mesh.view()); // validates it, too
    if (!examined) return Error{examined.error().code, a.file + ": " + examined.error().message};
    const std::uint64_t bytes = bytes_of(mesh.positions) + bytes_of(mesh.triangles) + bytes_of(mesh.normals) +
                                bytes_of(mesh.colours) + bytes_of(mesh.uvs);
    const Arrays arrays = read->document ? values_among(std::move(read->document->arrays)) : Arrays();
    const auto images =
        static_cast<std::uint64_t>(std::ranges::count_if(read->materials, &meshio::Material::has_image));
    const auto has = [](const char* label, bool there) { return Fact{"", label, {}, there ? "yes" : "no"}; };
    Facts facts = {{"kind", "kind", "mesh", "mesh"},
                   count_of("vertices", "vertices", mesh.positions.size()),
                   count_of("", "faces", read->source_faces),
                   count_of("triangles", "triangles", mesh.triangles.size()),
                   count_of("dropped", "dropped", read->dropped_triangles),
                   {"nodes", ""},
                   count_of("bytes", "bytes in memory", bytes),
                   count_of("file_bytes", "bytes on disk", file_bytes_of(a.file)),
                   has("normals", !mesh.normals.empty()),
                   has("colours", !mesh.colours.empty()),
                   has("texture coordinates", !mesh.uvs.empty()),
                   {"faces", "", read->source_faces},
                   {"images", "materials with images", images, std::to_string(images)},
                   {"materials", "", materials_json(read->materials)},
                   {"arrays", "", arrays_json(arrays)},
                   {"examination", "", examination_json(*read, *examined)},
                   count_of("ranges", "groups and materials", mesh.ranges.size()),
                   count_of("", "components", examined->components),
                   count_of("", "of them closed", examined->closed_components)};
    if (a.verify) facts.push_back(is_sound);
    output(a.json, facts);
    if (!a.json) print_materials(read->materials, a.is_verbose);
    if (!a.json) print_arrays(arrays);
    if (!a.json) print_findings(*read, *examined, a.is_verbose);
    return exit_done;
}

const char* name_of(meshio::SceneLight::Kind kind) {
    using Kind = meshio::SceneLight::Kind;
    return kind == Kind::directional ? "directional" : kind == Kind::point ? "point" : "spot";
}

Json json_of(glm::dvec3 v) { return {v.x, v.y, v.z}; }

// A mesh of a scene, and who shows it.
struct SceneMesh {
    std::int32_t number = 0;
    std::string name; // of the first node
    std::uint64_t triangles = 0, nodes = 0, background_nodes = 0;

    std::uint64_t objects() const { return nodes - background_nodes; }
};

// All meshes; `materials` receives theirs, each once.
Result<std::vector<SceneMesh>> examine_meshes(const InfoArguments& a, meshio::SceneFile& file, Materials& materials) {
    std::map<std::int32_t, SceneMesh> meshes;
    for (const meshio::SceneNode& node : file.contents().nodes) {
        SceneMesh& mesh = meshes[node.mesh];
        if (mesh.nodes++ == 0) mesh.name = node.name;
        mesh.number = node.mesh;
        mesh.background_nodes += node.is_background;
    }
    std::vector<SceneMesh> all;
    for (auto& [number, mesh] : meshes) {
        const auto read = file.mesh(static_cast<std::size_t>(number));
        if (!read) return read.error();
        if (*read) {
            if (const auto examined = meshio::examine((*read)->mesh.view()); !examined)
                return Error{examined.error().code, a.file + ": " + examined.error().message};
            mesh.triangles = (*read)->mesh.triangles.size();
            for (const meshio::Material& material : (*read)->materials)
                if (std::ranges::none_of(materials, [&](const auto& m) { return m.name == material.name; }))
                    materials.push_back(material);
        }
        all.push_back(std::move(mesh));
    }
    return all;
}

Facts scene_facts(const meshio::SceneContents& contents, const std::vector<SceneMesh>& meshes,
                  const Materials& materials, std::uint64_t file_bytes) {
    std::uint64_t objects = 0, own = 0, shown = 0, background = 0;
    Json list = Json::array();
    for (const SceneMesh& mesh : meshes) {
        objects += mesh.objects();
        own += mesh.triangles;
        shown += mesh.triangles * mesh.objects();
        background += mesh.triangles * mesh.background_nodes;
        list.push_back({{"mesh", mesh.number},
                        {"name", mesh.name},
                        {"triangles", mesh.triangles},
                        {"nodes", mesh.nodes},
                        {"background_nodes", mesh.background_nodes}});
    }
    Json lights = Json::array();
    for (const meshio::SceneLight& light : contents.lights)
        lights.push_back({{"type", name_of(light.kind)}, {"name", light.name}, {"intensity", light.intensity}});
    Json camera;
    if (contents.camera)
        camera = {{"name", contents.camera->name},
                  {"eye", json_of(contents.camera->eye)},
                  {"forward", json_of(contents.camera->forward)},
                  {"fov_y_degrees", contents.camera->fov_y_degrees}};
    const std::string field = contents.camera ? rounded(contents.camera->fov_y_degrees, 3) + " degrees high" : "none";
    return {{"kind", "kind", "scene", "scene"},
            count_of("objects", "objects", objects),
            count_of("triangles", "their triangles", shown),
            {"meshes", "different meshes", std::move(list), grouped(meshes.size())},
            count_of("mesh_triangles", "their triangles, once each", own),
            count_of("background_triangles", "background triangles", background),
            count_of("", "materials", materials.size()),
            {"lights", "lights", std::move(lights), grouped(contents.lights.size())},
            {"camera", "camera", std::move(camera), field},
            {"materials", "", materials_json(materials)},
            count_of("file_bytes", "bytes on disk", file_bytes)};
}

Result<int> describe_scene(const InfoArguments& a, meshio::SceneFile& file) {
    const meshio::SceneContents& contents = file.contents();
    const session::Messages messages = terminal_messages();
    for (const auto& warning : contents.warnings) messages.warning(a.file + ": " + warning);
    for (const auto& note : contents.notes) messages.note(a.file + ": " + note);
    Materials materials;
    const auto meshes = examine_meshes(a, file, materials);
    if (!meshes) return meshes.error();
    Facts facts = scene_facts(contents, *meshes, materials, file_bytes_of(a.file));
    if (a.verify) facts.push_back(is_sound);
    constexpr std::size_t most_lines = 40;
    const std::size_t lines = a.is_verbose ? meshes->size() : std::min(meshes->size(), most_lines);
    for (const SceneMesh& mesh : std::span(*meshes).first(lines))
        facts.push_back({"",
                         "mesh " + std::to_string(mesh.number) + " '" + printable(mesh.name) + "'",
                         {},
                         grouped(mesh.triangles) + " triangles, " + grouped(mesh.nodes) +
                             (mesh.nodes == 1 ? " node" : " nodes") + (mesh.objects() == 0 ? ", background" : "")});
    output(a.json, facts);
    if (a.json) return exit_done;
    print_materials(materials, a.is_verbose);
    if (lines < meshes->size())
        print_line("and " + grouped(meshes->size() - lines) + " more meshes (--verbose lists them)");
    return exit_done;
}

Result<int> run(const InfoArguments& a) {
    if (vdtree::is_tree_file(a.file)) return describe_tree(a);
    if (a.is_exact)
        return Error{ErrorCode::invalid_argument, a.file +
                                                      " is no tree, and --exact checks the bounds of trees: build one "
                                                      "of it, or leave --exact out."};
    if (a.view.as == session::LoadAs::scene && !meshio::is_gltf_file(a.file))
        return Error{ErrorCode::invalid_argument,
                     a.file + " is no glTF file (.glb, .gltf), and only these are scenes: leave --as out."};
    if (a.view.as != session::LoadAs::model && meshio::is_gltf_file(a.file)) {
        meshio::ReadOptions options;
        options.drop = {true, true, true, true}; // nothing is made of it
        options.skip_bad = !a.verify;
        auto file = meshio::SceneFile::read(a.file, options);
        if (!file) return file.error();
        if (a.view.as == session::LoadAs::scene || file->contents().is_scene) return describe_scene(a, *file);
    }
    return describe_mesh(a);
}

} // namespace

Command info_command(CLI::App& app, Setup& setup) {
    auto a = std::make_shared<InfoArguments>(InfoArguments{setup.view_options()});
    CLI::App* verb = app.add_subcommand("info", "Say what a mesh, a tree or a scene holds, and what is wrong with it");
    verb->add_option("FILE", a->file, "A mesh, a tree or a scene")->required()->type_name("MESH|TREE.vdt|SCENE.glb");
    setup.act_in(*verb, Setup::scenes);
    CLI::Option* verify =
        verb->add_flag("--verify", a->verify, "Check everything: checksums, ranges, nesting of the bounds");
    verb->add_flag("--exact", a->is_exact, "With --verify, for a tree: check the bounds in exact arithmetic, too")
        ->needs(verify);
    verb->add_flag("--json", a->json, "JSON instead of a table");
    verb->add_flag("--verbose", a->is_verbose, "For a mesh also counts of zero, for a scene all meshes");
    verb->footer(
        "A mesh is examined: holes, non-manifold and inconsistent edges, duplicates, parts that are inside out, size;\n"
        "what is unusual is said with what it means for simplification. Bad vertices and faces are counted and left\n"
        "out, but for --verify. Values of vertices are listed: name, type, components, range of each.\n\n"
        "For a scene: its objects, how often each mesh is shown, materials, lights and camera; --as model examines it "
        "as\n"
        "one mesh.\n\n"
        "Examples:\n  unseen info bunny.ply\n  unseen info museum.glb\n  unseen info bunny.vdt --verify --json");
    return {verb, [a] { return run(*a); }};
}

} // namespace unseen::app
