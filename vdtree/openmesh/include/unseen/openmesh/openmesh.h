// openmesh: trees from OpenMesh meshes, cuts back into them, and OpenMesh's decimater as a clusterer. The header to
// include first. Headers alone; OpenMesh (BSD, three clauses) is linked by who includes them.
//
//     OpenMesh::IO::read_mesh(mesh, "bunny.ply");
//     const auto tree = openmesh::build_tree(mesh);
//     vdtree::Cut cut(*tree); // and follow a view, see <unseen/vdtree/vdtree.h>
//     const auto small = openmesh::extract_mesh<MyMesh>(cut);
#pragma once

#include <unseen/openmesh/convert.h>
#include <unseen/openmesh/decimater_clusterer.h>
