// vdtree: vertex trees over triangle meshes, and cuts through them. The header to include first.
//
// A VertexTree is a hierarchy of merged vertices, built once for a mesh. A DistanceCriterion says for each node from
// how far away it may be folded. A Cut is one view's simplification: it follows an eye, or keeps a budget, and has an
// index buffer over the tree's vertices.
//
//     const auto tree = vdtree::build_tree(mesh.view());
//     const auto criterion = vdtree::extent_criterion(*tree, view, 2.0); // clusters of up to 2 pixels
//     vdtree::Cut cut(*tree);
//     const auto stats = cut.follow(*criterion, {.eye = eye_in_tree(*tree, view, {})});
//     draw(tree->positions(), cut.indices());
//
// What can fail returns a Result: the value, or an Error with a sentence. Nothing prints, and results do not depend on
// the number of threads. Mesh files are read by <unseen/meshio/mesh_io.h>.
#pragma once

// Meshes, and trees of them.
#include <unseen/vdtree/attribute.h>
#include <unseen/vdtree/baked_light.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/conserve_light.h>
#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/normal_mask.h>
#include <unseen/vdtree/packed.h>
#include <unseen/vdtree/team.h>
#include <unseen/vdtree/texture.h>
#include <unseen/vdtree/tree_io.h>
#include <unseen/vdtree/vertex_tree.h>

// Views, what decides about folds, and cuts.
#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/depth_picture.h>
#include <unseen/vdtree/distance_criterion.h>
#include <unseen/vdtree/footprint.h>
#include <unseen/vdtree/geomorph.h>
#include <unseen/vdtree/lighting.h>
#include <unseen/vdtree/occluders.h>
#include <unseen/vdtree/view.h>

// Errors and callbacks.
#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/result.h>
