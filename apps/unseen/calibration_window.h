// The calibration's window: gratings, keys, and what is done with them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <unseen/calibration/procedure.h>
#include <unseen/perception/display.h>
#include <unseen/vdtree/result.h>

namespace unseen::app {

struct CalibrationWindowOptions {
    perception::Display display;
    bool full_screen = false;
    double interval_s = 0.5;  // of a grating, and of the pause between two
    double fade_per_s = 0.25; // of gratings that fade in and out, log10 units
    std::string screenshot;   // PNG of the last thing shown
};

inline constexpr const char* calibration_window_help =
    R"(In the window: look at the cross, from the display's distance; gratings may appear beside it
  2ifc        one and two dots under the cross mark two intervals: 1 or 2, in which was the grating?
  adjustment  space or return when it appears (fading in) or vanishes (fading out); arrows change the
              contrast by hand; n when it cannot be seen at all
  --gamma     arrows and page keys until both halves are equally bright, then return
  q, Esc      stop; with --resume the answers are kept
)";

// Shows the procedure's trials until it is done or the window is closed. After every answer the state goes to `state`,
// unless that is empty.
Result<void> run_calibration_window(calibration::Procedure& procedure, const CalibrationWindowOptions& options,
                                    const std::filesystem::path& state);

// Patches are matched to rows of black and white; what the codes say about the display's gamma. Empty where the window
// was closed.
struct GammaMatch {
    double share; // of white rows
    double code;  // 0..1, which looks as bright
};
Result<std::vector<GammaMatch>> match_gamma(const CalibrationWindowOptions& options);

} // namespace unseen::app
