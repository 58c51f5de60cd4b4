// Models from files: trees, or meshes with their textures, of which trees are built on the fly and cached.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <unseen/meshio/mesh_file.h>
#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::session {

// How a program hears from the library, which prints nothing. Called on the calling thread, during the call that has
// something to say. Each may be empty.
struct Messages {
    Callback<void(const Message&)> note = {};    // something takes long, and how to avoid that
    Callback<void(const Message&)> warning = {}; // something is odd, and how it was treated
    Progress progress = {};                      // of reading, then building, then measuring; false cancels
};

// ---- trees that were built before

// Error messages call these fields load.cache.
struct CacheOptions {
    bool is_off = false;
    // Empty: $UNSEEN_CACHE ("off": no cache), else $XDG_CACHE_HOME/unseen, else $HOME/.cache/unseen, else no cache.
    std::filesystem::path folder = {};
    std::uint64_t most_bytes = 0; // 0: $UNSEEN_CACHE_SIZE if that is a size, else 4 GiB
};

// "500M": bytes, or with K, M, G or T, those times 1024, 1024^2 and so on. Fails on 0 and on anything else.
Result<std::uint64_t> parse_size(const std::string& text);

struct CachedTree {
    std::filesystem::path file;
    std::string source; // the name of the mesh file, without its folder
    std::uint64_t bytes = 0;
    std::chrono::system_clock::time_point last_use = {};
};

// A folder of tree files. The name of each is a hash of everything that its tree depends on. Several processes may use
// one folder: files appear whole, and a file that is removed while it is read stays readable.
class TreeCache {
public:
    explicit TreeCache(const CacheOptions& options = {});

    bool is_on() const noexcept { return !folder_.empty(); }
    const std::filesystem::path& folder() const noexcept { return folder_; }
    std::uint64_t most_bytes() const noexcept { return most_bytes_; }

    // Fails if $UNSEEN_CACHE_SIZE is not a size, or if the folder is a file.
    Result<void> check() const;

    // The tree of a key, read and checked to the last byte; it counts as used now. Empty if there is none. Removes
    // files that are damaged or whose tree was kept under another key. Fails only if `progress` cancels.
    Result<std::optional<vdtree::VertexTree>> find(const std::string& key, const Progress& progress = {}) const;

    // Keeps a tree. Removes the least recently used ones if there are more bytes than most_bytes(). Fails if the folder
    // cannot be made or written to, or if the tree alone is larger. `source`: the mesh file. Precondition: is_on().
    Result<void> keep(const std::string& key, const std::filesystem::path& source,
                      const vdtree::VertexTree& tree) const;

    // The last used tree first.
    std::vector<CachedTree> trees() const;
    // Removes the least recently used trees until at most `most_bytes` are left; 0: all trees. Returns the removed
    // ones.
    std::vector<CachedTree> shrink(std::uint64_t most_bytes) const;

private:
    struct Listing;
    std::vector<std::filesystem::path> files_of(const std::string& key) const;
    void note(const std::string& key, const std::filesystem::path& file) const;

    std::filesystem::path folder_; // empty: off
    std::uint64_t most_bytes_;
    std::shared_ptr<Listing> listing_; // of copies, too: a scene of many meshes looks at the folder once
};

// ---- files

// What a glTF file becomes. `model`: one tree of everything that its nodes show. `scene`: a tree for each mesh, placed
// by the nodes. `automatic`: a scene if meshio::SceneContents::is_scene says so.
enum class LoadAs { model, scene, automatic };

// What of a mesh is to be kept more than the rest, see vdtree::MeshView::weights.
struct Protection {
    // Its borders, the triangles of the material `name`, or vertices as the text file `name` says: a number a line for each
    // vertex of the mesh's file, in its order, from 0 (as usual) to 1 (by the whole weight).
    enum class Kind { borders, material, vertices };
    Kind kind = Kind::borders;
    std::string name = {};
    float weight = vdtree::never_folds;
};
// Finds the mesh's weights. Fails on materials that it has not, and on files that are missing, malformed, or of other
// numbers of vertices. Borders are the builder's: border_weight() is its option.
Result<void> protect(meshio::ReadResult& read, std::span<const Protection> what);
float border_weight(std::span<const Protection> what);

