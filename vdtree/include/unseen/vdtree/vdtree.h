// vdtree: vertex trees over triangle meshes, and cuts through them. The header to include first.
//
// A VertexTree is a hierarchy of merged vertices, built once for a mesh. A DistanceCriterion gives each node the distance
// from which it may fold. A Cut is one view's simplification: it follows an eye, or keeps a budget, and has an index
// buffer over the tree's vertices.
//
//     const auto tree = vdtree::build_tree(mesh.view());
//     const auto criterion = vdtree::extent_criterion(*tree, view, 2.0); // clusters of up to 2 pixels
//     vdtree::Cut cut(*tree);
//     const auto stats = cut.follow(*criterion, {.eye = eye_in_tree(*tree, view, {})});
//     draw(tree->positions(), cut.indices());
//
// Functions that can fail return a Result: the value, or an Error with a sentence. Nothing prints. Results do not depend on
// the number of threads. <unseen/meshio/mesh_file.h> reads mesh files.
#pragma once

// Meshes, and trees of them.
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/tree_io.h>
#include <unseen/vdtree/vertex_tree.h>

// Views, fold criteria and cuts.
#include <unseen/vdtree/active_triangles.h>
#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/depth_picture.h>
#include <unseen/vdtree/geomorph.h>
#include <unseen/vdtree/lighting.h>
#include <unseen/vdtree/pruning.h>
#include <unseen/vdtree/view.h>

// Errors and callbacks.
#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/result.h>
