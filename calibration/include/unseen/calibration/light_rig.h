// The lights of a scene, described by a JSON file, and their places over time.
//
//   {"ambient": 0.1, "material": {"specular": 0.04, "shininess": 40},
//    "lights": [{"type": "directional", "direction": [0.4, 0.7, 0.6], "intensity": 0.7,
//                "shadow": true, "orbit": {"axis": [0, 1, 0], "degrees_per_second": 60}},
//               {"type": "point", "position": [1, 2, 3], "intensity": 0.5, "distance": 3,
//                "keyframes": [{"time_s": 0, "position": [1, 2, 3]}, {"time_s": 2, "position": [-1, 2, 3]}]},
//               {"type": "spot", "position": [0, 3, 0], "direction": [0, -1, 0],
//                "inner_degrees": 20, "outer_degrees": 30,
//                "intensity": 1, "distance": 3},
//               {"type": "headlight", "intensity": 0.3}]}
//
// "ambient" and "material" are optional (default: no ambient light, no highlights). A light needs every key of its type;
// "shadow", "orbit" and "keyframes" are optional. Positions and distances are in world units (metres). "direction" points
// towards a directional light, but along a spot's beam. "intensity" is the relative luminance of white that faces the
// light, at "distance" if the light has a position. Lights with "shadow": true cast shadows; others, and all headlights,
// shine through everything. A headlight shines from the camera's direction. An orbit turns position and direction about
// an axis through "centre" (default: the model's). Keyframes, at ascending times, give the same ones of position,
// direction and intensity; between them positions and intensities are interpolated linearly, directions along the shorter
// arc; before the first and after the last they stay.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <unseen/vdtree/lighting.h>
#include <unseen/vdtree/view.h>

namespace unseen::calibration {

class LightRig {
public:
    // Errors name the file and the key.
    static Result<LightRig> read(const std::filesystem::path& file);

    // Lights that stand still; positions and distances in world units. `file`: their source, for messages. Fails if
    // vdtree::validate() fails.
    static Result<LightRig> of(vdtree::Lighting lighting, std::filesystem::path file);

    // Makes all lights except headlights cast shadows, or none. Fails, and changes nothing, if that would be more than
    // vdtree::most_shadow_lights.
    Result<void> set_shadows(bool cast);

    // The lights at a time, in the frame of a tree.
    vdtree::Lighting at(double seconds, const vdtree::VertexTree& tree, const vdtree::View& view,
                        const vdtree::Similarity& placement) const;

    // A stretch of time within which lights move little: none turns around its orbit by more than 15 degrees, or passes more
    // than an eighth of the way between two keyframes. Stretches follow each other without gaps.
    struct Stretch {
        std::int64_t number = 0;
        double begin = 0, end = 0; // seconds
    };
    Stretch stretch_at(double seconds) const; // all of time if nothing moves

    std::size_t light_count() const noexcept { return lights_.size(); }
    std::vector<std::size_t> casting() const; // the numbers of lights that cast shadows

    bool moves() const noexcept { return moves_; } // with time
    bool follows_camera() const noexcept { return follows_camera_; }
    // Whether the lights are the same at all times and from everywhere; highlights still follow the eye.
    bool stands_still() const noexcept { return !moves_ && !follows_camera_; }
    std::string description() const; // for people: "1 directional and 2 point lights, ambient 0.1"
    const std::filesystem::path& file() const noexcept { return file_; }

private:
    struct Key {
        double seconds = 0;
        glm::dvec3 position = glm::dvec3(0), direction = glm::dvec3(0, 0, 1);
        double intensity = 0;
    };
    struct Light {
        vdtree::LightSource at_rest; // in the world
        bool is_headlight = false;
        std::vector<Key> keys; // empty, or at least one
        double degrees_per_second = 0;
        glm::dvec3 axis = glm::dvec3(0, 1, 0), centre = glm::dvec3(0); // of an orbit
        bool has_centre = false;
    };
    struct Reader;

    std::filesystem::path file_;
    double ambient_ = 0, specular_ = 0, shininess_ = 32;
    std::vector<Light> lights_;
    bool moves_ = false, follows_camera_ = false;
};

} // namespace unseen::calibration
