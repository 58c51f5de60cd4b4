// Reads files of lights, and moves the lights.
#include <unseen/calibration/light_rig.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "json_file.h"

namespace unseen::calibration {
namespace {

using Kind = vdtree::LightSource::Kind;
using nlohmann::json;

// Beyond, single floats overflow where distances are squared; nothing is so bright or so far away.
constexpr double brightest = 1e6, farthest = 1e12; // times white; world units
constexpr Range distance_range{.minimum = 0, .maximum = farthest, .minimum_allowed = false};
constexpr Range intensity_range{.minimum = 0, .maximum = brightest};
constexpr Range any_number{.minimum = -unbounded, .maximum = unbounded};
constexpr Range half_angle{.minimum = 0, .maximum = 180};
constexpr double fastest_deg_per_s = 360000; // a thousand turns a second
// Directions within this many radians of being opposite have no shorter arc between them.
constexpr double opposite = 1e-6;

std::string too_many_cast(std::size_t casting) {
    return std::to_string(casting) + " lights that cast shadows, but at most " +
           std::to_string(vdtree::most_shadow_lights) + " can: give the weaker ones no \"shadow\"";
}

double radians(double degrees) { return degrees * std::numbers::pi / 180; }

glm::dvec3 vector(const JsonObject& object, std::string_view key) {
    if (!object.has(key)) {
        object.fail_at(key, "is missing: it must be an array of three numbers");
        return glm::dvec3(0);
    }
    const std::vector<double> v = object.numbers(object[key], std::string(key), 3);
    if (!std::ranges::all_of(v, [](double x) { return std::isfinite(x); }))
        object.fail_at(key, "must have finite numbers");
    return {v[0], v[1], v[2]};
}

glm::dvec3 location(const JsonObject& object, std::string_view key) {
    const glm::dvec3 v = vector(object, key);
    for (int k = 0; k < 3; ++k)
        if (std::abs(v[k]) > farthest)
            object.fail_at(key, "must lie within 1e12 world units of the origin, but has " + number_text(v[k]));
    return v;
}

// Scaled first, so that neither tiny nor huge directions under- or overflow when squared.
glm::dvec3 direction(const JsonObject& object, std::string_view key) {
    const glm::dvec3 v = vector(object, key);
    const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
    if (!(largest > 0)) object.fail_at(key, "must not be 0, 0, 0: that is no direction");
    return glm::normalize(v / largest);
}

double angle_between(glm::dvec3 a, glm::dvec3 b) { return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)); }

glm::dvec3 along_arc(glm::dvec3 a, glm::dvec3 b, double share_of_way) {
    const glm::dvec3 axis = glm::cross(a, b);
    const double sine = glm::length(axis);
    if (!(sine > 0)) return a;
    return glm::angleAxis(share_of_way * angle_between(a, b), axis / sine) * a;
}

} // namespace

struct LightRig::Reader {
    LightRig rig;

    Result<void> read(const std::filesystem::path& file) {
        rig.file_ = file;
        const JsonObject object(file, {"ambient", "material", "lights"});
        object.get("ambient", rig.ambient_, zero_to_one);
        if (object.has("material")) read_material(object);
        const json& lights = object.array("lights");
        if (lights.size() > vdtree::most_lights)
            object.fail_at("lights", "has " + std::to_string(lights.size()) + " lights, but at most " +
                                         std::to_string(vdtree::most_lights) + " can be drawn");
        for (const json& value : lights) {
            read_light(object, value);
            if (!object) return object.error();
        }
        const std::size_t casting = rig.casting().size();
        if (casting > vdtree::most_shadow_lights) object.fail_at("lights", "has " + too_many_cast(casting));
        const bool is_lit = std::ranges::any_of(rig.lights_, [](const Light& light) {
            if (light.keys.empty()) return light.at_rest.intensity > 0;
            return std::ranges::any_of(light.keys, [](const Key& key) { return key.intensity > 0; });
        });
        if (!is_lit && !(rig.ambient_ > 0))
            object.fail(
                "the scene is black: give key \"ambient\" or the \"intensity\" of one of the lights a value above 0");
        return object ? Result<void>() : object.error();
    }

private:
    void read_material(const JsonObject& file) {
        const JsonObject material = file.child(file["material"], "material", {"specular", "shininess"});
        rig.specular_ = material.number("specular", zero_to_one);
        rig.shininess_ = material.number("shininess", {.minimum = 1, .maximum = vdtree::most_shininess});
    }

