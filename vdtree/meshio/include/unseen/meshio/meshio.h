// meshio: mesh files. The header to include first.
//
//     const auto read = meshio::read_mesh("house.glb");
//     const auto tree = vdtree::build_tree(read->mesh.view());
//     vdtree::Cut cut(*tree); // and follow a view, see <unseen/vdtree/vdtree.h>
//     const auto notes = meshio::write_cut("small.glb", cut);
//
// What is read (r) and written (w):
//
//     format       text  binary  normals  colours  texture      materials  nodes and  values of
//                                                  coordinates  and images scenes     vertices
//     PLY          r     rw      rw       rw       rw           -          -          rw
//     OBJ          rw    -       rw (3)   rw       rw           rw         rw (1)     -
//     glTF, GLB    rw    rw      rw       rw       rw           rw         rw         -
//     VTP          r     rw      rw       rw       rw           -          -          rw
//     STL          r     rw      - (2)    -        -            -          -          -
//     OFF          rw    -       rw       rw       rw           -          -          -
//
// (1) objects and groups. (2) Facets' normals are read if vertices are not welded, and written as computed. (3) Smoothing
// groups are read.
// Normals that are missing are computed when a tree is built (BuildOptions::crease). So are those of glTF primitives without
// any, for which its specification asks for flat faces: files of smooth surfaces leave normals out, too.
// A new format is a reader, a writer and a line of the table in src/mesh_file.cpp.
#pragma once

#include <unseen/meshio/examine.h>
#include <unseen/meshio/mesh_file.h>
#include <unseen/meshio/scene_file.h>
#include <unseen/meshio/source_document.h>
