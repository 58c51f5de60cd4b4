// Fuzz target for the readers of meshes, scenes and materials: any bytes may come in, and only a valid mesh or an error
// may come out.
// tests/README.md tells how to build and run it. With other compilers than clang define UNSEEN_FUZZ_STANDALONE for a
// main() that runs the files named on the command line.
#include "mesh_readers.h"

#include <unseen/meshio/examine.h>
#include <unseen/meshio/scene_file.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <iterator>
#include <set>
#include <string>
#include <string_view>

namespace {

// Formats without a signature go by the name's ending; the first byte chooses it.
constexpr const char* names[] = {"fuzz.ply", "fuzz.obj", "fuzz.off", "fuzz.stl", "fuzz.gltf",
                                 "fuzz",     "fuzz.vtp", "fuzz.vtk", "fuzz.mtl"};

// Materials lie beside an OBJ file; no folder is read here, and so they come by themselves.
void read_materials(std::string_view bytes, const char* name) {
    unseen::meshio::MtlContents contents;
    const auto read = unseen::meshio::read_mtl(bytes, name, true, contents);
    if (!read && read.error().message.empty()) std::abort();
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0) return 0;
    const std::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
    const char* const name = names[data[0] % std::size(names)];
    if (std::string_view(name).ends_with(".mtl")) {
        read_materials(bytes, name);
        return 0;
    }
    unseen::meshio::ReadOptions options;
    options.skip_bad = data[0] >= 128;
    if (std::string_view(name).ends_with(".gltf")) { // as a scene, too
        auto scene = unseen::meshio::SceneFile::from_bytes(std::string(bytes), name, options);
        if (!scene && scene.error().message.empty()) std::abort();
        std::set<std::int32_t> meshes;
        if (scene)
            for (const auto& node : scene->contents().nodes) meshes.insert(node.mesh);
        for (const std::int32_t mesh : meshes) {
            const auto read = scene->mesh(static_cast<std::size_t>(mesh));
            if (read && *read && !unseen::vdtree::validate((*read)->mesh.view())) std::abort();
        }
    }
    const auto result = unseen::meshio::read_mesh_bytes(bytes, name, options);
    if (!result) {
        if (result.error().message.empty()) std::abort();
        return 0;
    }
    const bool is_mesh = !result->mesh.triangles.empty() && unseen::vdtree::validate(result->mesh.view());
    if (!is_mesh || !unseen::meshio::examine(result->mesh.view())) std::abort();
    return 0;
}

#ifdef UNSEEN_FUZZ_STANDALONE
#include <fstream>
#include <iterator>
#include <string>

int main(int count, char** files) {
    for (int i = 1; i < count; ++i) {
        std::ifstream stream(files[i], std::ios::binary);
        const std::string bytes{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
        LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
    }
    return 0;
}
#endif
