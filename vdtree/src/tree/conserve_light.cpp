#include <unseen/vdtree/internal/conserve_light.h>

#include <cmath>
#include <numeric>

#include <unseen/vdtree/internal/fold_sequence.h>

namespace unseen::vdtree {

namespace {

// Share of the area around a proxy that must face the same way; with less, its luminance has no sure effect.
constexpr float least_facing = 0.2f;

class Conservation {
public:
    explicit Conservation(const SoundTree& tree)
        : tree_(tree), interior_(tree.interior_count()), luminance_(tree.luminance().begin(), tree.luminance().end()),
          mesh_(tree), missing_(interior_) {}

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
            packed[node] =
                node < interior_ ? Unorm16::nearest(static_cast<double>(luminance_[node])) : tree_.luminance()[node];
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
        for (const Index t : mesh_.ring(node))
            kept += luminance_of(mesh_.corners(t)) * mesh_.vector_area(mesh_.corners(t));
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

    const SoundTree& tree_;
    NodeId interior_;
    std::vector<float> luminance_;
    FoldSequence mesh_;
    std::vector<glm::vec3> missing_; // light that the luminances of the ring could not make good
};

void include_proxies(const SoundTree& tree, std::span<const Unorm16> luminance, std::span<PackedRange> support) {
    for (NodeId node = tree.interior_count(); node-- > 0;) { // children before parents
        support[node] = unite(support[node], PackedRange{luminance[node], luminance[node]});
        if (node > 0) support[tree.parents()[node]] = unite(support[tree.parents()[node]], support[node]);
    }
}

} // namespace

Result<VertexTree> conserve_light(const VertexTree& tree) {
    const auto sound = SoundTree::of(tree);
    if (!sound) return sound.error();
    if (!tree.texture().empty())
        return Error{ErrorCode::unsupported,
                     "What light a texture radiates is not conserved: take the tree without its texture."};
    const VertexTree::Data& given = tree.data();
    const auto data = std::make_shared<VertexTree::Data>();
    const auto light = std::make_shared<TreeLuminance>(copy_of(*given.light));
    data->light = light;
    // In units in which no product of areas overflows or vanishes.
    const float scale = unit_scale(tree.bounding_sphere().radius);
    data->geometry = scale == 1 ? given.geometry : scaled_geometry(given.geometry, scale);
    const auto scaled = SoundTree::of(VertexTree(data)); // nobody else has it
    if (!scaled) return scaled.error();
    std::vector<Unorm16> luminance = Conservation(*scaled).run();
    data->geometry = given.geometry;

    std::vector<PackedRange> support(light->support_range.begin(), light->support_range.end());
    include_proxies(*sound, luminance, support);
    light->support_range = std::move(support);
    light->luminance = std::move(luminance);
    return VertexTree(data);
}

} // namespace unseen::vdtree
