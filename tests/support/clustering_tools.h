// Clusterers without a tree: their input made from a mesh, and cuts of their hierarchy by deviation.
#pragma once

#include <algorithm>
#include <vector>

#include <unseen/vdtree/builder.h>

#include "build/surface.h"
#include <unseen/vdtree/internal/vertex_tree_data.h>

namespace unseen::support {

// What build_tree() would hand to a clusterer. The mesh must stay; it has no degenerate triangles or unused vertices.
struct ClusteringTask {
    explicit ClusteringTask(const vdtree::Mesh& mesh)
        : view(mesh.view()), coincident(vdtree::find_coincident(view.positions)),
          surface(vdtree::analyse_surface(view, coincident)) {
        for (std::size_t v = 0; v < view.positions.size(); ++v)
            luminance.push_back(vdtree::vertex_luminance(surface.normals[v],
                                                         view.colours.empty() ? nullptr : &view.colours[v], {}, false));
    }
    vdtree::ClusterInput input() const { return {view, luminance, surface.normals, surface.areas, coincident}; }

    vdtree::MeshView view;
    std::vector<vdtree::Index> coincident;
    vdtree::Surface surface;
    std::vector<float> luminance;
};

// The mesh with every cluster that deviates by at most `deviation` folded.
inline vdtree::Mesh folded(const vdtree::Mesh& mesh, const vdtree::Clustering& clustering, float deviation) {
    using vdtree::Index;
    const std::size_t vertices = mesh.positions.size(), clusters = clustering.parents.size();
    std::vector<Index> stands_for(clusters);
    for (std::size_t c = clusters; c-- > 0;) {
        const Index parent = clustering.parents[c];
        const bool folds = parent != c && clustering.deviations[parent - vertices] <= deviation;
        stands_for[c] = folds ? stands_for[parent] : static_cast<Index>(c);
    }
    vdtree::Mesh out;
    out.positions = mesh.positions;
    out.positions.insert(out.positions.end(), clustering.positions.begin(), clustering.positions.end());
    for (const vdtree::Triangle& t : mesh.triangles) {
        const vdtree::Triangle now = {stands_for[t[0]], stands_for[t[1]], stands_for[t[2]]};
        if (now[0] != now[1] && now[1] != now[2] && now[2] != now[0]) out.triangles.push_back(now);
    }
    return out;
}

// The mesh of the least deviation with at most so many triangles.
inline vdtree::Mesh simplified_by_deviation(const vdtree::Mesh& mesh, const vdtree::Clustering& clustering,
                                            std::size_t triangles) {
    std::vector<float> levels = clustering.deviations;
    std::sort(levels.begin(), levels.end());
    const auto level = std::partition_point(levels.begin(), levels.end(), [&](float deviation) {
        return folded(mesh, clustering, deviation).triangles.size() > triangles;
    });
    return folded(mesh, clustering, level == levels.end() ? levels.back() : *level);
}

} // namespace unseen::support
