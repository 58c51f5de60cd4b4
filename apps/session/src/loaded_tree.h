// Trees from files, with what the session needs to know of where they are from.
#pragma once

#include <memory>

#include <session/model_file.h>
#include <session/scene.h>
#include <session/tree_cache.h>

namespace unseen::session {

// Larger trees are measured only where somebody asks for that. Interior nodes; about a minute on one core.
inline constexpr vdtree::NodeId most_measured = 2'000'000;

// Where the measurement of a tree file's tree is kept.
struct MeasurementPlace {
    TreeCache cache;
    std::string key;
    std::filesystem::path file;
    vdtree::VertexTree tree; // that this is of: an object's tree may have become another one
};

struct LoadedTree {
    vdtree::VertexTree tree;
    TreeOrigin origin;
    std::shared_ptr<const MeasurementPlace> measurement = {}; // null: it has one, or is kept nowhere
};

// open_tree() where `may_map`, else load_tree().
Result<LoadedTree> load(const std::filesystem::path& file, const LoadOptions& options, bool may_map);

// measured(), or what is kept of it. `place` may be null.
Result<vdtree::VertexTree> measured_once(const vdtree::VertexTree& tree, const MeasurementPlace* place,
                                         const Messages& messages);

} // namespace unseen::session
