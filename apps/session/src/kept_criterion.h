// Criteria that are kept from one request to the next, and what they depend on.
#pragma once

#include <memory>
#include <optional>

#include "fold_test.h"

namespace unseen::session {

// All that a criterion depends on, but for what never changes in a scene.
struct Key {
    FoldTest test = FoldTest::error;
    double pixels = 0; // of the others than perceptual tests; and of these alone:
    std::optional<double> farthest_gaze_px = {};
    perception::SceneLuminance scene = {0, 0};
    std::shared_ptr<const vdtree::Lighting> still_lights = {}; // of the test by errors
    bool is_lit = false, chroma = false;
    std::shared_ptr<const perception::CsfTable> csf = {}; // kept, so that no other table comes to its address
    vdtree::View lens = {};
    bool operator==(const Key&) const = default;
};

struct KeptCriterion {
    Key key;
    vdtree::DistanceCriterion criterion;
    std::shared_ptr<const perception::ShadowEdges> edges; // null where no light casts shadows
};

Key key_of(const Sight& sight, const Decision& decision);

// The gaze is where the key says: one criterion does for all gazes up to there.
perception::FoldTestOptions test_options(const Sight& sight, const Decision& decision, const Key& key);

// See fold_tests.cpp, where each test makes its own.
Result<vdtree::DistanceCriterion> make_criterion(Sight& sight, const Decision& decision, const Key& key);

// The last one that the object was asked for. Objects with one tree share it, but not under lights.
std::shared_ptr<const KeptCriterion>& last_criterion(Sight& sight, const Key& key);

} // namespace unseen::session
