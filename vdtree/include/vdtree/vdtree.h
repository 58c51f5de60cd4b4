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
// the number of threads. Mesh files are read by <meshio/mesh_io.h>.
#pragma once

// Meshes, and trees of them.
#include <vdtree/attribute.h>
#include <vdtree/baked_light.h>
#include <vdtree/builder.h>
#include <vdtree/colour.h>
#include <vdtree/conserve_light.h>
#include <vdtree/mesh.h>
#include <vdtree/normal_mask.h>
#include <vdtree/packed.h>
#include <vdtree/team.h>
#include <vdtree/texture.h>
#include <vdtree/tree_io.h>
#include <vdtree/vertex_tree.h>

// Views, what decides about folds, and cuts.
#include <vdtree/criteria.h>
#include <vdtree/cut.h>
#include <vdtree/depth_picture.h>
#include <vdtree/distance_criterion.h>
#include <vdtree/footprint.h>
#include <vdtree/geomorph.h>
#include <vdtree/lighting.h>
#include <vdtree/occluders.h>
#include <vdtree/occlusion_map.h>
#include <vdtree/view.h>

// Errors and callbacks.
#include <vdtree/function_ref.h>
#include <vdtree/result.h>
