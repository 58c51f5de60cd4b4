// Which fold test a cut of a scene goes by, and what it looks at.
#pragma once

#include <memory>
#include <vector>

#include <perception/criterion.h>
#include <vdtree/cut.h>
#include <vdtree/distance_criterion.h>

#include "options.h"
#include "scene.h"

namespace unseen::app {

// What the picture is for decides what may be left out of it.
enum class Purpose {
    picture, // seen from this view only: what is out of the window is folded
    mesh,    // may be looked at from elsewhere
};

// Of the tests by luminance one that knows the scene, and colours where `chroma` counts: error, where the tree has the errors of its folds or
// `may_measure` allows for measuring them, which it does not of a very large tree.
ChosenTest suitable_test(const Scene& scene, bool chroma, bool may_measure);

// The tree with its light conserved and the errors of its folds measured, as the test error goes by them. `threads`: 0:
// all cores.
Result<vdtree::VertexTree> measured(const vdtree::VertexTree& tree, int threads = 0);

// To be called before anything is cut. Where no test was asked for, takes one that is suitable; fails where one was asked for that does not know
// the scene. Measures the errors of the tree's folds where the test goes by them and the tree does not have them: up to a minute, and the scene
// gets another tree. Not in the mode full, which folds nothing; from there a viewer may go on to others without that.
Result<void> settle_fold_test(Scene& scene, WhatOptions& what);

// The rest is of settled tests, and for modes that fold.

bool is_perceptual(const WhatOptions& what); // also of the mode full

// The scene keeps the last one that was asked for: views that differ in eye and gaze alone have the same.
Result<std::shared_ptr<const vdtree::DistanceCriterion>> distance_criterion(const Scene& scene, const WhatOptions& what);

// What goes with a criterion: where it looks from, and whether what faces away is folded.
vdtree::Viewpoint viewpoint_of(const Scene& scene, const WhatOptions& what, Purpose purpose);
vdtree::FollowOptions follow_options(const Scene& scene, Purpose purpose);

// What folding costs by interior node.
Result<std::vector<float>> fold_costs(const Scene& scene, const WhatOptions& what, Purpose purpose);

// Why viewpoint_of() and follow_options() are what they are.
bool is_translucent(const Scene& scene);
bool culls_back_faces(const Scene& scene); // faces that look away can be folded: they are not drawn, and nothing shows them from outside
bool folds_hidden(const Scene& scene, const WhatOptions& what, Purpose purpose); // what a solid's inside hides

// What silhouettes can be seen against.
perception::SceneLuminance scene_luminance(const Scene& scene);

} // namespace unseen::app
