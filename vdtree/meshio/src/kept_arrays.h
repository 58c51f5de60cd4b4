// What readers do with arrays of vertices, and what writers need of those of a cut.
#pragma once

#include <unseen/meshio/mesh_file.h>
#include <unseen/meshio/source_document.h>
#include <unseen/vdtree/cut.h>

namespace unseen::meshio {

// Makes the arrays the document of what was read. Of those of one name the first counts; a note tells of others.
void keep_arrays(ReadResult& result, std::vector<VertexArray> arrays);

// "'a', 'b' and 'c'"; of many names the first ones and a number. For messages.
std::string listed(const std::vector<std::string>& names);
std::vector<std::string> names_of(std::span<const VertexArray> arrays); // of those with values

// Roles by the names that arrays usually have.
bool is_colour_name(std::string_view name);

// The arrays by vertex of an extracted cut. Vertices of the input keep their values. Those of proxies are, of floats,
// the mean of the finite values that they stand for, each component by itself and never beyond them; of integers, and
// where no value is finite, those of the nearest of these vertices, the first of several. Fails where the arrays are
// not those of the tree's mesh. Cost: the tree's leaves.
Result<std::vector<VertexArray>> arrays_of_cut(const vdtree::Cut& cut, const vdtree::ExtractedMesh& extracted,
                                               std::span<const VertexArray> arrays);

} // namespace unseen::meshio
