// Clusterers without a tree: their input made from a mesh, and cuts of their hierarchy by deviation.
#pragma once

#include <algorithm>
#include <vector>

#include <unseen/vdtree/builder.h>

#include "build/leaves.h"
#include "build/surface.h"
#include <unseen/vdtree/internal/vertex_tree_data.h>

namespace unseen::support {

// What build_tree() would hand to a clusterer. The mesh must stay.
struct ClusteringTask {
    explicit ClusteringTask(const vdtree::Mesh& mesh)
        : view(mesh.view()), places(view), surface(vdtree::analyse_surface(places.mesh())) {
        places.find_leaves(surface);
        for (vdtree::Index leaf = 0; leaf < places.leaf_count(); ++leaf) {
            const vdtree::Index v = places.sources()[leaf];
            if (!view.colours.empty()) colours.push_back(view.colours[v]);
            if (!view.uvs.empty()) uvs.push_back(view.uvs[v]);
            luminance.push_back(vdtree::vertex_luminance(places.normals()[leaf],
                                                         colours.empty() ? nullptr : &colours.back(), {}, false));
        }
        for (vdtree::Index place = 0; place < places.mesh().positions.size(); ++place)
            place_luminance.push_back(luminance[places.first_leaf(place)]);
    }
    vdtree::ClusterInput input() const {
        return {places.mesh(),
                place_luminance,
                surface.normals,
                surface.areas,
                {places.triangles(), places.places(), luminance, places.normals(), colours, uvs, places.materials(),
                 !view.normals.empty()}};
    }

    vdtree::MeshView view;
    vdtree::PlaceMesh places;
    vdtree::Surface surface;
    std::vector<float> luminance, place_luminance;
    std::vector<glm::vec4> colours;
    std::vector<glm::vec2> uvs;
};

// The mesh with every cluster that deviates by at most `deviation` folded.
inline vdtree::Mesh folded(const vdtree::MeshView& mesh, const vdtree::Clustering& clustering, float deviation) {
    using vdtree::Index;
    const std::size_t vertices = mesh.positions.size(), clusters = clustering.parents.size();
    std::vector<Index> stands_for(clusters);
    for (std::size_t c = clusters; c-- > 0;) {
        const Index parent = clustering.parents[c];
        const bool folds = parent != c && clustering.deviations[parent - vertices] <= deviation;
        stands_for[c] = folds ? stands_for[parent] : static_cast<Index>(c);
    }
    vdtree::Mesh out;
    out.positions.assign(mesh.positions.begin(), mesh.positions.end());
    out.positions.insert(out.positions.end(), clustering.positions.begin(), clustering.positions.end());
    for (const vdtree::Triangle& t : mesh.triangles) {
        const vdtree::Triangle now = {stands_for[t[0]], stands_for[t[1]], stands_for[t[2]]};
        if (now[0] != now[1] && now[1] != now[2] && now[2] != now[0]) out.triangles.push_back(now);
    }
    return out;
}

// The mesh of the least deviation with at most so many triangles.
inline vdtree::Mesh simplified_by_deviation(const vdtree::MeshView& mesh, const vdtree::Clustering& clustering,
                                            std::size_t triangles) {
    std::vector<float> levels = clustering.deviations;
    std::sort(levels.begin(), levels.end());
    const auto level = std::partition_point(levels.begin(), levels.end(), [&](float deviation) {
        return folded(mesh, clustering, deviation).triangles.size() > triangles;
    });
    return folded(mesh, clustering, level == levels.end() ? levels.back() : *level);
}

} // namespace unseen::support
