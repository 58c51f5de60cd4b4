// Which fold test a cut of an object goes by, what it looks at, and what is kept of it.
#pragma once

#include "sight.h"

namespace unseen::session {

// Decides for one object of the scene. Fails if the request asks for a test that does not know what there is to
// see.
Result<Decision> decide(Sight& sight, const Request& request);

// By contrast sensitivity, and for a goal that folds.
bool is_perceptual(const Decision& decision);

// The rest is of decisions whose errors are measured, and for goals that fold. The cache keeps the last criterion.
Result<CutRecipe> make_recipe(Sight& sight, const Decision& decision);

// The options of perception's tests, with the observer's own gaze.
perception::FoldTestOptions test_options(const Sight& sight);

// What the test compares, as the reason of an effect; see fold_tests.cpp.
std::string what_it_looks_at(const Sight& sight, FoldTest test);

// Why recipes are what they are.
bool casts_shadows(const Sight& sight);
// Whether what is not seen may not fold: shadows of it may be seen, and nobody asks what they show.
bool may_cast_anything(const Sight& sight, const Decision& decision);
bool is_translucent(const Sight& sight);
// Whether faces that look away can be folded: they are not drawn, and nothing shows them from outside. And whether they
// are: from view to view several times as many nodes change for it, which takes longer than drawing them. So there only
// within budgets, which then have more for what is seen.
bool may_fold_back_faces(const Sight& sight);
bool folds_back_faces(const Sight& sight, const Decision& decision);
// Whether what lies outside of the window folds, and all of the object does, by more than any rounding.
bool is_out_of_sight(Sight& sight, const Decision& decision);
// What a solid's inside hides. Mostly that faces away, too: the rest is not worth its tests from view to view.
bool folds_hidden(const Sight& sight, const Decision& decision);
// Shadows of what is not seen.
inline constexpr const char* may_cast = "what is not seen may cast shadows that are";
bool knows_shown(const Sight& sight, const Decision& decision);  // how much of each part pictures show
bool folds_unseen(const Sight& sight, const Decision& decision); // what lies behind what the view shows
// Why a budget or a quality goes by the largest cost and not by the sum of errors; null where it goes by the sum.
const char* why_not_summed(const Sight& sight, const Decision& decision);

// What the cut itself says about effects.
struct CutFacts {
    double imperceptible_from_m = 0;
    bool is_complete = true;   // no time limit ended it
    std::size_t occluders = 0; // how many spheres could hide something
    std::size_t outlines = 0;  // nodes that are kept for their shadows
};

// What takes part in making a cut and what does not, with reasons. Without facts: as far as can be said before there is
// a cut.
std::vector<Effect> effects_of(const Sight& sight, const Decision& decision, const std::optional<CutFacts>& facts);
Effect geomorph_effect(const vdtree::Geomorph* geomorph, const vdtree::Cut& cut); // null: there is none

// ---- criteria, which are kept from one request to the next, and what they depend on

// All that a criterion depends on, but for what never changes in a scene.
struct Key {
    FoldTest test = FoldTest::error;
    double pixels = 0; // of the others than perceptual tests; and of these alone:
    std::optional<double> farthest_gaze_px = {};
    perception::SceneLuminance scene = {0, 0};
    std::shared_ptr<const vdtree::Lighting> still_lights = {};         // of the test by errors, as the next
    std::shared_ptr<const std::vector<vdtree::Lighting>> stretch = {}; // of lights that move
    bool is_lit = false;
    std::optional<glm::dvec3> eye = {};                   // of highlights, which follow it
    std::shared_ptr<const perception::CsfTable> csf = {}; // kept, so that no other table comes to its address
    vdtree::View lens = {};
    bool operator==(const Key&) const = default;
};

struct KeptCriterion {
    Key key;
    vdtree::DistanceCriterion criterion;
    std::shared_ptr<const perception::ShadowEdges> edges; // null where no light casts shadows
};

// The last ones that go by pictures, for a view of an object at its place.
struct ShownCriteria {
    std::shared_ptr<const KeptCriterion> of = {};
    std::vector<vdtree::DepthPicture> pictures = {};
    vdtree::View view = {};
    bool culls = false, folds_hidden = false;                                     // what faces away; what none shows
    std::shared_ptr<const vdtree::DistanceCriterion> fold_test = {}, summed = {}; // the second where it was asked for
};

Key key_of(const Sight& sight, const Decision& decision);

// The gaze is where the key says: one criterion does for all gazes up to there.
perception::FoldTestOptions test_options(const Sight& sight, const Key& key);

// See fold_tests.cpp, where each test makes its own.
Result<vdtree::DistanceCriterion> make_criterion(Sight& sight, const Key& key);

// The last one that the object was asked for. Objects with one tree share it, but not under lights.
std::shared_ptr<const KeptCriterion>& last_criterion(Sight& sight, const Key& key);

} // namespace unseen::session