    // The keys that each type has, all of them wanted, but for the motions.
    JsonObject object_of(const JsonObject& file, const json& value, const std::string& place, std::string& type) {
        if (!value.is_object() || !value.contains("type") || !value["type"].is_string())
            file.fail_at(place, "must be an object with a key \"type\": directional, point, spot or headlight");
        else type = value["type"].get<std::string>();
        if (type == "directional")
            return file.child(value, place, {"type", "direction", "intensity", "shadow", "orbit", "keyframes"});
        if (type == "point")
            return file.child(value, place,
                              {"type", "position", "intensity", "distance", "shadow", "orbit", "keyframes"});
        if (type == "spot")
            return file.child(value, place,
                              {"type", "position", "direction", "intensity", "distance", "inner_degrees",
                               "outer_degrees", "shadow", "orbit", "keyframes"});
        if (type != "headlight")
            file.fail_at(place + ".type", "must be directional, point, spot or headlight, but is " + to_json(type));
        return file.child(value, place, {"type", "intensity"});
    }

    void read_light(const JsonObject& file, const json& value) {
        std::string type;
        const JsonObject object = object_of(file, value, in_brackets("lights", rig.lights_.size()), type);
        Light& light = rig.lights_.emplace_back();
        vdtree::LightSource& source = light.at_rest;
        light.is_headlight = type == "headlight";
        source.kind = type == "point" ? Kind::point : type == "spot" ? Kind::spot : Kind::directional;
        source.intensity = object.number("intensity", intensity_range);
        if (type == "directional" || type == "spot") source.direction = direction(object, "direction");
        if (source.kind != Kind::directional) {
            source.position = location(object, "position");
            source.distance = object.number("distance", distance_range);
        }
        if (source.kind == Kind::spot) read_angles(object, source);
        object.get("shadow", source.casts_shadow);
        if (object.has("orbit") && object.has("keyframes"))
            object.fail_at("orbit", "and \"keyframes\" exclude each other: remove one");
        if (object.has("orbit")) read_orbit(object, light);
        if (object.has("keyframes")) read_keys(object, light);
        rig.moves_ = rig.moves_ || light.degrees_per_second != 0 || light.keys.size() > 1;
        rig.follows_camera_ = rig.follows_camera_ || light.is_headlight;
    }

    void read_angles(const JsonObject& object, vdtree::LightSource& source) {
        const double inner = object.number("inner_degrees", half_angle),
                     outer = object.number("outer_degrees", half_angle);
        source.inner_cosine = std::cos(radians(inner));
        source.outer_cosine = std::cos(radians(outer));
        constexpr double least_edge_deg = 0.5;
        if (!(outer - inner >= least_edge_deg))
            object.fail_at("inner_degrees", "must be half a degree less than outer_degrees, at least");
    }

    void read_orbit(const JsonObject& object, Light& light) {
        const bool has_position = light.at_rest.kind != Kind::directional;
        const JsonObject orbit = has_position
                                     ? object.child(object["orbit"], "orbit", {"axis", "degrees_per_second", "centre"})
                                     : object.child(object["orbit"], "orbit", {"axis", "degrees_per_second"});
        light.axis = direction(orbit, "axis");
        light.degrees_per_second =
            orbit.number("degrees_per_second", {.minimum = -fastest_deg_per_s, .maximum = fastest_deg_per_s});
        light.has_centre = orbit.has("centre");
        if (light.has_centre) light.centre = location(orbit, "centre");
    }

    void read_keys(const JsonObject& object, Light& light) {
        const json& keys = object.array("keyframes");
        if (keys.empty()) object.fail_at("keyframes", "is empty");
        for (const json& value : keys) {
            const JsonObject frame = object.child(value, in_brackets("keyframes", light.keys.size()),
                                                  {"time_s", "position", "direction", "intensity"});
            if (!frame) return;
            for (const char* key : {"position", "direction", "intensity"})
                if (value.contains(key) != keys[0].contains(key))
                    frame.fail_at(key, "must be in all keyframes of the light, or in none");
            if (frame.has("position") && light.at_rest.kind == Kind::directional)
                frame.fail_at("position", "is nothing that a directional light has");
            if (frame.has("direction") && light.at_rest.kind == Kind::point)
                frame.fail_at("direction", "is nothing that a point light has");
            Key key{0, light.at_rest.position, light.at_rest.direction, light.at_rest.intensity};
            key.seconds = frame.number("time_s", any_number);
            if (!light.keys.empty() && !(key.seconds > light.keys.back().seconds))
                frame.fail_at("time_s", "must be later than that of the keyframe before");
            frame.get("intensity", key.intensity, intensity_range);
            if (frame.has("position")) key.position = location(frame, "position");
            if (frame.has("direction")) {
                key.direction = direction(frame, "direction");
                if (!light.keys.empty() &&
                    angle_between(light.keys.back().direction, key.direction) > std::numbers::pi - opposite)
                    frame.fail_at(
                        "direction",
                        "is opposite to the one before: put a keyframe between them that says which way round");
            }
            light.keys.push_back(key);
        }
    }
};

Result<LightRig> LightRig::read(const std::filesystem::path& file) {
    Reader reader;
    if (auto ok = reader.read(file); !ok) return ok.error();
    return std::move(reader.rig);
}

