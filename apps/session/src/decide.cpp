// Which fold test an object's cut goes by, and whether that knows what there is to see.
#include <algorithm>

#include <unseen/perception/fold_measurement.h>
#include <unseen/vdtree/internal/errors.h>

#include "fold_test.h"
#include "loaded_tree.h"

namespace unseen::session {
namespace {

bool knows_lit_texture(Sight& sight) {
    std::optional<bool>& known = sight.cache.knows_lit_texture;
    if (!known) known = perception::knows_lit_texture(sight.object.tree);
    return *known;
}

// Whether a lit object's errors are there, in the session or in the tree, which takes no measuring.
bool has_lit_errors(const Sight& sight) {
    return sight.cache.lit_folds || perception::has_lit_folds(sight.object.tree);
}

// Why the test `error` cannot look at these lights; null where it can, and without lights.
const char* why_lights_are_not_known(const Sight& sight, const Request& request) {
    if (!sight.lighting) return nullptr;
    const bool has_one_view = sight.memory.has_one_view && request.purpose == Purpose::picture && request.may_measure;
    if (sight.lighting->specular > 0) {
        if (!has_one_view) return "the test error knows highlights in single pictures alone, for these follow the eye";
        if (sight.stretch) return "the test error does not know highlights of lights that move";
        if (!sight.object.tree.texture().relief.empty())
            return "the test error does not know highlights of normal maps";
    }
    if (sight.lights->stands_still()) return nullptr;
    if (!sight.stretch && !has_one_view)
        return "the test error knows lights that go with the camera in single pictures alone";
    if (sight.stretch && casts_shadows(sight)) return "the test error does not know shadows of lights that move";
    return nullptr;
}

struct Choice {
    FoldTest test = FoldTest::error;
    std::string_view why = {};
};

// Chooses a perceptual test that handles this scene.
Choice suitable_test(Sight& sight, const Request& request, bool may_measure) {
    const vdtree::VertexTree& tree = sight.object.tree;
    if (const char* const why = why_lights_are_not_known(sight, request)) return {FoldTest::luebke_hallen_safe, why};
    if (sight.stretch && !may_measure)
        return {
            FoldTest::luebke_hallen_safe,
            "the test error takes a moment for each stretch of time in which lights move, and nobody waits for that"};
    if (sight.lighting && !knows_lit_texture(sight))
        return {FoldTest::luebke_hallen_safe,
                "under lights the test error does not know textures over vertices of several hues"};
    if (sight.lighting && sight.is_crowded)
        return {FoldTest::luebke_hallen_safe, "the test error would look at millions of nodes under these lights"};
    if (sight.lighting && has_lit_errors(sight)) return {};
    if ((!sight.lighting && perception::has_fold_measurement(tree)) ||
        (may_measure && tree.interior_count() <= most_measured))
        return {};
    return {FoldTest::luebke_hallen_safe,
            "the tree does not hold the errors of its folds, and measuring them takes long"};
}

// Whether a test knows what it would have to look at.
Result<void> check_knowledge(Sight& sight, FoldTest test, const Request& request) {
    if (!is_perceptual(test)) return {};
    if (const char* const why = why_lights_are_not_known(sight, request); why && test == FoldTest::error)
        return invalid_field("{request.fold_test = }{} cannot be taken under {scene.lights}, for {}: use "
                             "{request.fold_test = }luebke-hallen-safe.",
                             {name_of(test), why});
    if (sight.lighting && !request.shown.empty() && test != FoldTest::error)
        return invalid_field("{request.shown} and {scene.lights} go together with {request.fold_test = }error alone.");
    if (sight.lighting && test == FoldTest::error && !knows_lit_texture(sight))
        return invalid_field(
            "{request.fold_test = }error does not measure textures over vertices of several hues under "
            "{scene.lights}: use {request.fold_test = }luebke-hallen-safe, or add "
            "{load.without_textures}.");
    return {};
}

} // namespace

Result<Decision> decide(Sight& sight, const Request& request) {
    if (request.purpose != Purpose::mesh && !request.shown.empty() && request.shown[0].view() != sight.view)
        return invalid_field("{request.shown} is of another view.");
    const bool folds = request.goal.kind != Goal::Kind::full;
    const bool has_errors =
        sight.lighting ? sight.cache.lit_folds.has_value() : perception::has_fold_measurement(sight.object.tree);
    // The full model needs no measuring, so what is measured already does not decide its test.
    Choice choice = suitable_test(sight, request, !folds || request.may_measure);
    if (!folds) return Decision{request, choice.test, choice.why};
    if (request.goal.kind == Goal::Kind::pixels) choice = {FoldTest::extent};
    if (request.fold_test) choice = {*request.fold_test};
    if (const auto known = check_knowledge(sight, choice.test, request); !known) return known.error();
    const bool measures = choice.test == FoldTest::error && !has_errors;
    if (measures && !request.may_measure && !(sight.lighting && has_lit_errors(sight)))
        return invalid_field(
            "{request.fold_test = }error goes by errors that the tree does not hold: allow {request.may_measure}, or "
            "call {session::measured()}.");
    return Decision{request, choice.test, choice.why, measures};
}

} // namespace unseen::session
