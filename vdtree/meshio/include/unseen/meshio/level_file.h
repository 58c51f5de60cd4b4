// Levels of detail in one glTF file, by the extension MSFT_lod: a node with the finest mesh names the nodes with the
// others, and says in its extras (MSFT_screencoverage) down to which share of the screen each is shown. Readers that do
// not know the extension show the finest. And glTF files made small.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include <unseen/meshio/scene_file.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/result.h>

namespace unseen::meshio {

// How numbers are stored. Readers must know the extensions then, as this library's own does.
struct GltfOptions {
    // KHR_mesh_quantization: positions on a grid of 65,535 steps along the mesh's longest side, normals, colours and texture
    // coordinates within 0..1 in 16 bits. Half to two thirds of the bytes.
    bool quantize = false;
    // EXT_meshopt_compression, of vertices and indices, which are put into an order that suits graphics cards. Fails
    // without the library meshoptimizer.
    bool meshopt = false;
};

bool has_meshoptimizer() noexcept; // whether this build does

// What one node shows, level by level.
struct LevelCuts {
    std::int32_t node = -1, mesh = 0;     // of a scene; see SceneCut
    std::vector<const vdtree::Cut*> cuts; // the finest first; not empty. Equal pointers of a mesh are written once
    std::vector<double> coverages;        // by cut: shares of the screen's area, 0..1, descending
};

struct LevelsWritten {
    std::vector<Message> notes;       // what could not be kept, one sentence each
    std::vector<std::uint64_t> bytes; // by level: of all its geometry; of a geometry that levels share, the first's
};

// As write_scene(), with a node for each further level, which has the transform of the first one and stands in no scene.
// A node that is more than a mesh gets a child for its levels. Fails, too, on cuts without triangles below the first.
Result<LevelsWritten> write_scene_levels(const std::filesystem::path& file, const SceneSource& source,
                                         std::span<const LevelCuts> levels, const GltfOptions& options = {});

// As write_cut() to glTF. The levels are of the whole model: a root above the nodes of the first one, and one for each
// other level above nodes in the world's frame. Of `levels`, node and mesh do not count.
Result<LevelsWritten> write_model_levels(const std::filesystem::path& file, const LevelCuts& levels,
                                         const GltfOptions& options = {});

} // namespace unseen::meshio