Result<LightRig> LightRig::of(vdtree::Lighting lighting, std::filesystem::path file) {
    if (const auto valid = vdtree::validate(lighting); !valid)
        return Error{valid.error().code, file.string() + ": " + valid.error().message};
    LightRig rig;
    rig.file_ = std::move(file);
    rig.ambient_ = lighting.ambient;
    rig.specular_ = lighting.specular;
    rig.shininess_ = lighting.shininess;
    for (const vdtree::LightSource& source : lighting.lights) rig.lights_.emplace_back().at_rest = source;
    return rig;
}

Result<void> LightRig::set_shadows(bool cast) {
    const auto can = [](const Light& light) { return !light.is_headlight; };
    const auto casting = static_cast<std::size_t>(std::count_if(lights_.begin(), lights_.end(), can));
    if (cast && casting > vdtree::most_shadow_lights)
        return Error{ErrorCode::invalid_argument,
                     file_.string() + ": it has " + too_many_cast(casting) + ", and do not let all of them cast one."};
    for (Light& light : lights_) light.at_rest.casts_shadow = cast && can(light);
    return {};
}

std::vector<std::size_t> LightRig::casting() const {
    std::vector<std::size_t> numbers;
    for (std::size_t i = 0; i < lights_.size(); ++i)
        if (lights_[i].at_rest.casts_shadow) numbers.push_back(i);
    return numbers;
}

vdtree::Lighting LightRig::at(double seconds, const vdtree::VertexTree& tree, const vdtree::View& view,
                              const vdtree::Similarity& placement) const {
    vdtree::Lighting lighting;
    lighting.ambient = ambient_;
    lighting.specular = specular_;
    lighting.shininess = shininess_;
    for (const Light& light : lights_) {
        vdtree::LightSource source = light.at_rest;
        if (light.is_headlight) source.direction = vdtree::camera_frame(view).back;
        if (!light.keys.empty()) {
            const auto next = std::upper_bound(light.keys.begin(), light.keys.end(), seconds,
                                               [](double s, const Key& key) { return s < key.seconds; });
            const Key& to = next == light.keys.end() ? light.keys.back() : *next;
            const Key& from = next == light.keys.begin() ? light.keys.front() : *std::prev(next);
            const double way = to.seconds > from.seconds ? (seconds - from.seconds) / (to.seconds - from.seconds) : 0;
            source.position = from.position + way * (to.position - from.position);
            source.direction = along_arc(from.direction, to.direction, way);
            source.intensity = from.intensity + way * (to.intensity - from.intensity);
        }
        if (light.degrees_per_second != 0) {
            const glm::dvec3 model = placement.to_world(tree.origin() + glm::dvec3(tree.bounding_sphere().centre));
            const glm::dvec3 centre = light.has_centre ? light.centre : model;
            const glm::dquat turn =
                glm::angleAxis(radians(std::fmod(light.degrees_per_second * seconds, 360)), light.axis);
            source.position = centre + turn * (source.position - centre);
            source.direction = turn * source.direction;
        }
        source.position = placement.to_mesh(source.position) - tree.origin();
        source.direction = glm::normalize(placement.direction_to_mesh(source.direction));
        source.distance /= placement.scale;
        if (source.kind == Kind::directional) source.position = glm::dvec3(0), source.distance = 1;
        if (source.kind == Kind::point) source.direction = glm::dvec3(0, 0, 1);
        lighting.lights.push_back(source);
    }
    return lighting;
}

LightRig::Stretch LightRig::stretch_at(double seconds) const {
    constexpr double most_degrees = 15, parts_of_way = 8;
    double length = std::numeric_limits<double>::infinity();
    for (const Light& light : lights_) {
        if (light.degrees_per_second != 0) length = std::min(length, most_degrees / std::abs(light.degrees_per_second));
        for (std::size_t i = 1; i < light.keys.size(); ++i)
            length = std::min(length, (light.keys[i].seconds - light.keys[i - 1].seconds) / parts_of_way);
    }
    if (!(length > 0) || !std::isfinite(length)) return {0, seconds, seconds};
    constexpr double most_stretches = 1e15; // counted exactly
    const double number = std::clamp(std::floor(seconds / length), -most_stretches, most_stretches);
    return {static_cast<std::int64_t>(number), number * length, (number + 1) * length};
}

std::string LightRig::description() const {
    std::map<std::string, int> counts;
    for (const Light& light : lights_) {
        const Kind kind = light.at_rest.kind;
        ++counts[light.is_headlight    ? "headlight"
                 : kind == Kind::point ? "point"
                 : kind == Kind::spot  ? "spot"
                                       : "directional"];
    }
    std::string text;
    for (const auto& [name, count] : counts) text += (text.empty() ? "" : ", ") + std::to_string(count) + " " + name;
    if (ambient_ > 0) text += (text.empty() ? "ambient " : ", ambient ") + number_text(ambient_);
    if (specular_ > 0) text += ", highlights of " + number_text(specular_);
    return text;
}

} // namespace unseen::calibration
