// What no eye near a picture's sees of a scene's objects.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <unseen/vdtree/occlusion_map.h>

namespace unseen::session {

class Session;

// Handles to an object's tree and its place, for work on another thread than the session's.
struct PlacedTree {
    vdtree::VertexTree tree;
    vdtree::Similarity placement;
};
std::vector<PlacedTree> placed_trees(const Session& session); // by object

// Of all objects. Valid while the session has these trees, and nothing of the scene moves. See Request::hidden.
class HiddenNodes {
public:
    // From any thread. Fails where vdtree::find_hidden() does. Cost: that of all objects.
    static Result<HiddenNodes> find(std::span<const PlacedTree> objects, vdtree::OcclusionMap map);

    const vdtree::OcclusionMap& map() const noexcept { return map_; }
    bool holds_for(glm::dvec3 eye) const noexcept { return map_.holds_for(eye); }
    // A bit a node, see vdtree::Viewpoint::hidden; null: none, or the tree is another one by now.
    std::shared_ptr<const std::vector<std::uint64_t>> of(std::size_t object,
                                                         const vdtree::VertexTree& tree) const noexcept;
    std::size_t touched() const noexcept; // objects of which something is hidden

private:
    struct Found {
        vdtree::VertexTree tree; // a handle: so no other tree comes to its address
        std::shared_ptr<const std::vector<std::uint64_t>> nodes;
    };
    HiddenNodes(vdtree::OcclusionMap map, std::vector<Found> found) : map_(std::move(map)), found_(std::move(found)) {}

    vdtree::OcclusionMap map_;
    std::vector<Found> found_;
};

} // namespace unseen::session
