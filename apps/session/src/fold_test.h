// Which fold test a cut of an object goes by, and what it looks at.
#pragma once

#include <cstddef>
#include <memory>

#include "sight.h"

namespace unseen::session {

// Of the scene's object of this number. Fails where the request asks for a test that does not know what there is to
// see.
Result<Decision> decide(Sight& sight, const Request& request, std::size_t object);

// By contrast sensitivity, and for a goal that folds.
bool is_perceptual(const Decision& decision);

// The rest is of decisions whose errors are measured, and for goals that fold. The cache keeps the last criterion.
Result<CutRecipe> make_recipe(Sight& sight, const Decision& decision);

// The options of perception's tests, with the observer's own gaze.
perception::FoldTestOptions test_options(const Sight& sight, const Request& request);

// What the test compares, as the reason of an effect; see fold_tests.cpp.
std::string what_it_looks_at(const Sight& sight, FoldTest test);

// Why recipes are what they are.
bool casts_shadows(const Sight& sight);
// Whether what is not seen may not fold: shadows of it may be seen, and nobody asks what they show.
bool may_cast_anything(const Sight& sight, const Decision& decision);
bool is_translucent(const Sight& sight);
bool culls_back_faces(
    const Sight& sight); // faces that look away can be folded: they are not drawn, and nothing shows them from outside
// Whether what lies outside of the window folds, and all of the object does, by more than any rounding.
bool is_out_of_sight(Sight& sight, const Decision& decision);
bool folds_hidden(const Sight& sight, const Decision& decision); // what a solid's inside hides
// Shadows of what is not seen.
inline constexpr const char* may_cast = "what is not seen may cast shadows that are";
// Why what a scene masks does not count for an object; null where it may.
const char* why_unmasked(const Sight& sight);
bool folds_unseen(const Sight& sight, const Decision& decision); // what lies behind what the view shows

} // namespace unseen::session
