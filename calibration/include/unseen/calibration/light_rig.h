// The lights of a scene as a JSON file describes them, and where they are at a time.
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
// "ambient" and "material" may be missing (0: no ambient light, no highlights); of a light everything is wanted that
// its type has, but for "orbit" or "keyframes". Positions and distances in world units (metres); "direction" leads
// towards a directional light, and to where a spot shines. "intensity" is the relative luminance of white that faces
// the light: at "distance", where the light has a position. With "shadow": true it casts shadows; without, and headlights
// always, it shines through everything. A headlight shines from the camera's direction. An orbit
// turns position and direction about an axis through "centre" (default: the model's). Keyframes give any of position,
// direction and intensity, all the same ones, at ascending times; in between, positions and intensities go straight and
// directions along the shorter arc; before and after, they stay.
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

    // Lights that stand still, in the world: places and distances in world units. `file`: where they are from, for
    // messages. Fails where vdtree::validate() does.
    static Result<LightRig> of(vdtree::Lighting lighting, std::filesystem::path file);

    // From now on all lights but headlights cast shadows, or none does. Fails on more that could than
    // vdtree::most_shadow_lights; then all stays.
    Result<void> set_shadows(bool cast);

    // Where the lights are, in the frame of a tree.
    vdtree::Lighting at(double seconds, const vdtree::VertexTree& tree, const vdtree::View& view,
                        const vdtree::Similarity& placement) const;

    std::size_t light_count() const noexcept { return lights_.size(); }
    std::vector<std::size_t> casting() const; // the numbers of those that cast shadows

    bool moves() const noexcept { return moves_; } // with time
    bool follows_camera() const noexcept { return follows_camera_; }
    // Whether they are the same at all times and from everywhere, but for highlights.
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
