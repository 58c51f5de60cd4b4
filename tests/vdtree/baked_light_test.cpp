// Light in colours: found where it was baked in, and not where it was not.
#include <unseen/vdtree/internal/baked_light.h>

#include <glm/trigonometric.hpp>

#include "built.h"
#include "shapes.h"
#include "testing.h"
#include "textures.h"

namespace unseen::vdtree::baked_light_test {

using support::built;

const glm::dvec3 sun = glm::normalize(glm::dvec3(-2, 1, 2));

double shading(glm::dvec3 normal) { return 0.1 + 0.9 * std::max(0.0, glm::dot(normal, sun)); }

// `grey`: of the vertex's place.
template <class Grey>
Mesh painted(Mesh mesh, Grey&& grey) {
    for (const glm::dvec3& p : mesh.positions) {
        const auto g = static_cast<float>(grey(p));
        mesh.colours.push_back({g, g, g, 1});
    }
    return mesh;
}

BakedLight found(const Mesh& mesh) {
    const auto light = require(find_baked_light(built(mesh)));
    return *light;
}

double degrees_from_the_sun(const BakedLight& light) {
    return glm::degrees(std::acos(std::min(1.0, glm::dot(glm::dvec3(light.direction), sun))));
}

TEST(BakedLight, IsFoundWhereItIsAllThereIs) {
    const BakedLight light =
        found(painted(shapes::icosphere(5), [](glm::dvec3 p) { return shading(glm::normalize(p)); }));
    EXPECT_LT(degrees_from_the_sun(light), 0.5);
    EXPECT_GT(light.explained, 0.999);
}

// Light of a tenth to the whole on paint of a half to the whole.
TEST(BakedLight, IsFoundOverPaint) {
    const auto paint = [](glm::dvec3 p) { return std::sin(20 * p.x) * std::sin(20 * p.y) > 0 ? 1.0 : 0.5; };
    const BakedLight light =
        found(painted(shapes::icosphere(5), [&](glm::dvec3 p) { return paint(p) * shading(glm::normalize(p)); }));
    EXPECT_LT(degrees_from_the_sun(light), 5);
    EXPECT_GT(light.explained, telling_share);
    EXPECT_LT(light.explained, 0.95);
}

TEST(BakedLight, IsFoundInTextures) {
    Texture texture{64, 64, Wrap::clamp, Wrap::clamp, {}}; // a photograph from the front of a ball
    for (int y = 0; y < 64; ++y)
        for (int x = 0; x < 64; ++x) {
            const glm::dvec2 p((x + 0.5) / 32 - 1, (y + 0.5) / 32 - 1);
            const glm::dvec3 normal(p, std::sqrt(std::max(0.0, 1 - glm::dot(p, p))));
            const auto code = static_cast<std::uint8_t>(255 * std::pow(shading(glm::normalize(normal)), 1 / 2.2));
            texture.texels.push_back({code, code, code, 255});
        }
    Mesh front = textures::textured_sphere(4, texture);
    std::erase_if(front.triangles, [&](const Triangle& t) { return front.positions[t[0]].z < 0; });
    const BakedLight light = found(front);
    EXPECT_LT(degrees_from_the_sun(light), 5);
    EXPECT_GT(light.explained, 0.9);
}

TEST(BakedLight, IsNotFoundInPaint) {
    const auto explained = [](const Mesh& mesh) { return found(mesh).explained; };
    EXPECT_EQ(explained(shapes::icosphere(3)), 0) << "no colours";
    EXPECT_EQ(explained(painted(shapes::icosphere(3), [](glm::dvec3) { return 0.5; })), 0) << "one colour";
    EXPECT_LT(explained(painted(shapes::icosphere(5),
                                [](glm::dvec3 p) { return std::sin(9 * p.x) * std::sin(9 * p.y) > 0 ? 0.9 : 0.1; })),
              0.1);
    EXPECT_LT(explained(textures::textured_sphere(4, textures::noise(64, 64, 2))), 0.1);
    EXPECT_EQ(explained(painted(shapes::grid(9), [](glm::dvec3 p) { return p.x > 0.5 ? 0.9 : 0.1; })), 0) << "a plane";
    // Two parts of different colours, each with normals to all sides.
    EXPECT_LT(explained(painted(shapes::together(shapes::icosphere(4), shapes::placed(shapes::cube(6), 1, {0, 0, 4})),
                                [](glm::dvec3 p) { return p.z > 2 ? 0.9 : 0.2; })),
              0.1);
}

// The six sides of a box, each in another grey: any three numbers and a constant fit six values rather well.
TEST(BakedLight, IsSeldomFoundByChance) {
    std::mt19937_64 random(4);
    int hints = 0;
    constexpr int trials = 100;
    for (int trial = 0; trial < trials; ++trial) {
        double greys[6];
        for (double& grey : greys) grey = shapes::random_between(random, 0.1, 1);
        Mesh box = shapes::unwelded(shapes::cube(3));
        for (const Triangle& t : box.triangles) {
            const glm::dvec3 a = box.positions[t[0]], b = box.positions[t[1]], c = box.positions[t[2]];
            const glm::dvec3 normal = glm::normalize(glm::cross(b - a, c - a));
            int side = 0;
            for (int k = 0; k < 3; ++k)
                if (std::abs(normal[k]) > 0.9) side = 2 * k + (normal[k] > 0);
            box.colours.resize(box.positions.size());
            for (const Index v : t) box.colours[v] = glm::vec4(glm::vec3(static_cast<float>(greys[side])), 1);
        }
        hints += found(box).explained > telling_share;
    }
    EXPECT_LT(hints, trials / 4);
}

} // namespace unseen::vdtree::baked_light_test
