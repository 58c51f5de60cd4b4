// The readers behind read_mesh: one function a format, all from bytes in memory.
#pragma once

#include <new>
#include <stdexcept>

#include <unseen/meshio/mesh_file.h>
#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/internal/budget.h>
#include <unseen/vdtree/internal/input_file.h>
#include <unseen/vdtree/internal/names.h>
#include <unseen/vdtree/internal/vectors.h>

namespace unseen::meshio {

using namespace vdtree; // the types that are read and written

// Rows between two calls of the progress callback: often enough to cancel at once, too rare to cost time.
constexpr std::uint64_t rows_per_progress = 1 << 16;

// What a reader reads. The bytes must outlive the call.
struct MeshSource {
    std::string_view bytes;
    std::string name;                  // for messages
    std::filesystem::path folder = {}; // where glTF buffers lie; empty where there is no folder
    const ReadOptions& options;

    // Tells of the progress; throws where the caller wants to stop.
    void report(std::uint64_t bytes_done, const char* stage) const;
    // The same for every rows_per_progress-th row.
    void report_row(std::uint64_t row, std::uint64_t bytes_done, const char* stage) const {
        if (row % rows_per_progress == 0) report(bytes_done, stage);
    }
};

// What is wrong with a file, in one sentence. Readers throw it, and reported() makes it an error with the file's name.
struct Fault {
    Message what;
    ErrorCode code = ErrorCode::malformed_data;
};

// Texts and numbers one after the other.
template <class... Parts>
std::string text_of(const Parts&... parts) {
    std::string text;
    const auto add = [&](const auto& part) {
        if constexpr (std::is_arithmetic_v<std::remove_cvref_t<decltype(part)>>) text += std::to_string(part);
        else text += part;
    };
    (add(parts), ...);
    return text;
}

template <class... Parts>
[[noreturn]] void fail(const Parts&... parts) {
    throw Fault{text_of(parts...)};
}
template <class... Parts>
[[noreturn]] void fail_unsupported(const Parts&... parts) {
    throw Fault{text_of(parts...), ErrorCode::unsupported};
}

// Runs a reader.
template <class Value, class Read>
Result<Value> reported(const MeshSource& source, Read&& read) {
    constexpr const char* too_large = "reading it needs more memory than there is; give a smaller file.";
    const auto error = [&](const Message& what, ErrorCode code) { return Error{code, source.name + ": " + what}; };
    try {
        return read();
    } catch (const Fault& fault) {
        return error(fault.what, fault.code);
    } catch (const std::bad_alloc&) {
        return error(too_large, ErrorCode::unsupported);
    } catch (const std::length_error&) { // what a vector throws instead beyond its largest size
        return error(too_large, ErrorCode::unsupported);
    }
}

// Readers check counts, sizes and indices themselves, count bad vertices, and add no face that is bad or uses one;
// read_mesh_bytes adds what all formats share. They throw Fault.
ReadResult read_ply(const MeshSource& source);
ReadResult read_obj(const MeshSource& source);
ReadResult read_off(const MeshSource& source);
ReadResult read_stl(const MeshSource& source);
ReadResult read_gltf(const MeshSource& source);
ReadResult read_vtp(const MeshSource& source);

// What all formats share, after their readers: checks coordinates and normals, drops triangles that use a vertex twice.
ReadResult finish_reading(const MeshSource& source, ReadResult result);

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

// "1 face was", "3 faces were".
std::string counted_were(std::uint64_t count, const std::string& noun);

// Decodes the colour channels as the options say; alpha is linear in every format.
glm::vec4 decode_colour(glm::vec4 encoded, ColourEncoding encoding);

// What a vertex without the attribute gets in a mesh where others have it.
constexpr glm::vec3 missing_normal{0.0f};
constexpr glm::vec4 missing_colour{1.0f};

} // namespace unseen::meshio
