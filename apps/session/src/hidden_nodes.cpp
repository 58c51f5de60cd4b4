#include <unseen/session/hidden_nodes.h>

#include <algorithm>

#include <unseen/session/session.h>

namespace unseen::session {

std::vector<PlacedTree> placed_trees(const Session& session) {
    std::vector<PlacedTree> all;
    for (const Object& object : session.scene().objects) all.push_back({object.tree.share(), object.placement});
    return all;
}

Result<HiddenNodes> HiddenNodes::find(std::span<const PlacedTree> objects, vdtree::OcclusionMap map) {
    std::vector<Found> found;
    found.reserve(objects.size());
    for (const PlacedTree& object : objects) {
        auto nodes = vdtree::find_hidden(object.tree, object.placement, map);
        if (!nodes) return nodes.error();
        found.push_back({object.tree.share(), std::move(*nodes)});
    }
    return HiddenNodes(std::move(map), std::move(found));
}

std::shared_ptr<const std::vector<std::uint64_t>> HiddenNodes::of(std::size_t object,
                                                                  const vdtree::VertexTree& tree) const noexcept {
    if (object >= found_.size() || &found_[object].tree.data() != &tree.data()) return {};
    return found_[object].nodes;
}

std::size_t HiddenNodes::touched() const noexcept {
    return static_cast<std::size_t>(std::ranges::count_if(found_, [](const Found& f) { return f.nodes != nullptr; }));
}

} // namespace unseen::session