// Error messages and reasons call these fields load.texture and so on.
struct LoadOptions {
    LoadAs as = LoadAs::automatic; // for Scene::load(); trees and files of other formats are models
    // An image that replaces those of the mesh's materials, or a folder in which these are looked for, too
    // (meshio::ReadOptions::search_folder).
    std::filesystem::path texture = {};
    bool without_textures = false;      // ignore images; colours of materials still count
    meshio::LeftOut drop = {};          // what glTF files may have and trees cannot
    bool skip_bad = false, weld = true; // see meshio::ReadOptions
    // The colours and textures of the mesh contain light; they are not reflectance. See vdtree::BuildOptions. For
    // meshes only: tree files know it.
    bool prelit = false;
    std::optional<float> crease = {};     // degrees, for meshes; see vdtree::BuildOptions
    std::vector<Protection> protect = {}; // of meshes; in scenes borders and materials
    double unit_metres = 1;               // world units (metres) in a mesh unit; above 0. For Scene::load()
    // For meshes: measure what folds change (see measured()), if the tree has at most two million folds.
    bool measures = true;
    bool conserves_light = false; // for meshes: the light of a measured tree, even if nothing is measured
    CacheOptions cache = {};      // for trees of meshes and for measurements
    Messages messages = {};
};

// A mesh with its texture. The textures of several materials are put side by side in one, and the colours of materials
// become those of the vertices. Images are PNG, JPEG, PFM or EXR. Errors name the file and what is wrong in it. The
// reader's warnings and notes become messages. Only the colours are not taken from `options` but from `reading`.
Result<meshio::ReadResult> read_textured_mesh(const std::filesystem::path& file, const LoadOptions& options = {},
                                              meshio::ReadOptions reading = {});

// The files that a mesh file names: libraries of materials, buffers, images. Also some that it only seems to name.
std::vector<std::filesystem::path> files_named_by(const std::filesystem::path& mesh);

// Where a tree comes from: made by the program, a tree file, just built, or built before and cached.
enum class TreeOrigin { given, file, built, cache };
std::string name_of(TreeOrigin origin);

// A tree file, read and checked to the last byte; or the tree of a mesh file. That is built and measured, which takes
// some ten seconds for a million triangles plus some 25 us a fold, or read from the cache. The reader's warnings come
// each time. If the cache cannot be written to, a note says so, and nothing else happens.
Result<vdtree::VertexTree> load_tree(const std::filesystem::path& file, const LoadOptions& options = {});

// A sentence for the user if a tree was not built as pre-lit and its colours look as if light were in them (see
// vdtree::find_baked_light()); else empty. load_tree() notes it when it builds a tree.
Message hint_at_baked_light(const vdtree::VertexTree& tree);

// A tree with the errors of its folds, which the fold test `error` needs. First the light of untextured trees is
// conserved, then the errors are measured. Cost: some 25 us a node, twice that with a texture, in parallel.
// `threads`: 0: all cores.
Result<vdtree::VertexTree> measured(const vdtree::VertexTree& tree, int threads = 0, const Progress& progress = {});

// A tree with what its folds change under any lights (perception::LitFolds), which `error` needs in scenes with lights.
// Without it, a session measures it when it first needs it, and caches it if the scene comes from a file. All other
// attributes stay. Fails where perception::LitFolds::measure() does, at that cost.
Result<vdtree::VertexTree> measured_under_lights(const vdtree::VertexTree& tree, int threads = 0,
                                                 const Progress& progress = {});

} // namespace unseen::session
