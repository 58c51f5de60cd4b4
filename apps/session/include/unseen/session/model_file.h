// Models from files: a tree, or a mesh with its textures, of which a tree is built on the fly.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <unseen/meshio/mesh_io.h>
#include <unseen/session/messages.h>
#include <unseen/session/tree_cache.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::session {

// What a glTF file becomes: one tree of all that its nodes show, or a tree for each mesh, placed by the nodes.
enum class LoadAs { model, scene, automatic }; // automatic: a scene where meshio::SceneContents::is_scene

// Error messages and reasons call these fields load.texture and so on.
struct LoadOptions {
    LoadAs as = LoadAs::automatic;      // for Scene::load(); trees and files of other formats are models
    std::filesystem::path texture = {}; // an image that lies over a mesh instead of its materials' images; empty: none
    bool without_textures = false;      // look at no images; colours of materials count all the same
    meshio::LeftOut drop = {};          // what glTF files may have that trees cannot
    bool skip_bad = false, weld = true; // see meshio::ReadOptions
    // A mesh's colours and textures are light that is baked in, not reflectance: see vdtree::BuildOptions. Not of trees.
    bool prelit = false;
    double unit_metres = 1; // world units (metres) a mesh unit; above 0. Of Scene::load()
    // Of a mesh: measure what folds change, too (see measured()), where its tree has at most two million folds
    // and `error` knows its texture (perception::knows_texture()).
    bool measures = true;
    bool conserves_light = false; // the same light as a measured tree, where nothing is measured
    CacheOptions cache = {};      // where trees of meshes, and measurements, are kept for the next time
    Messages messages = {};
};

// A mesh with its texture: those of several materials become one, side by side, and materials' colours become those of
// the vertices. Images are PNG, JPEG, PFM or EXR. Errors name the file, and what is wrong in it. The reader's warnings
// and notes are messages. Of `reading`, only the colours are not taken from the options.
Result<meshio::ReadResult> read_textured_mesh(const std::filesystem::path& file, const LoadOptions& options = {},
                                              meshio::ReadOptions reading = {});

// The files that a mesh's file names: libraries of materials, buffers, images. Also some that it only seems to name.
std::vector<std::filesystem::path> files_named_by(const std::filesystem::path& mesh);

// Where a tree comes from: made by the program, a tree file, just built, or built before and kept (TreeCache).
enum class TreeOrigin { given, file, built, cache };
std::string name_of(TreeOrigin origin);

// A tree file, read and checked to the last byte, or the tree of a mesh file: built and measured, which takes some ten
// seconds for a million triangles and some 50 us a fold, or read from the cache where the same mesh was built before
// with the same options. What the reader warns of is told only when the tree is built, and a note says where it is
// kept; a cache that cannot be written to costs nothing but that. A tree has its texture, and takes no other.
Result<vdtree::VertexTree> load_tree(const std::filesystem::path& file, const LoadOptions& options = {});

// The same, but tree files of 256 MiB and more are mapped: only what is used is read, and checked.
Result<vdtree::VertexTree> open_tree(const std::filesystem::path& file, const LoadOptions& options = {});

// What to tell the user where the colours of a tree that was not built as pre-lit look as if light were in them, by
// vdtree::find_baked_light(): a sentence, or nothing. load_tree() notes it where it builds a tree.
Message hint_at_baked_light(const vdtree::VertexTree& tree);

// A tree with what its folds change, which the fold test `error` goes by: light is conserved first, then measured.
// Of textured trees the light is not conserved. Cost: some 50 us a node, and a second; twice that with a texture; in
// parallel. `threads`: 0: all cores.
Result<vdtree::VertexTree> measured(const vdtree::VertexTree& tree, int threads = 0, const Progress& progress = {});

// A tree with what its folds change under lights, whichever these are (perception::LitFolds), which `error` goes by in
// scenes with lights. Without it a session measures it when it first needs to, and keeps it in the cache where the scene
// is of a file. Of other attributes none is lost. Fails where perception::LitFolds::measure() does, at that cost.
Result<vdtree::VertexTree> measured_under_lights(const vdtree::VertexTree& tree, int threads = 0,
                                                 const Progress& progress = {});

} // namespace unseen::session
