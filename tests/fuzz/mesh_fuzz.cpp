// Fuzz target for the readers of meshes, scenes and materials: any bytes may come in, and only a valid mesh or an error
// may come out.
// tests/README.md tells how to build and run it.
#include "mesh_readers.h"
#include "mtl_reader.h"

#include <unseen/meshio/examine.h>
#include <unseen/meshio/scene_file.h>

#include <cstdint>
#include <cstdlib>
#include <iterator>
#include <memory>
#include <set>
#include <string>
#include <string_view>

#include "target.h"

namespace {

// Formats without a signature go by the name's ending; the first byte chooses it.
constexpr const char* names[] = {"fuzz.ply",  "fuzz.obj", "fuzz.off", "fuzz.stl",
                                 "fuzz.gltf", "fuzz",     "fuzz.vtp", "fuzz.mtl"};

// Materials lie beside an OBJ file; no folder is read here, and so they come by themselves.
bool read_materials(std::string_view bytes, const char* name) {
    unseen::meshio::MtlContents contents;
    const auto found = [](std::string_view image) {
        return unseen::meshio::NamedFile{"a.png", std::make_shared<const std::string>(image), {}};
    };
    unseen::meshio::read_mtl(bytes, name, found, {}, contents);
    return !contents.materials.empty();
}

} // namespace

bool unseen::fuzz::accepts(std::string_view input) {
    if (input.empty()) return false;
    const std::string_view bytes = input.substr(1);
    const auto choice = static_cast<unsigned char>(input[0]);
    const char* const name = names[choice % std::size(names)];
    if (std::string_view(name).ends_with(".mtl")) return read_materials(bytes, name);
    unseen::meshio::ReadOptions options;
    options.skip_bad = choice >= 128;
    bool is_accepted = true;
    if (std::string_view(name).ends_with(".gltf")) { // as a scene, too
        auto scene = unseen::meshio::SceneFile::from_bytes(std::string(bytes), name, options);
        if (!scene && scene.error().message.empty()) std::abort();
        is_accepted = scene.has_value();
        std::set<std::int32_t> meshes;
        if (scene)
            for (const auto& node : scene->contents().nodes) meshes.insert(node.mesh);
        for (const std::int32_t mesh : meshes) {
            const auto read = scene->mesh(static_cast<std::size_t>(mesh));
            if (read && *read && !unseen::vdtree::validate((*read)->mesh.view())) std::abort();
        }
    }
    auto result = unseen::meshio::read_mesh_bytes(bytes, name, options);
    if (!result) {
        if (result.error().message.empty()) std::abort();
        return false;
    }
    if (result->document && result->document->format == unseen::meshio::SourceDocument::Format::table)
        result->mesh.further = unseen::meshio::further_values(*result->document); // of others once materials are laid
    const bool is_mesh = !result->mesh.triangles.empty() && unseen::vdtree::validate(result->mesh.view());
    if (!is_mesh || !unseen::meshio::examine(result->mesh.view())) std::abort();
    return is_accepted;
}
