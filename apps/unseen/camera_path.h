// Where a camera goes, frame by frame: around a model, or as a file has it.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <unseen/vdtree/result.h>
#include <unseen/vdtree/view.h>

namespace unseen::app {

// One frame. Points in world units.
struct CameraPose {
    glm::dvec3 eye, target, up;
    std::optional<glm::dvec2> gaze_px; // all poses of a path have one, or none has
};

// Around the first view's target about its up vector. The first frame is the first view.
struct Orbit {
    double degrees = 0; // from each frame to the next; negative: the other way
    int frames = 1;
};

// Straight towards the first view's target, and past it, at 60 frames a second. The first frame is the first view.
struct Walk {
    double metres_a_second = 1.5; // a walker's; negative: backwards
    int frames = 60;
};

// What can be read before there is a view to begin with.
class CameraPath {
public:
    // "orbit:DEGREES[:FRAMES]": see Orbit; without a count, once around.
    // "walk[:METRES_A_SECOND[:FRAMES]]": see Walk.
    // Otherwise the name of a CSV file: a header line that names the columns eye_x, eye_y, eye_z, target_x, target_y,
    // target_z and optionally up_x, up_y, up_z (default: `up`) and gaze_x, gaze_y (pixels), in any order; then one line
    // a frame. Empty lines are skipped. Errors name the file, line and column.
    static Result<CameraPath> read(const std::string& path, glm::dvec3 up);

    std::vector<CameraPose> poses_from(const vdtree::View& first) const;
    bool has_gaze() const; // the file says where the viewer looks

private:
    using Way = std::variant<Orbit, Walk, std::vector<CameraPose>>;
    explicit CameraPath(Way way) : way_(std::move(way)) {}

    Way way_;
};

inline constexpr int most_path_frames = 1'000'000;

} // namespace unseen::app
