// A study's window: pairs of pictures side by side, and keys that answer.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <unseen/calibration/study.h>
#include <unseen/vdtree/result.h>

namespace unseen::app {

struct StudyWindowOptions {
    bool full_screen = false;
    double pause_s = 0.7;   // of grey before a pair
    double seconds = 0;     // that a pair is shown; 0: until it is answered. It may be answered later, too
    std::string screenshot; // PNG of the last pair shown
};

inline constexpr const char* study_window_help =
    R"(In the window: two pictures, one of them the original. Look at both for as long as you like.
  which   left and right arrow: which one is not the original?
  differ  s or d: are both the same, or do they differ?
  Training comes first and says what was right. Space begins.
  q, Esc  stop; what was answered is kept, and --subject with the same name goes on
)";

// Shows trials from the first one on that has no answer, until all have one or the window is closed. `keep` hears of
// every answer at once. Fails on pictures that cannot be read, that differ in size, or that have no room side by side.
Result<void> run_study_window(const calibration::Study& study, const std::vector<calibration::StudyTrial>& trials,
                              std::size_t first, const StudyWindowOptions& options,
                              const std::function<Result<void>(const calibration::StudyAnswer&)>& keep);

} // namespace unseen::app
