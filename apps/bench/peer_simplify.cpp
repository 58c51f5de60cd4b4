#include "peer_simplify.h"

#include <vector>

#ifdef UNSEEN_BENCH_WITH_MESHOPTIMIZER
#include <meshoptimizer.h>
#endif

namespace unseen::app {

#ifdef UNSEEN_BENCH_WITH_MESHOPTIMIZER
bool has_meshoptimizer() { return true; }

vdtree::Mesh simplified_by_meshoptimizer(const vdtree::Mesh& mesh, std::size_t triangles, bool whatever_it_takes) {
    const std::vector<glm::vec3> positions(mesh.positions.begin(), mesh.positions.end());
    constexpr float any_error = 1e9f;
    const std::size_t corners = 3 * mesh.triangles.size();
    std::vector<unsigned> out(corners);
    out.resize(meshopt_simplify(out.data(), mesh.triangles[0].data(), corners, &positions[0].x, positions.size(),
                                sizeof(glm::vec3), 3 * triangles, any_error));
    constexpr double close_enough = 1.1; // of the triangles wished for
    if (whatever_it_takes && static_cast<double>(out.size()) > close_enough * 3 * static_cast<double>(triangles)) {
        out.resize(corners);
        out.resize(meshopt_simplifySloppy(out.data(), mesh.triangles[0].data(), corners, &positions[0].x,
                                          positions.size(), sizeof(glm::vec3), 3 * triangles, any_error, nullptr));
    }
    // Only vertices that are in use.
    std::vector<unsigned> remap(positions.size());
    const std::size_t used = meshopt_optimizeVertexFetchRemap(remap.data(), out.data(), out.size(), positions.size());
    vdtree::Mesh simple;
    const auto keep = [&](const auto& from, auto& to) {
        if (from.empty()) return;
        to.resize(used);
        for (std::size_t v = 0; v < remap.size(); ++v)
            if (remap[v] != ~0u) to[remap[v]] = from[v];
    };
    keep(mesh.positions, simple.positions);
    keep(mesh.normals, simple.normals);
    keep(mesh.colours, simple.colours);
    keep(mesh.uvs, simple.uvs);
    simple.texture = mesh.texture;
    for (std::size_t i = 0; i < out.size(); i += 3)
        simple.triangles.push_back({remap[out[i]], remap[out[i + 1]], remap[out[i + 2]]});
    return simple;
}
#else
bool has_meshoptimizer() { return false; }
vdtree::Mesh simplified_by_meshoptimizer(const vdtree::Mesh& mesh, std::size_t, bool) { return mesh; }
#endif

} // namespace unseen::app
