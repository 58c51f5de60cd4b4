// Trees from files, with what the session needs to know of where they are from.
#pragma once

#include <optional>
#include <set>

#include <unseen/perception/internal/lit_folds.h>
#include <unseen/session/scene.h>
#include <unseen/vdtree/builder.h>

namespace unseen::session {

// Larger trees are measured only where somebody asks for that. Interior nodes; about a minute on one core.
inline constexpr vdtree::NodeId most_measured = 2'000'000;

// Says texts about a file, if anybody listens.
template <class Tell, class Texts>
void tell(const Tell& to, const std::filesystem::path& file, const Texts& texts) {
    if (to)
        for (const auto& text : texts) to(file.string() + ": " + text);
}

// "kept in FOLDER for the next time".
Message kept_in(const TreeCache& cache);

// Where what is measured of a tree is kept.
struct MeasurementPlace {
    TreeCache cache;
    std::string key; // of the file's tree
    std::filesystem::path file;
    vdtree::VertexTree tree; // that this is of: an object's tree may have become another one
    // Under the key stands, or is to stand, the tree with what its folds change under its own light. Not of meshes:
    // there stands what was built, whether it was measured or not.
    bool is_of_tree_file = true;
};

struct LoadedTree {
    vdtree::VertexTree tree;
    TreeOrigin origin;
    std::shared_ptr<const MeasurementPlace> measurement = {}; // null: nothing of it is kept
};

// load_tree(); where `may_map`, tree files of 256 MiB and more are mapped: only what is used is read, and checked.
Result<LoadedTree> load(const std::filesystem::path& file, const LoadOptions& options, bool may_map);

// A tree that was just built, measured or with its light conserved as the options say, unless it is too large for that.
Result<vdtree::VertexTree> measured_as_asked(vdtree::VertexTree tree, const LoadOptions& options,
                                             const Progress& progress);

// Null where nothing is kept.
std::shared_ptr<const MeasurementPlace> place_of_mesh(const TreeCache& cache, const std::string& key,
                                                      const std::filesystem::path& file,
                                                      const vdtree::VertexTree& tree);

// measured(), or what is kept of it. `place` may be null, else it is a tree file's.
Result<vdtree::VertexTree> measured_once(const vdtree::VertexTree& tree, const MeasurementPlace* place,
                                         const Messages& messages);

// What a tree's folds change under lights: what the tree has of it, or what is kept, else measured now and kept.
// `place` may be null. `takes_long`: a note says so before it is measured.
Result<perception::LitFolds> measured_under_lights_once(const vdtree::VertexTree& tree, const MeasurementPlace* place,
                                                        const Messages& messages, bool takes_long);

// For the meshes of a scene: protect() without the complaint, and the complaint about materials that none of them has.
Result<void> find_weights(meshio::ReadResult& read, std::span<const Protection> what);
Result<void> check_protected(const std::set<std::string>& materials, std::span<const Protection> what);

// ---- what a tree is kept under

// A hash of all that the tree of a file depends on: the bytes of the file and of those it refers to (libraries of
// materials, images, buffers), the options, and how trees are built and measured. Nothing for what is no regular file,
// and where it is not sure what the file refers to. Cost: reading the files once.
std::optional<std::string> cache_key(const std::filesystem::path& file, const LoadOptions& options);

// The key of the tree of a mesh that was read, with its texture and document.
std::string mesh_cache_key(const vdtree::Mesh& mesh, const vdtree::BuildOptions& building, bool measures,
                           bool conserves_light);

// The key of what a tree's folds change under lights, whichever these are. `key`: the tree's.
std::string lights_key(const std::string& key);

// ---- scenes

// The scene of a file that SceneFile has read; see Scene::load().
Result<Scene> scene_from(meshio::SceneFile file, const std::filesystem::path& name, const LoadOptions& options);

} // namespace unseen::session
