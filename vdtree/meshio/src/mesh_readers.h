// The readers behind read_mesh: one function a format, all from bytes in memory.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <unseen/meshio/mesh_file.h>
#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/internal/budget.h>
#include <unseen/vdtree/internal/finite.h>
#include <unseen/vdtree/internal/input_file.h>
#include <unseen/vdtree/internal/names.h>

namespace unseen::meshio {

using namespace vdtree; // the types that are read and written

// What a reader reads. The bytes must outlive the call.
struct MeshSource {
    std::string_view bytes;
    std::string name;                  // for messages
    std::filesystem::path folder = {}; // where glTF buffers lie; empty where there is no folder
    const ReadOptions& options;

    // False where the caller wants to stop.
    bool keep_going(std::uint64_t bytes_done, const char* stage) const;
};

// Readers check counts, sizes and indices themselves, count bad vertices, and add no face that is bad or uses one;
// read_mesh_bytes adds what all formats share.
Result<ReadResult> read_ply(const MeshSource& source);
Result<ReadResult> read_obj(const MeshSource& source);
Result<ReadResult> read_off(const MeshSource& source);
Result<ReadResult> read_stl(const MeshSource& source);
Result<ReadResult> read_gltf(const MeshSource& source);
Result<ReadResult> read_vtp(const MeshSource& source);

// What all formats share, after their readers: checks coordinates and normals, drops triangles that use a vertex twice.
Result<ReadResult> finish_reading(const MeshSource& source, ReadResult result);

// read_mesh without a file system: finds the format, reads, checks coordinates, drops triangles that use a vertex
// twice. The name's ending decides where the content does not. glTF files with external buffers need `folder`.
Result<ReadResult> read_mesh_bytes(std::string_view bytes, const std::filesystem::path& name,
                                   const ReadOptions& options = {}, const std::filesystem::path& folder = {});

// Whether bytes without a signature are a binary STL: their size is exactly what the triangle count asks for.
bool is_binary_stl(std::string_view bytes);
// Whether the bytes start with one of the keywords of OFF (COFF, STOFF, ...), after comments.
bool starts_with_off_keyword(std::string_view bytes);
// Whether the bytes start as VTK's XML does, with an element VTKFile.
bool is_vtk_xml(std::string_view bytes);

// A name in a mesh file as a path below the mesh's folder, or nothing: a mesh must not be able to name any file of the
// machine.
std::optional<std::filesystem::path> path_beside(std::string_view name);

// Counts a vertex with a NaN or infinite coordinate. `where` names it if it is the first.
template <class Where>
void check_position(BadParts& bad, const glm::dvec3& position, Where&& where) {
    if (is_finite(position)) return;
    if (bad.vertices++ == 0) bad.first_vertex = where() + " has a NaN or infinite coordinate";
}

// Counts a face with corners that are not there, which its reader leaves out. `what` names the first.
template <class What>
void leave_out_face(BadParts& bad, What&& what) {
    ++bad.left_out;
    if (bad.faces++ == 0) bad.first_face = what();
}

// Where in the file, and the sentence: "bunny.ply: line 7: ...".
Error malformed(const MeshSource& source, const Message& what);
Error malformed_line(const MeshSource& source, std::uint64_t line, const std::string& what);
Error malformed_byte(const MeshSource& source, std::uint64_t byte, const std::string& what);
Error cancelled(const MeshSource& source);
Error too_large(const std::string& name); // for this machine's memory

// "1 face was", "3 faces were".
std::string counted_were(std::uint64_t count, const std::string& noun);

// Decodes the colour channels as the options say; alpha is linear in every format.
glm::vec4 decode_colour(glm::vec4 encoded, ColourEncoding encoding);

// What a vertex without the attribute gets in a mesh where others have it.
constexpr glm::vec3 missing_normal{0.0f};
constexpr glm::vec4 missing_colour{1.0f};

// Rows between two calls of the progress callback: often enough to cancel at once, too rare to cost time.
constexpr std::uint64_t rows_per_progress = 1 << 16;

} // namespace unseen::meshio
