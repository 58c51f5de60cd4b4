#include <unseen/vdtree/internal/conserve_light.h>

#include <cmath>
#include <numeric>

#include <unseen/vdtree/internal/fold_sequence.h>

namespace unseen::vdtree {

namespace {

// Share of the area around a proxy that must face the same way; with less, its luminance has no sure effect.
constexpr float least_facing = 0.2f;

void include(LuminanceRange& range, float luminance) {
    range = {std::min(range.lo, luminance), std::max(range.hi, luminance)};
}

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
        mesh_.fold_all(sequence, [&](NodeId node) { fold(node); });
        std::vector<Unorm16> packed(luminance_.size());
        for (WedgeId w = 0; w < tree_.wedge_count(); ++w)
            packed[w] = w < tree_.interior_wedge_count() ? Unorm16::nearest(static_cast<double>(luminance_[w]))
                                                         : tree_.luminance()[w];
        return packed;
    }

private:
    void fold(NodeId node) {
        glm::vec3 light(0); // to be kept
        tree_.for_each_child(node, [&](NodeId child) {
            if (!tree_.is_place(child)) light += missing_[child];
        });
        mesh_.fold(node, [&](Index t) { light += luminance_of(t) * mesh_.vector_area(t); });
        if (tree_.support_spheres()[node].radius > 0) choose(node, light);
        glm::vec3 kept(0);
        for (const Index t : mesh_.ring(node)) kept += luminance_of(t) * mesh_.vector_area(t);
        missing_[node] = light - kept;
    }

    // Several wedges get brighter or darker by the same amount, each only within what its own triangles show: flat faces
    // that meet at a hard edge stay as they are.
    void choose(NodeId node, const glm::vec3& light) {
        const WedgeId first = tree_.first_wedge(node), end = tree_.wedge_end(node);
        const bool is_single = end - first == 1;
        glm::vec3 area(0), others(0); // vector area; light of the other corners, and of those that stay with the node
        float total = 0;
        shown_.assign(end - first, {1, 0});
        for (const Index t : mesh_.ring(node)) {
            const glm::vec3 of_triangle = mesh_.vector_area(t);
            area += of_triangle;
            total += glm::length(of_triangle);
            const std::array<WedgeId, 3> wedges = mesh_.wedges(t);
            float sum = 0;
            for (std::size_t k = 0; k < 3; ++k) {
                const bool is_of_node = mesh_.corners(t)[k] == node;
                sum += is_single && is_of_node ? 0 : luminance_[wedges[k]];
                if (is_of_node && !is_single)
                    for (const WedgeId w : wedges) include(shown_[wedges[k] - first], luminance_[w]);
            }
            others += sum / 3 * of_triangle;
        }
        const float facing = glm::length(area);
        if (!(facing > least_facing * total)) return;
        const float wanted = 3 * glm::dot(light - others, area) / (facing * facing);
        if (!std::isfinite(wanted)) return;
        const LuminanceRange ring = tree_.ring_luminance()[node];
        if (is_single) luminance_[first] = std::clamp(wanted, ring.lo, ring.hi);
        else
            for (WedgeId w = first; w < end; ++w)
                if (const LuminanceRange shown = shown_[w - first]; shown.lo <= shown.hi)
                    luminance_[w] = std::clamp(luminance_[w] + wanted, shown.lo, shown.hi);
    }

    float luminance_of(Index triangle) const {
        const auto [a, b, c] = mesh_.wedges(triangle);
        return (luminance_[a] + luminance_[b] + luminance_[c]) / 3;
    }

    const SoundTree& tree_;
    NodeId interior_;
    std::vector<float> luminance_;
    FoldSequence mesh_;
    std::vector<LuminanceRange> shown_; // by the triangles at each wedge of the node that folds
    std::vector<glm::vec3> missing_;    // light that the luminances of the ring could not make good
};

void include_proxies(const SoundTree& tree, std::span<const Unorm16> luminance, std::span<PackedRange> support) {
    for (NodeId node = tree.interior_count(); node-- > 0;) { // children before parents
        for (WedgeId w = tree.first_wedge(node); w < tree.wedge_end(node); ++w)
            support[node] = unite(support[node], PackedRange{luminance[w], luminance[w]});
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
