#include "turning_light.h"

#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>

namespace unseen::app {

vdtree::Lighting lighting_at(const vdtree::VertexTree& tree, TurningLight kind, double degrees) {
    const double angle = degrees * std::numbers::pi / 180;
    const glm::dvec3 direction = glm::normalize(glm::dvec3(std::sin(angle), 0.7, std::cos(angle)));
    const vdtree::Sphere around = tree.bounding_sphere();
    vdtree::LightSource light;
    light.intensity = 0.8;
    light.direction = direction;
    if (kind == TurningLight::point) {
        light.kind = vdtree::LightSource::Kind::point;
        light.direction = {0, 0, 1};
        light.distance = 3 * static_cast<double>(around.radius);
        light.position = glm::dvec3(around.centre) + light.distance * direction;
    }
    vdtree::Lighting lighting;
    lighting.lights = {light};
    lighting.ambient = 0.2;
    if (kind == TurningLight::highlights) lighting.specular = 0.04;
    return lighting;
}

} // namespace unseen::app
