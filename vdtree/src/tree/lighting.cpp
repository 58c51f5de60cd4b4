#include <unseen/vdtree/lighting.h>

#include <limits>

#include "tree/unchecked_links.h"
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/light_bounds.h>
#include <unseen/vdtree/internal/vectors.h>
#include <unseen/vdtree/internal/vertex_tree_data.h>

namespace unseen::vdtree {

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// What a direction may be longer or shorter than 1 by rounding.
constexpr double unit_rounding = 1e-6;
// The least angle between the inner and the outer cosine of a spot, as their difference: below, its edge is as hard as
// none.
constexpr double least_edge = 1e-5;
// A light so near to a vertex, in radii of the tree, lies on it.
constexpr double least_light_distance = 1e-4;
// Squares of places and distances fit floats, and so does the light of one light anywhere.
constexpr double farthest = 1e18;  // mesh units
constexpr double brightest = 1e12; // relative luminance
// What a change of intensity counts as, in radians for a change of its logarithm.
constexpr double radians_per_log_intensity = 8;

Error invalid(const std::string& field, const std::string& must) {
    return invalid_argument(field + " must " + must + ".");
}

Result<void> validate(const LightSource& light, const std::string& name) {
    using Kind = LightSource::Kind;
    if (!(light.intensity >= 0 && light.intensity <= brightest))
        return invalid(name + ".intensity", "be a number from 0 to 1e12");
    if (light.kind != Kind::point && !(std::abs(glm::length(light.direction) - 1) <= unit_rounding))
        return invalid(name + ".direction", "have a length, and be finite");
    if (light.kind == Kind::directional) return {};
    if (!(glm::length(light.position) <= farthest))
        return invalid(name + ".position", "be finite, and at most 1e18 mesh units away");
    if (!(light.distance > 0 && light.distance <= farthest))
        return invalid(name + ".distance", "be positive, and at most 1e18 mesh units");
    if (light.kind == Kind::point) return {};
    if (!(light.outer_cosine >= -1 && light.inner_cosine <= 1 && light.inner_cosine - light.outer_cosine >= least_edge))
        return invalid(name + ".inner_degrees",
                       "be less than outer_degrees, by a degree or so, and outer_degrees at most 180");
    return {};
}

// ---- where a light is

double nearest_vertex_distance(const VertexTree& tree, glm::dvec3 point) {
    double nearest = infinity;
    std::vector<NodeId> waiting = {VertexTree::root()};
    while (!waiting.empty()) {
        const NodeId node = waiting.back();
        waiting.pop_back();
        const Sphere& support = tree.support_spheres()[node];
        if (glm::length(point - glm::dvec3(support.centre)) - static_cast<double>(support.radius) >= nearest) continue;
        tree.for_each_child(node, [&](NodeId child) {
            if (tree.is_place(child))
                nearest = std::min(nearest, glm::length(point - glm::dvec3(tree.position(child))));
            else waiting.push_back(child);
        });
    }
    return nearest;
}

bool ray_meets(const Sphere& sphere, glm::dvec3 origin, glm::dvec3 direction) {
    const glm::dvec3 to_centre = glm::dvec3(sphere.centre) - origin;
    const double along = glm::dot(to_centre, direction), radius = sphere.radius;
    const double squared = glm::dot(to_centre, to_centre);
    return squared <= radius * radius || (along >= 0 && squared - along * along <= radius * radius * (1 + 1e-9));
}

// Whether a ray from outside to `origin` would cross the surface an odd number of times.
bool crosses_oddly(const VertexTree& tree, glm::dvec3 origin, glm::dvec3 direction) {
    const auto& links = unchecked_links(tree);
    bool odd = false;
    std::vector<NodeId> waiting = {VertexTree::root()};
    const auto at = [&](Index leaf) { return glm::dvec3(tree.positions()[tree.wedge_of_leaf(leaf)]) - origin; };
    while (!waiting.empty()) {
        const NodeId node = waiting.back();
        waiting.pop_back();
        if (!tree.is_sound(node) || !ray_meets(tree.bounds()[node].ring, origin, direction)) continue;
        for (Index t = links.first_triangle[node]; t < links.first_triangle[node + 1]; ++t) {
            const Triangle& corners = links.triangles[t];
            const glm::dvec3 a = at(corners[0]), b = at(corners[1]), c = at(corners[2]);
            const double u = glm::dot(direction, glm::cross(b, c)), v = glm::dot(direction, glm::cross(c, a)),
                         w = glm::dot(direction, glm::cross(a, b));
            if (!((u > 0 && v > 0 && w > 0) || (u < 0 && v < 0 && w < 0))) continue;
            const double along =
                (u * glm::dot(a, direction) + v * glm::dot(b, direction) + w * glm::dot(c, direction)) / (u + v + w);
            if (along > 0) odd = !odd;
        }
        tree.for_each_child(node, [&](NodeId child) {
            if (!tree.is_place(child)) waiting.push_back(child);
        });
    }
    return odd;
}

// By most of three rays: one may pass through an edge.
bool is_inside(const VertexTree& tree, glm::dvec3 point) {
    const glm::dvec3 directions[] = {{0.5773, 0.6219, 0.5291}, {-0.7043, 0.1907, 0.6839}, {0.2287, -0.9161, 0.3296}};
    int odd = 0;
    for (const glm::dvec3& direction : directions) odd += crosses_oddly(tree, point, glm::normalize(direction));
    return odd >= 2;
}

} // namespace

