// A glTF file with two levels of detail, quantized and compressed.
#pragma once

#include <stdexcept>
#include <string>

#include <unseen/meshio/scene_file.h>
#include <unseen/vdtree/cut.h>

#include "built.h"
#include "shapes.h"
#include "temp_folder.h"

namespace mesh_files {

// 80 triangles, and fewer. Empty where the library meshoptimizer is missing.
inline std::string compressed_glb() {
    using namespace unseen;
    if (!meshio::has_meshoptimizer()) return {};
    const vdtree::VertexTree tree = support::built(shapes::with_attributes(shapes::icosphere(1)));
    vdtree::Cut full(tree), coarse(tree);
    full.unfold_all();
    coarse.unfold_all();
    for (vdtree::NodeId node = tree.interior_count(); node-- > tree.interior_count() / 2;) coarse.fold(node);
    meshio::LevelCuts levels;
    levels.cuts = {&full, &coarse};
    levels.coverages = {0.1, 0};
    const support::TempFolder folder;
    const auto written =
        meshio::write_model_levels(folder.path() / "levels.glb", levels, {.quantize = true, .meshopt = true});
    if (!written) throw std::runtime_error(written.error().message);
    return support::read_bytes(folder.path() / "levels.glb");
}

} // namespace mesh_files
