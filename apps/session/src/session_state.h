// What a session and its followers share.
#pragma once

#include <map>

#include "fold_test.h"

namespace unseen::session {

// All objects as they are seen in a view, and what is to be done about each. Refers to the state, the view, the request
// and the memory.
struct Prepared {
    std::vector<Sight> sights;
    std::vector<Decision> decisions; // by object

    bool shares_budget() const {
        return decisions.size() > 1 && decisions.front().request.goal.kind == Goal::Kind::budget;
    }
};

class Session::State {
public:
    static Result<std::shared_ptr<State>> create(Scene scene, Observer observer, Messages messages);

    // Sights refer to the state, the view and the memory.
    Result<std::vector<Sight>> look(const vdtree::View& view, ShadowMemory& memory);
    // Measures the errors of folds where a decision wants them.
    Result<Prepared> prepare(const vdtree::View& view, const Request& request, ShadowMemory& memory);
    // Items count the objects, then the backdrop.
    Result<std::shared_ptr<const vdtree::Lighting>> lighting(const vdtree::View& view, std::size_t item);

    Scene scene;
    Observer observer;
    Messages messages;
    float background = 0;                             // relative luminance
    double seconds = 0;                               // of lights that move
    std::vector<std::shared_ptr<ObjectCache>> caches; // by object; objects with one tree share one
    std::vector<std::uint64_t> tree_count;            // by object: how many trees it has had

private:
    State(Scene scene_, Observer observer_, Messages messages_, float background_);
    void share_caches();
    Result<void> look_at_backdrop(const vdtree::View& view);
    perception::SceneLuminance luminance_of(const std::vector<Sight>& sights) const;
    Result<void> measure(std::size_t object);
    Result<void> measure_under_lights(std::size_t object);
    Result<void> set_gaze_of(Sight& sight);
    Result<std::shared_ptr<const perception::CsfTable>> sensitivity(); // of the observer, to what moves so fast

    std::unique_ptr<perception::WidenedTables> widened_; // for gazes that are not known for sure
    // The table for a velocity, and the one at rest that it was made of.
    struct Moving {
        perception::DegreesPerSecond velocity;
        std::shared_ptr<const perception::CsfTable> at_rest, table;
    };
    std::optional<Moving> moving_;
    std::shared_ptr<const perception::CsfTable> widened_of_;
    std::vector<std::shared_ptr<const vdtree::Lighting>> still_lights_; // by item, of lights that stand still
    // Lights that move with time, at the beginning, in the middle and at the end of a stretch of it
    // (LightRig::stretch_at()): the test by errors folds what is invisible under all three.
    struct LitStretch {
        std::shared_ptr<const std::vector<vdtree::Lighting>> lightings;
        std::shared_ptr<const KeptCriterion> criterion;
    };
    LitStretch* stretch_of(const vdtree::View& view, std::size_t object); // null where lights stand still
    std::vector<std::map<std::int64_t, LitStretch>> lit_stretches_;       // by object; by number
    std::vector<std::shared_ptr<const KeptCriterion>> lit_criteria_;      // by object
    std::vector<std::shared_ptr<const ShownCriteria>> shown_criteria_;    // by object
    SceneShadows scene_shadows_;
    bool is_crowded_ = false;
    std::vector<vdtree::Plane> window_;                   // of the last look
    std::vector<vdtree::LuminanceRange> backdrop_ranges_; // of luminance, as they are lit
    std::optional<perception::ChromaRange> backdrop_colours_;
};

} // namespace unseen::session
