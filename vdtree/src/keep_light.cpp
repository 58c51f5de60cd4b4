// The light of a patch of surface, from a direction that it faces, is the sum over its triangles of their luminance times their vector
// area, times the direction.
#include "keep_light.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <glm/geometric.hpp>

#include "fold_sequence.h"

namespace unseen::vdtree {

namespace {

// Of the area around a proxy that must face the same way; where less does, its luminance has no sure effect.
constexpr float least_facing = 0.2f;

class LightKeeper {
public:
    explicit LightKeeper(const VertexTree& tree)
        : tree_(tree), interior_(tree.interior_count()), luminance_(tree.luminance().begin(), tree.luminance().end()), mesh_(tree),
          missing_(interior_) {}

    std::vector<Unorm16> run() {
        const auto support = tree_.support_spheres();
        std::vector<NodeId> sequence(interior_);
        std::iota(sequence.begin(), sequence.end(), NodeId{0});
        std::sort(sequence.begin(), sequence.end(), [&](NodeId a, NodeId b) {
            return support[a].radius != support[b].radius ? support[a].radius < support[b].radius : a > b;
        });
        for (const NodeId node : sequence) fold(node);
        std::vector<Unorm16> packed(luminance_.size());
        for (NodeId node = 0; node < tree_.node_count(); ++node)
            packed[node] = node < interior_ ? Unorm16::nearest(static_cast<double>(luminance_[node])) : tree_.luminance()[node];
        return packed;
    }

private:
    void fold(NodeId node) {
        glm::vec3 light(0); // to be kept
        tree_.for_each_child(node, [&](NodeId child) {
            if (!tree_.is_leaf(child)) light += missing_[child];
        });
        mesh_.fold(node, [&](const Triangle& t) { light += luminance_of(t) * mesh_.vector_area(t); });
        if (tree_.support_spheres()[node].radius > 0) choose(node, light);
        glm::vec3 kept(0);
        for (const Index t : mesh_.ring(node)) kept += luminance_of(mesh_.corners(t)) * mesh_.vector_area(mesh_.corners(t));
        missing_[node] = light - kept;
    }

    void choose(NodeId node, const glm::vec3& light) {
        glm::vec3 area(0), others(0); // vector area; light of the other corners
        float total = 0;
        for (const Index t : mesh_.ring(node)) {
            const Triangle& at = mesh_.corners(t);
            const glm::vec3 of_triangle = mesh_.vector_area(at);
            area += of_triangle;
            total += glm::length(of_triangle);
            float sum = 0;
            for (const NodeId corner : at) sum += corner == node ? 0 : luminance_[corner];
            others += sum / 3 * of_triangle;
        }
        const float facing = glm::length(area);
        if (!(facing > least_facing * total)) return;
        const float wanted = 3 * glm::dot(light - others, area) / (facing * facing);
        if (!std::isfinite(wanted)) return;
        const LuminanceRange ring = tree_.ring_luminance()[node];
        luminance_[node] = std::clamp(wanted, ring.lo, ring.hi);
    }

    float luminance_of(const Triangle& t) const { return (luminance_[t[0]] + luminance_[t[1]] + luminance_[t[2]]) / 3; }

    const VertexTree& tree_;
    NodeId interior_;
    std::vector<float> luminance_;
    FoldSequence mesh_;
    std::vector<glm::vec3> missing_; // light that the luminances of the ring could not make good
};

} // namespace

std::vector<Unorm16> light_keeping_luminance(const VertexTree& tree) { return LightKeeper(tree).run(); }

} // namespace unseen::vdtree
