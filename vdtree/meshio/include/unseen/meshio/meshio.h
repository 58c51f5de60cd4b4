// meshio: mesh files. The header to include first.
//
// read_mesh() reads PLY, OBJ, OFF, STL, glTF and VTK into a vdtree::Mesh; write_mesh() writes meshes, and write_cut() a
// cut with everything that its mesh file said beyond triangles: nodes, names, materials, images, values of vertices.
//
//     const auto read = meshio::read_mesh("house.glb");
//     const auto tree = vdtree::build_tree(read->mesh.view());
//     vdtree::Cut cut(*tree); // and follow a view, see <unseen/vdtree/vdtree.h>
//     const auto notes = meshio::write_cut("small.glb", cut);
#pragma once

#include <unseen/meshio/examine.h>
#include <unseen/meshio/level_file.h>
#include <unseen/meshio/mesh_io.h>
#include <unseen/meshio/scene_file.h>
#include <unseen/meshio/source_document.h>
#include <unseen/meshio/vertex_array.h>
