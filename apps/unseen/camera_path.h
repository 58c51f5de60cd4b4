// Where a camera goes, frame by frame: around a model, or as a file has it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <vdtree/result.h>
#include <vdtree/view.h>

namespace unseen::app {

// One frame. Points in world units.
struct CameraPose {
    glm::dvec3 eye, target, up;
    std::optional<glm::dvec2> gaze_px; // all poses of a path have one, or none has
};

// "orbit:DEGREES[:FRAMES]": around the first view's target about its up vector, so many degrees from each frame to the next
// (negative: the other way); without a count, once around. The first frame is the first view.
// Otherwise the name of a CSV file: a header line that names the columns eye_x, eye_y, eye_z, target_x, target_y, target_z and
// optionally up_x, up_y, up_z (default: the first view's) and gaze_x, gaze_y (pixels), in any order; then one line a frame.
// Empty lines are skipped. Errors name the file, line and column.
Result<std::vector<CameraPose>> read_camera_path(const std::string& path, const vdtree::View& first);

inline constexpr int most_path_frames = 1'000'000;

} // namespace unseen::app
