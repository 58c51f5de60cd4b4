// cgal: trees from CGAL surface meshes, and cuts back into them. The header to include first.
//
// Headers alone, under Unseen's licence; CGAL is linked by who includes them. Its package Surface_mesh is under the GPL,
// version 3 or later, or a commercial licence: a program that uses these headers is bound by one of the two.
//
//     CGAL::Surface_mesh<Kernel::Point_3> mesh; // and read it
//     const auto tree = cgal::build_tree(mesh);
//     vdtree::Cut cut(*tree); // and follow a view, see <unseen/vdtree/vdtree.h>
//     const auto small = cgal::extract_mesh<CGAL::Surface_mesh<Kernel::Point_3>>(cut);
#pragma once

#include <unseen/cgal/surface_mesh.h>
