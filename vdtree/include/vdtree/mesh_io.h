// Mesh files as triangle soups of any topology.
//
// Read: PLY (ASCII, both endians, face lists and triangle strips), OBJ, OFF, STL (ASCII and binary) and
// glTF 2.0 (.gltf, .glb), told apart by their content where it is unambiguous, else by the file name's ending.
// Write: PLY, OBJ, glTF binary, by ending.
//
// Nothing in a file is believed: every count is checked against the bytes that are there before memory is
// allocated for it, so memory stays proportional to the file. Errors name file, and line, byte or index.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <vdtree/function_ref.h>
#include <vdtree/mesh.h>
#include <vdtree/result.h>

namespace unseen::vdtree {

enum class ColourEncoding { srgb, linear };

struct ReadOptions {
    // How 8-bit and float colours of PLY, OBJ and OFF are encoded; glTF defines its own (linear).
    ColourEncoding colours = ColourEncoding::srgb;
    Progress progress = {};
};

struct ReadResult {
    Mesh mesh;
    std::uint64_t source_faces = 0;       // faces of the file before triangulation
    std::uint64_t dropped_triangles = 0;  // triangles that used a vertex twice
    std::vector<std::string> warnings;    // repairs that were made, one sentence each
};

// Polygons are triangulated (ear clipping in the plane of the polygon, so concave ones keep their area),
// triangle strips unrolled with their orientation, glTF node transforms applied. Coincident vertices stay apart.
// Fails on a mesh without triangles, and on vertex normals in use that are not finite; those of length 0 are told in the warnings.
Result<ReadResult> read_mesh(const std::filesystem::path& file, const ReadOptions& options = {});

// Writes to a temporary name in the same folder, then renames; an existing file is replaced only by a whole one.
// PLY: binary little-endian, float positions where they are exact and double otherwise; normals, colours (sRGB
// 8 bit), UVs where present. OBJ: text with as many digits as needed to read the same values again.
// GLB: one primitive for each material range.
// Progress is told, and can cancel, while a PLY is written.
Result<void> write_mesh(const std::filesystem::path& file, const MeshView& mesh, Progress progress = {});

} // namespace unseen::vdtree
