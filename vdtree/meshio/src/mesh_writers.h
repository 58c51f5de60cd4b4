// The formats of mesh files, and the writers behind write_mesh and write_cut, one function a format.
#pragma once

#include <unseen/meshio/mesh_file.h>
#include <unseen/meshio/source_document.h>

#include "file_output.h"
#include "mesh_readers.h"

namespace unseen::meshio {

// A valid mesh with triangles. Arrays are as long as the mesh; those of other roles than `value` say how the mesh's own
// are called. What the format holds otherwise, or not at all, is told in the notes.
struct MeshToWrite {
    const std::filesystem::path& file;
    const vdtree::MeshView& mesh;
    std::span<const VertexArray> arrays;
    std::vector<Message>& notes;
    const Progress& progress;
    std::span<const Index> places = {}; // by vertex, if given: those of one number are at one position, sides of a seam
};
Result<void> write_ply(const MeshToWrite& mesh);
Result<void> write_obj(const MeshToWrite& mesh);
Result<void> write_gltf(const MeshToWrite& mesh);
Result<void> write_vtp(const MeshToWrite& mesh); // little-endian, raw behind the XML
Result<void> write_stl(const MeshToWrite& mesh); // binary
Result<void> write_off(const MeshToWrite& mesh);

// A format of mesh files: how it is known, read and written.
struct Format {
    std::string_view name; // for people
    std::array<std::string_view, 2> endings;
    bool (*has_signature)(std::string_view bytes); // null: the format has none
    ReadResult (*read)(const MeshSource& source);  // throws Fault
    Result<void> (*write)(const MeshToWrite& mesh);
    bool holds_values;    // of vertices
    bool holds_materials; // and nodes: write_cut() writes such files from source documents
};

// The format of a file's name, by its ending, or null.
const Format* format_named(const std::filesystem::path& file);

// write_mesh() with arrays.
Result<void> write_mesh_with(const std::filesystem::path& file, const vdtree::MeshView& mesh,
                             std::span<const VertexArray> arrays, std::vector<Message>& notes,
                             const Progress& progress = {}, std::span<const vdtree::Index> places = {});

// Runs write(FileOutput&), then renames the file.
template <class Write>
Result<void> write_file(const std::filesystem::path& file, Write&& write) {
    Result<vdtree::AtomicFile> target = vdtree::AtomicFile::create(file);
    if (!target) return target.error();
    FileOutput out(std::move(*target));
    if constexpr (std::is_void_v<decltype(write(out))>) write(out);
    else if (const Result<void> written = write(out); !written) return written;
    return out.finish();
}

// Whether all positions are floats.
bool are_floats(const vdtree::MeshView& mesh);

// 0..1 as 0..255.
std::uint8_t to_byte(float channel);

// In sRGB; alpha stays linear.
glm::vec4 encoded(const glm::vec4& colour);
std::array<std::uint8_t, 4> encoded_bytes(const glm::vec4& colour);

} // namespace unseen::meshio