Result<void> validate(const Lighting& lighting) {
    if (lighting.lights.size() > most_lights)
        return invalid_argument("lights: there are " + std::to_string(lighting.lights.size()) + ", but at most " +
                                std::to_string(most_lights) + " can be drawn.");
    for (const auto& [name, value] : {std::pair("ambient", lighting.ambient), {"material.specular", lighting.specular}})
        if (!(value >= 0 && value <= 1)) return invalid(name, "be from 0 to 1");
    if (!(lighting.shininess >= 1 && lighting.shininess <= most_shininess))
        return invalid("material.shininess", "be from 1 to 1024");
    double sum = lighting.ambient;
    for (std::size_t i = 0; i < lighting.lights.size(); ++i) {
        if (auto valid = validate(lighting.lights[i], "lights[" + std::to_string(i) + "]"); !valid) return valid;
        sum += lighting.lights[i].intensity;
    }
    if (const std::size_t casting = shadow_lights(lighting); casting > most_shadow_lights)
        return invalid_argument("lights: " + std::to_string(casting) + " of them cast shadows, but at most " +
                                std::to_string(most_shadow_lights) + " can: let the weaker ones cast none.");
    if (!(sum > 0))
        return invalid_argument(
            "The scene is black: ambient and lights[].intensity are all 0. Give one of them a positive value.");
    return {};
}

std::size_t shadow_lights(const Lighting& lighting) {
    return static_cast<std::size_t>(std::ranges::count(lighting.lights, true, &LightSource::casts_shadow));
}

Result<void> check_lights(const VertexTree& tree, const Lighting& lighting) {
    if (auto valid = validate(lighting); !valid) return valid;
    const Sphere around = tree.bounding_sphere();
    const double radius = around.radius;
    for (std::size_t i = 0; i < lighting.lights.size(); ++i) {
        const LightSource& light = lighting.lights[i];
        if (light.kind == LightSource::Kind::directional) continue;
        const std::string field = "lights[" + std::to_string(i) + "].position";
        if (glm::length(light.position - glm::dvec3(around.centre)) > radius * (1 + 2 * least_light_distance)) continue;
        if (nearest_vertex_distance(tree, light.position) <= radius * least_light_distance)
            return invalid_argument(field + " is at a vertex of the model: move the light away from the surface.");
        if (tree.closedness() != Closedness::open && is_inside(tree, light.position))
            return invalid_argument(field +
                                    " is inside of the model, whose surface is closed: move the light out of it.");
    }
    return {};
}

double lit_luminance(const Lighting& lighting, glm::dvec3 position, glm::dvec3 normal, double albedo, glm::dvec3 eye) {
    double sum = lighting.ambient * albedo;
    for (const LightSource& light : lighting.lights) {
        glm::dvec3 towards = light.direction;
        double intensity = light.intensity;
        if (light.kind != LightSource::Kind::directional) {
            const glm::dvec3 offset = light.position - position;
            const double distance = glm::length(offset);
            if (!(distance > 0)) return 1;
            towards = offset / distance;
            intensity *= (light.distance / distance) * (light.distance / distance);
            if (light.kind == LightSource::Kind::spot)
                intensity *= spot_share(light, -glm::dot(towards, light.direction));
        }
        const double facing = glm::dot(normal, towards);
        if (!(facing > 0)) continue;
        double share = albedo;
        if (lighting.specular > 0) {
            const glm::dvec3 half = unit(towards + unit(eye - position));
            share += lighting.specular * (lighting.shininess + 8) / 8 *
                     std::pow(std::max(0.0, glm::dot(normal, half)), lighting.shininess);
        }
        sum += intensity * facing * share;
    }
    return std::min(sum, 1.0);
}

float albedo_of(const VertexTree& tree, WedgeId wedge) {
    return vertex_luminance(glm::vec3(0), tree.colours().empty() ? nullptr : &tree.colours()[wedge], {}, true,
                            !tree.texture().empty());
}

double light_motion(const VertexTree& tree, const Lighting& from, glm::dvec3 eye_from, const Lighting& to,
                    glm::dvec3 eye_to) {
    if (from.lights.size() != to.lights.size() || from.ambient != to.ambient || from.specular != to.specular ||
        from.shininess != to.shininess)
        return infinity;
    const double radius = tree.bounds()[VertexTree::root()].ring.radius;
    const auto shift = [&](glm::dvec3 a, glm::dvec3 b) { return a == b ? 0.0 : glm::length(b - a) / radius; };
    double most = from.specular > 0 ? shift(eye_from, eye_to) : 0;
    for (std::size_t i = 0; i < from.lights.size(); ++i) {
        const LightSource &a = from.lights[i], &b = to.lights[i];
        if (a.kind != b.kind || a.distance != b.distance || a.inner_cosine != b.inner_cosine ||
            a.outer_cosine != b.outer_cosine || a.casts_shadow != b.casts_shadow)
            return infinity;
        double motion = 0;
        if (a.kind != LightSource::Kind::point && a.direction != b.direction)
            motion += std::atan2(glm::length(glm::cross(a.direction, b.direction)), glm::dot(a.direction, b.direction));
        if (a.kind != LightSource::Kind::directional) motion += shift(a.position, b.position);
        if (a.intensity != b.intensity)
            motion += radians_per_log_intensity * std::abs(std::log(b.intensity / a.intensity));
        if (!(motion <= infinity)) return infinity;
        most = std::max(most, motion);
    }
    return most * (1 + 1e-9); // the rounding of all this
}

} // namespace unseen::vdtree
