// The writers behind write_mesh and write_cut: with values of vertices.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include <unseen/meshio/mesh_io.h>
#include <unseen/meshio/vertex_array.h>

#include "file_output.h"

namespace unseen::meshio {

// What can hold arrays: PLY, and VTK's two formats. By ending, in small letters.
bool holds_arrays(const std::string& ending);

// write_mesh() with arrays by vertex; those of other roles than `value` say how the mesh's own are called. What the
// format holds otherwise, or not at all, is told in the notes. Precondition: the arrays are as long as the mesh.
Result<void> write_mesh_with(const std::filesystem::path& file, const vdtree::MeshView& mesh,
                             std::span<const VertexArray> arrays, std::vector<Message>& notes,
                             const Progress& progress = {});

// XML PolyData (.vtp): little-endian, raw behind the XML; legacy polydata (.vtk): binary, version 3.0. Points are
// floats where that is exact and doubles otherwise. Precondition of the second: the mesh fits.
void write_vtp(FileOutput& out, const vdtree::MeshView& mesh, std::span<const VertexArray> arrays);
void write_legacy_vtk(FileOutput& out, const vdtree::MeshView& mesh, std::span<const VertexArray> arrays);
bool fits_legacy_vtk(const vdtree::MeshView& mesh); // whose sizes have 32 bits

// Whether all positions are floats.
bool are_floats(const vdtree::MeshView& mesh);

// 0..1 as 0..255.
std::uint8_t to_byte(float channel);

// Some milliseconds of writing.
inline constexpr std::size_t items_a_report = std::size_t{1} << 18;

} // namespace unseen::meshio
