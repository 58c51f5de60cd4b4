// Draws the pictures of a study: pairs of an original and a picture that people try to tell from it.
#pragma once

#include <unseen/calibration/study.h>
#include <unseen/session_gpu/level_control.h>

namespace unseen::session {

struct StudyCondition {
    std::string name;
    Request request; // its purpose counts as picture
    bool is_training = false;
};

struct StudyPicturesOptions {
    std::filesystem::path folder;        // where pictures go; it must be there
    std::string prefix;                  // of the files' names
    int views = 5;                       // 1 to 360, around the target
    double degrees = 72;                 // from a view to the next one
    std::vector<double> distances = {1}; // from the target, times the view's; all views from each, above 0
    int samples = 64;                    // a pixel, 1 to 256
    bool pairs_original = false;         // with itself, once a view: for StudyTask::differ
    Progress progress = {};              // returning false stops, with the error `cancelled`
};

// Pairs of the full model and its simplification under each condition, in each view. Pictures are PNG, as the session's
// display shows them. Fails where Session::simplify(), drawing and writing files do; pictures already written stay.
// Cost: a picture for each view and condition.
Result<std::vector<calibration::StudyPair>> draw_study_pairs(Session& session, const render::Context& context,
                                                             const vdtree::View& view,
                                                             const std::vector<StudyCondition>& conditions,
                                                             const StudyPicturesOptions& options);

// Pairs of discrete levels, for StudyTask::differ: those of calibration::LevelStep around the level that LevelControl
// settles on in each view. Its best level has no decrease and no maintain, its coarsest no increase. Fails on scenes of
// several objects, if there is no pair at all, and where LevelControl does.
Result<std::vector<calibration::StudyPair>> draw_level_pairs(Session& session, const render::Context& context,
                                                             const vdtree::View& view,
                                                             const LevelControlOptions& levels,
                                                             const StudyPicturesOptions& options);

} // namespace unseen::session
