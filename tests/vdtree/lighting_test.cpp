// Lights: shading of known cases, bounds against brute force, how fast they may change, and cuts that follow lights
// that move.
#include <unseen/vdtree/lighting.h>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/internal/contrast_classes.h>
#include <unseen/vdtree/internal/light_bounds.h>

#include "cut/kernel/lit_kernel.h"
#include "shapes.h"
#include "sound.h"
#include "testing.h"
#include "tree_checks.h"

namespace unseen::vdtree::lighting_test {

using Kind = LightSource::Kind;
using shapes::random_between;
using shapes::random_direction;
using shapes::random_unit;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr glm::dvec3 eye_above(0, 0, 10);

LightSource directional(glm::dvec3 towards, double intensity = 1) {
    LightSource light;
    light.direction = glm::normalize(towards);
    light.intensity = intensity;
    return light;
}
LightSource point(glm::dvec3 position, double intensity, double distance) {
    LightSource light;
    light.kind = Kind::point;
    light.position = position;
    light.intensity = intensity;
    light.distance = distance;
    return light;
}
LightSource spot(glm::dvec3 position, glm::dvec3 direction, double inner_degrees, double outer_degrees) {
    LightSource light = point(position, 1, 1);
    light.kind = Kind::spot;
    light.direction = glm::normalize(direction);
    light.inner_cosine = std::cos(inner_degrees * M_PI / 180);
    light.outer_cosine = std::cos(outer_degrees * M_PI / 180);
    return light;
}
Lighting lit_by(const LightSource& light, double ambient = 0) {
    Lighting lighting;
    lighting.lights = {light};
    lighting.ambient = ambient;
    return lighting;
}

double white(const Lighting& lighting, glm::dvec3 normal, glm::dvec3 position = glm::dvec3(0)) {
    return lit_luminance(lighting, position, normal, 1, eye_above);
}

TEST(Shading, OfKnownCases) {
    const glm::dvec3 up(0, 0, 1), tilted(0, std::sqrt(0.75), 0.5);
    EXPECT_DOUBLE_EQ(white(lit_by(directional(up, 0.8)), up), 0.8);
    EXPECT_NEAR(white(lit_by(directional(up, 0.8), 0.1), tilted), 0.5, 1e-15);
    EXPECT_DOUBLE_EQ(white(lit_by(directional(up, 0.8), 0.1), -up), 0.1);
    EXPECT_DOUBLE_EQ(lit_luminance(lit_by(directional(up, 0.8), 0.1), {}, up, 0.5, eye_above), 0.45);
    // No normal: nothing but the ambient light.
    EXPECT_DOUBLE_EQ(white(lit_by(directional(up, 0.8), 0.1), glm::dvec3(0)), 0.1);
    // The display ends at 1.
    EXPECT_DOUBLE_EQ(white(lit_by(directional(up, 3)), up), 1);
    // Twice as far away, a quarter.
    const Lighting near = lit_by(point({0, 0, 2}, 0.5, 2));
    EXPECT_DOUBLE_EQ(white(near, up), 0.5);
    EXPECT_DOUBLE_EQ(white(near, up, {0, 0, -2}), 0.125);
    // Full within the inner angle, nothing beyond the outer one, half of it where the cosine is half-way.
    const double half_way = (std::cos(M_PI / 6) + std::cos(M_PI / 3)) / 2, sine = std::sqrt(1 - half_way * half_way);
    const Lighting torch = lit_by(spot({0, 0, 1}, -up, 30, 60));
    EXPECT_DOUBLE_EQ(white(torch, up), 1);
    EXPECT_DOUBLE_EQ(white(torch, up, {4, 0, 0}), 0);
    const glm::dvec3 aside(sine / half_way, 0, 0);
    EXPECT_NEAR(white(torch, glm::normalize(glm::dvec3(0, 0, 1) - aside), aside), 0.5 * half_way * half_way, 1e-12);
}

TEST(Shading, HasItsHighlightWhereTheHalfVectorIsTheNormal) {
    Lighting lighting = lit_by(directional({0, std::sqrt(0.75), 0.5}, 0.5));
    lighting.specular = 0.1;
    lighting.shininess = 24;
    // Half-way between the light and the eye, at 30 degrees from both: the highlight is at its peak, 0.1 * (24 + 8)
    // / 8.
    const glm::dvec3 half_way(0, 0.5, std::sqrt(0.75));
    EXPECT_NEAR(lit_luminance(lighting, {}, half_way, 0, {0, 0, 1e9}), 0.5 * std::sqrt(0.75) * 0.4, 1e-9);
    EXPECT_LT(lit_luminance(lighting, {}, {0, 1, 0}, 0, {0, 0, 1e9}), 1e-5);
    EXPECT_EQ(lit_luminance(lighting, {}, {0, 0, -1}, 0, {0, 0, 1e9}), 0);
}

TEST(Lights, ThatCannotBeAreRefusedByTheNameOfTheirField) {
    const auto complaint = [](const Lighting& lighting) -> std::string {
        const auto valid = validate(lighting);
        return valid ? std::string() : std::string(valid.error().message);
    };
    const LightSource good = directional({0, 0, 1});
    EXPECT_EQ(complaint(lit_by(good)), "");
    EXPECT_NE(complaint({}).find("The scene is black: ambient and lights[].intensity"), std::string::npos);
    EXPECT_NE(complaint(lit_by(directional({0, 0, 1}, 0))).find("The scene is black"), std::string::npos);
    Lighting two;
    two.lights = {good, good};
    two.lights[1].intensity = -1;
    EXPECT_NE(complaint(two).find("lights[1].intensity"), std::string::npos);
    two.lights[1].intensity = std::nan("");
    EXPECT_NE(complaint(two).find("lights[1].intensity"), std::string::npos);
    two.lights[1] = good;
    two.lights[1].direction = glm::dvec3(0);
    EXPECT_NE(complaint(two).find("lights[1].direction"), std::string::npos);
    EXPECT_NE(complaint(lit_by(point({infinity, 0, 0}, 1, 1))).find("lights[0].position"), std::string::npos);
    EXPECT_NE(complaint(lit_by(point({}, 1, 0))).find("lights[0].distance"), std::string::npos);
    EXPECT_NE(complaint(lit_by(spot({}, {0, 0, 1}, 40, 30))).find("lights[0].inner_degrees"), std::string::npos);
    EXPECT_NE(complaint(lit_by(good, 1.5)).find("ambient"), std::string::npos);
    Lighting shiny = lit_by(good);
    shiny.specular = 2;
    EXPECT_NE(complaint(shiny).find("material.specular"), std::string::npos);
    shiny.specular = 0.1;
    shiny.shininess = 0;
    EXPECT_NE(complaint(shiny).find("material.shininess"), std::string::npos);
    two.lights.assign(most_lights + 1, good);
    EXPECT_NE(complaint(two).find("at most 16"), std::string::npos);
}

// Whatever is taken, its luminances are numbers, and bounds of them hold.
TEST(Lights, AtTheEndsOfWhatIsTakenMakeNumbers) {
    constexpr double farthest = 1e18, brightest = 1e12;
    EXPECT_FALSE(validate(lit_by(point({2 * farthest, 0, 0}, 1, 1))));
    EXPECT_FALSE(validate(lit_by(point({}, 1, 2 * farthest))));
    EXPECT_FALSE(validate(lit_by(point({}, 2 * brightest, 1))));
    const glm::dvec3 eye(0, 0, 3), normal(0, 0, 1);
    VertexCone cone;
    cone.albedo = {0.5f, 0.8f};
    const Sphere sphere{{0, 0, 0}, 0.1f};
    for (const double height : {0.05, 1.0, 1e9, farthest})
        for (const double distance : {1e-18, 1.0, farthest})
            for (const double intensity : {0.0, 1.0, brightest})
                for (const bool is_spot : {false, true}) {
                    LightSource light =
                        is_spot ? spot({0, 0, height}, {0, 0, -1}, 20, 40) : point({0, 0, height}, 1, 1);
                    light.intensity = intensity, light.distance = distance;
                    Lighting lighting = lit_by(light, 0.1);
                    lighting.specular = 0.2;
                    ASSERT_TRUE(validate(lighting));
                    const LuminanceRange range = lit_range(lighting, cone, sphere, eye);
                    const double least = lit_luminance(lighting, {}, normal, 0.5, eye),
                                 most = lit_luminance(lighting, {}, normal, 0.8, eye);
                    ASSERT_TRUE(range.lo <= least && most <= range.hi)
                        << height << " " << distance << " " << intensity << ": " << range.lo << " " << range.hi;
                }
}

TEST(Lights, AtAVertexOrInsideAreRefused) {
    const VertexTree tree = std::move(*build_tree(shapes::torus(24, 12).view(), {.threads = 1}));
    const glm::dvec3 vertex(tree.positions()[tree.wedge_of_leaf(0)]);
    const auto complaint = [&](glm::dvec3 at) {
        const auto checked = check_lights(tree, lit_by(point(at, 1, 1)));
        return checked ? "" : checked.error().message;
    };
    EXPECT_NE(complaint(vertex).find("lights[0].position is at a vertex"), std::string::npos);
    EXPECT_NE(complaint(glm::dvec3(2, 0, 0) - tree.origin()).find("inside"), std::string::npos); // in the tube
    EXPECT_EQ(complaint(-tree.origin()), "");                                                    // in the hole
    EXPECT_EQ(complaint(glm::dvec3(9, 0, 0)), "");
    const VertexTree open = std::move(*build_tree(shapes::grid(8).view(), {.threads = 1}));
    EXPECT_TRUE(check_lights(open, lit_by(point({0.5, 0.5, 0.01}, 1, 1))));
}

Lighting random_lighting(std::mt19937_64& random, const VertexTree& tree, bool shines) {
    const Sphere around = tree.bounds()[0].ring;
    Lighting lighting;
    lighting.ambient = 0.3 * random_unit(random);
    const auto place = [&] {
        return glm::dvec3(around.centre) +
               random_between(random, 0.2, 4) * static_cast<double>(around.radius) * random_direction(random);
    };
    for (std::size_t i = 0; i < 1 + random() % 3; ++i) {
        LightSource light;
        switch (random() % 3) {
        case 0: light = directional(random_direction(random)); break;
        case 1: light = point(place(), 1, around.radius); break;
        default: {
            const glm::dvec3 at = place();
            const double inner = random_between(random, 0, 60);
            light = spot(at,
                         glm::dvec3(around.centre) - at +
                             0.5 * static_cast<double>(around.radius) * random_direction(random),
                         inner, inner + random_between(random, 2, 40));
            light.distance = around.radius;
        }
        }
        light.intensity = random_between(random, 0.1, 1);
        lighting.lights.push_back(light);
    }
    if (shines) {
        lighting.specular = random_between(random, 0.01, 0.3);
        lighting.shininess = std::exp2(random_between(random, 2, 8));
    }
    return lighting;
}

glm::dvec3 random_eye(std::mt19937_64& random, const VertexTree& tree) {
    const Sphere around = tree.bounds()[0].ring;
    return glm::dvec3(around.centre) +
           random_between(random, 0.5, 6) * static_cast<double>(around.radius) * random_direction(random);
}

struct Subject {
    std::string name;
    VertexTree tree;
    LightBounds bounds;
    std::vector<std::vector<WedgeId>> neighbours; // by leaf: nodes of leaves that it shares triangles with
};

const std::vector<Subject>& subjects() {
    static const std::vector<Subject> all = [] {
        std::vector<Subject> made;
        const auto add = [&](const char* name, const Mesh& mesh, ClustererKind kind) {
            VertexTree tree = std::move(*build_tree(mesh.view(), {.clusterer = kind, .threads = 1}));
            LightBounds bounds = std::move(*LightBounds::measure(tree));
            std::vector<std::vector<WedgeId>> neighbours(tree.leaf_count());
            for (const Triangle& t : support::sound(tree).triangles())
                for (const Index a : t)
                    for (const Index b : t) neighbours[a].push_back(tree.wedge_of_leaf(b));
            made.push_back({name, std::move(tree), std::move(bounds), std::move(neighbours)});
        };
        add("bumpy sphere", shapes::bumpy_sphere(3, 0.03), ClustererKind::quadric);
        add("torus, octree", shapes::torus(48, 24), ClustererKind::octree);
        add("coloured", shapes::with_attributes(shapes::bumpy_sphere(3)), ClustererKind::quadric);
        add("soup", shapes::random_soup(300, 900, 3), ClustererKind::octree);
        add("no areas", shapes::with_zero_areas(), ClustererKind::octree);
        return made;
    }();
    return all;
}

// The first lights, as far as they may.
Lighting casting(Lighting lighting, bool some) {
    for (std::size_t i = 0; some && i < std::min(most_shadow_lights, lighting.lights.size()); ++i)
        lighting.lights[i].casts_shadow = true;
    return lighting;
}

// Without some of those that cast shadows.
Lighting hiding(Lighting lighting, std::uint64_t hidden) {
    for (std::size_t i = 0; i < lighting.lights.size(); ++i)
        if (lighting.lights[i].casts_shadow && (hidden >> i & 1) != 0) lighting.lights[i].intensity = 0;
    return lighting;
}

// All vertices that a fold of the node may show.
std::vector<WedgeId> vertices_of(const Subject& s, NodeId node) {
    std::vector<WedgeId> vertices;
    for (NodeId below = node; below < support::sound(s.tree).subtree_end()[node]; ++below)
        for (WedgeId w = s.tree.first_wedge(below); w < s.tree.wedge_end(below); ++w) vertices.push_back(w);
    for (Index leaf = support::sound(s.tree).first_leaf()[node]; leaf < support::sound(s.tree).leaf_end()[node];
         ++leaf) {
        vertices.push_back(s.tree.wedge_of_leaf(leaf));
        vertices.insert(vertices.end(), s.neighbours[leaf].begin(), s.neighbours[leaf].end());
    }
    return vertices;
}

TEST(LightBounds, HoldEveryVertexOfRandomNodes) {
    std::mt19937_64 random(11);
    for (const Subject& s : subjects()) {
        for (int trial = 0; trial < 400; ++trial) {
            const Lighting lighting = casting(random_lighting(random, s.tree, trial % 3 == 0), trial % 4 == 0);
            const Lighting left = hiding(lighting, static_cast<std::uint64_t>(trial / 4));
            const glm::dvec3 eye = random_eye(random, s.tree);
            const NodeId node = static_cast<NodeId>(random() % s.tree.interior_count());
            const LuminanceRange range = lit_range(lighting, s.bounds.cones()[node], s.tree.bounds()[node].ring, eye);
            for (const WedgeId v : vertices_of(s, node)) {
                const double y = lit_luminance(left, glm::dvec3(s.tree.positions()[v]),
                                               glm::dvec3(glm::vec3(s.tree.normals()[v])), albedo_of(s.tree, v), eye);
                ASSERT_GE(y, range.lo) << s.name << ", trial " << trial << ", node " << node;
                ASSERT_LE(y, range.hi) << s.name << ", trial " << trial << ", node " << node;
            }
        }
    }
}

// Any vertex in the sphere with a normal in the cone, from the middle to the borders.
TEST(LightBounds, HoldEverythingInTheirConesAndSpheres) {
    std::mt19937_64 random(12);
    const Subject& s = subjects()[2];
    double found = 0, allowed = 0;
    for (int trial = 0; trial < 3000; ++trial) {
        const Lighting lighting = random_lighting(random, s.tree, trial % 2 == 0);
        const glm::dvec3 eye = random_eye(random, s.tree);
        VertexCone cone;
        const double angle = trial % 5 == 0 ? M_PI : random_unit(random) * random_unit(random) * 3;
        cone.axis = glm::vec3(random_direction(random));
        cone.cosine = static_cast<float>(std::cos(angle));
        cone.sine = angle < M_PI ? static_cast<float>(std::sin(angle)) : 0;
        cone.albedo = {static_cast<float>(0.5 * random_unit(random)), 0.75f};
        Sphere sphere = s.tree.bounds()[0].ring;
        sphere.centre += glm::vec3(static_cast<double>(sphere.radius) * random_direction(random));
        sphere.radius *= static_cast<float>(std::pow(random_unit(random), 4));
        const LuminanceRange range = lit_range(lighting, cone, sphere, eye);
        double least = 1, most = 0;
        for (int sample = 0; sample < 60; ++sample) {
            const double share = sample % 2 ? 1 : random_unit(random), tilt = share * angle;
            const glm::dvec3 axis = glm::normalize(glm::dvec3(cone.axis)),
                             side = glm::normalize(glm::cross(axis, random_direction(random)));
            const glm::dvec3 normal = std::cos(tilt) * axis + std::sin(tilt) * side;
            const double out = sample % 3 ? 0.999999 : random_unit(random);
            const glm::dvec3 position =
                glm::dvec3(sphere.centre) + out * static_cast<double>(sphere.radius) * random_direction(random);
            const double albedo = sample % 4 ? (sample % 4 == 1 ? cone.albedo.lo : cone.albedo.hi) : 0.6;
            const double y = lit_luminance(lighting, position, normal, albedo, eye);
            ASSERT_GE(y, range.lo) << "trial " << trial;
            ASSERT_LE(y, range.hi) << "trial " << trial;
            least = std::min(least, y);
            most = std::max(most, y);
        }
        found += most - least;
        allowed += static_cast<double>(range.hi) - static_cast<double>(range.lo);
    }
    EXPECT_LT(allowed, 2 * found); // bounds, and not just anything
}

TEST(LightBounds, AreWiderForWiderConesAndSpheres) {
    std::mt19937_64 random(13);
    const Subject& s = subjects()[0];
    for (int trial = 0; trial < 5000; ++trial) {
        const Lighting lighting = random_lighting(random, s.tree, false);
        const glm::dvec3 eye = random_eye(random, s.tree);
        const auto cone = [](glm::dvec3 axis, double angle) {
            VertexCone made;
            made.axis = glm::vec3(axis);
            made.cosine = angle < M_PI ? static_cast<float>(std::cos(angle)) : -1;
            made.sine = angle < M_PI ? static_cast<float>(std::sin(angle)) : 0;
            made.albedo = {0.3f, 0.7f};
            return made;
        };
        const glm::dvec3 axis = random_direction(random),
                         tilted = glm::normalize(axis + random_unit(random) * random_direction(random));
        const double angle = random_unit(random),
                     wider = angle + std::acos(std::min(glm::dot(axis, tilted), 1.0)) + 1e-4;
        Sphere large = s.tree.bounds()[0].ring, small = large;
        large.radius *= static_cast<float>(random_unit(random));
        small.radius = 0.999f * large.radius * static_cast<float>(random_unit(random));
        small.centre += glm::vec3(0.999 * static_cast<double>(large.radius - small.radius) * random_direction(random));
        const LuminanceRange inner = lit_range(lighting, cone(axis, angle), small, eye),
                             outer = lit_range(lighting, cone(tilted, wider), large, eye);
        ASSERT_LE(outer.lo, inner.lo + 2e-5f) << "trial " << trial;
        ASSERT_GE(outer.hi, inner.hi - 2e-5f) << "trial " << trial;
    }
}

// The same lights a little further: what the kernel promises for so long holds.
TEST(LightBounds, ChangeNoFasterThanTheySay) {
    std::mt19937_64 random(14);
    int moved = 0;
    for (const Subject& s : subjects()) {
        const double radius = s.tree.bounds()[0].ring.radius;
        for (int trial = 0; trial < 3000; ++trial) {
            const Lighting from = casting(random_lighting(random, s.tree, trial % 2 == 0), trial % 5 == 0);
            const glm::dvec3 eye = random_eye(random, s.tree);
            const double size = std::pow(random_unit(random), 3) * 0.6;
            Lighting to = from;
            for (LightSource& light : to.lights) {
                light.direction =
                    glm::normalize(light.direction + size * random_unit(random) * random_direction(random));
                light.position += size * random_unit(random) * radius * random_direction(random);
                light.intensity *= std::exp(size / 8 * random_between(random, -0.3, 0.3));
                if (light.kind == Kind::point) light.direction = glm::dvec3(0, 0, 1);
            }
            const glm::dvec3 eye_to = from.specular > 0 ? eye + 0.5 * size * radius * random_direction(random) : eye;
            const double motion = light_motion(s.tree, from, eye, to, eye_to);
            std::array<NodeId, kernel_lanes> nodes;
            LitBatch before, after;
            for (std::size_t i = 0; i < kernel_lanes; ++i) {
                nodes[i] = static_cast<NodeId>(random() % s.tree.interior_count());
                before.set(i, s.bounds.cones()[nodes[i]], s.tree.bounds()[nodes[i]].ring);
                after.set(i, s.bounds.cones()[nodes[i]], s.tree.bounds()[nodes[i]].ring);
            }
            find_ranges(KernelLights(s.tree, from, eye), before);
            find_ranges(KernelLights(s.tree, to, eye_to), after);
            for (std::size_t i = 0; i < kernel_lanes; ++i) {
                if (!(motion <= static_cast<double>(before.cap[i]))) continue;
                ++moved;
                const double fine = std::min(motion, static_cast<double>(before.fine_cap[i])),
                             full_rate = before.full_rate[i], rough_rate = before.rough_rate[i];
                const double allowed = before.jump[i] + static_cast<double>(before.fine_rate[i]) * fine +
                                       rough_rate * (motion - fine) + 4e-6;
                const double d0 = static_cast<double>(before.hi[i]) - static_cast<double>(before.lo[i]),
                             d1 = static_cast<double>(after.hi[i]) - static_cast<double>(after.lo[i]);
                ASSERT_LE(std::abs(d1 - d0), allowed)
                    << s.name << ", trial " << trial << ", node " << nodes[i] << ", motion " << motion;
                const double s0 = static_cast<double>(before.hi[i]) + static_cast<double>(before.lo[i]),
                             s1 = static_cast<double>(after.hi[i]) + static_cast<double>(after.lo[i]);
                ASSERT_LE(std::abs(s1 - s0), 2 * static_cast<double>(before.jump[i]) +
                                                 static_cast<double>(before.fine_sum_rate[i]) * fine +
                                                 full_rate * (motion - fine) + 4e-6)
                    << s.name << ", trial " << trial;
                ASSERT_LE(std::abs(static_cast<double>(after.hi[i]) - static_cast<double>(before.hi[i])),
                          static_cast<double>(before.jump[i]) + static_cast<double>(before.rise_rate[i]) * motion +
                              4e-6)
                    << s.name << ", trial " << trial;
            }
        }
    }
    EXPECT_GT(moved, 50'000);
}

TEST(Lights, OfWhichTooManyCastShadowsAreRefused) {
    Lighting lighting;
    lighting.lights.assign(most_shadow_lights + 1, directional({0, 0, 1}));
    EXPECT_TRUE(validate(lighting));
    for (LightSource& light : lighting.lights) light.casts_shadow = true;
    const auto valid = validate(lighting);
    ASSERT_FALSE(valid);
    EXPECT_NE(valid.error().message.find("5 of them cast shadows, but at most 4 can"), std::string::npos);
    EXPECT_EQ(shadow_lights(lighting), 5u);
    lighting.lights[2].casts_shadow = false;
    EXPECT_TRUE(validate(lighting));
}

TEST(Keeping, NodesNeverFoldFromWhereverTheyAreSeen) {
    const VertexTree tree = std::move(*build_tree(shapes::icosphere(4).view()));
    View view;
    view.eye = {0, 0, 1e4};
    const auto plain = require(extent_criterion(tree, view, 4));
    std::vector<std::uint64_t> none((tree.interior_count() + 63) / 64, 0), some = none;
    const NodeId kept = tree.interior_count() / 2;
    for (NodeId node = kept;; node = support::sound(tree).parents()[node]) {
        some[node / 64] |= std::uint64_t{1} << (node % 64);
        if (node == VertexTree::root()) break;
    }
    const Viewpoint viewpoint{.eye = eye_in_tree(tree, view, {})};
    Cut cut(tree), with(tree), without(tree);
    ASSERT_TRUE(cut.follow(*plain, viewpoint));
    ASSERT_TRUE(without.follow(*keeping(tree, *plain, none), viewpoint));
    ASSERT_TRUE(with.follow(*keeping(tree, *plain, some), viewpoint));
    EXPECT_EQ(cut.triangle_count(), without.triangle_count());
    EXPECT_LT(cut.triangle_count(), with.triangle_count());
    EXPECT_LT(with.triangle_count(), tree.triangle_count());
    EXPECT_FALSE(keeping(tree, *plain, std::span(none).first(1)));
}

TEST(Keeping, NodesStayOutOfFrustaAndBehindOccluders) {
    const VertexTree tree = std::move(*build_tree(shapes::icosphere(4).view()));
    const auto plain = require(displacement_criterion(tree, {}, 0.01));
    std::vector<std::uint64_t> some((tree.interior_count() + 63) / 64, 0);
    for (NodeId node = tree.interior_count() / 2;; node = support::sound(tree).parents()[node]) {
        some[node / 64] |= std::uint64_t{1} << (node % 64);
        if (node == VertexTree::root()) break;
    }
    const auto kept = require(keeping(tree, *plain, some));
    // The mesh is behind the eye; and behind a sphere.
    View view;
    view.eye = {0, 0, 3};
    view.target = {0, 0, 6};
    Viewpoint away{.eye = eye_in_tree(tree, view, {})};
    away.frusta = {frustum_of(tree, view)};
    DistanceCriterion::Parts of_rings;
    of_rings.switch_distance = {100};
    const auto rings = require(DistanceCriterion::create(tree, of_rings));
    const auto kept_rings = require(keeping(tree, *rings, some));
    Viewpoint behind{.eye = away.eye + glm::dvec3(0, 0, 7)};
    behind.occluders = {{glm::vec3(glm::dvec3(0, 0, 5) + away.eye - glm::dvec3(0, 0, 3)), 4.0f}};
    const auto triangles = [&](const DistanceCriterion& criterion, const Viewpoint& viewpoint) {
        Cut cut(tree);
        EXPECT_TRUE(cut.follow(criterion, viewpoint));
        return cut.triangle_count();
    };
    EXPECT_EQ(triangles(*plain, away), 0u);
    const Index least = triangles(*kept, away);
    EXPECT_GT(least, 0u);
    EXPECT_LT(least, tree.triangle_count());
    EXPECT_EQ(triangles(*rings, behind), 0u);
    EXPECT_EQ(triangles(*kept_rings, behind), least);
    // One cut that follows through both finds the same.
    Cut followed(tree);
    Viewpoint towards = away;
    view.target = {0, 0, 0};
    towards.frusta = {frustum_of(tree, view)};
    ASSERT_TRUE(followed.follow(*kept, towards));
    EXPECT_GT(followed.triangle_count(), least);
    ASSERT_TRUE(followed.follow(*kept, away));
    EXPECT_EQ(followed.triangle_count(), least);
}

// Reaches that grow with contrast and luminance, about like those of an eye.
DistanceCriterion lit_criterion(const Subject& s, bool with_gaze) {
    DistanceCriterion::Parts parts;
    parts.eccentricity_bins = with_gaze ? 24 : 1;
    parts.bin_degrees = 2;
    const AbsoluteScale scale{.offset = 0.5, .span = 99.5};
    const ContrastClasses classes(scale);
    parts.lit = std::make_shared<const LitClasses>(
        LitClasses{std::make_shared<LightBounds>(s.bounds), scale, classes.class_of({0, 1}, 1)});
    parts.switch_distance.assign(ContrastClasses::class_count * parts.eccentricity_bins,
                                 DistanceCriterion::never_visible);
    for (std::size_t row = 1; row < ContrastClasses::class_count; ++row)
        for (std::size_t bin = 0; bin < parts.eccentricity_bins; ++bin) {
            const double seen = 60 * ContrastClasses::contrast(row) * std::pow(classes.level(row) / 100, 0.3);
            if (seen > 1)
                parts.switch_distance[row * parts.eccentricity_bins + bin] =
                    static_cast<float>(40 * std::log(seen) / (1 + 0.3 * static_cast<double>(bin)));
        }
    Result<DistanceCriterion> made = DistanceCriterion::create(s.tree, std::move(parts));
    EXPECT_TRUE(made) << made.error().message;
    return std::move(*made);
}

// A step of each light, and sometimes a jump.
void move_lights(std::mt19937_64& random, Lighting& lighting, double radius, double step) {
    for (LightSource& light : lighting.lights) {
        if (light.kind != Kind::point)
            light.direction = glm::normalize(light.direction + step * random_direction(random));
        if (light.kind != Kind::directional) light.position += step * radius * random_direction(random);
        if (random() % 4 == 0) light.intensity *= std::exp(random_between(random, -0.2, 0.2) * step);
    }
}

TEST(FollowLights, RefusesAScaleThatIsNone) {
    const Subject& s = subjects()[0];
    const DistanceCriterion::Parts good = lit_criterion(s, false).parts();
    for (const AbsoluteScale scale : {AbsoluteScale{-1, 2}, {0, 0}, {0, std::nan("")}, {0, infinity}}) {
        DistanceCriterion::Parts parts = good;
        LitClasses lit = *good.lit;
        lit.scale = scale;
        parts.lit = std::make_shared<const LitClasses>(lit);
        EXPECT_FALSE(DistanceCriterion::create(s.tree, std::move(parts))) << scale.offset << ", " << scale.span;
    }
}

void expect_cuts_without_history(const Subject& s, bool with_gaze, bool eye_moves, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const DistanceCriterion criterion = lit_criterion(s, with_gaze);
    const double radius = s.tree.bounds()[0].ring.radius;
    Viewpoint viewpoint;
    viewpoint.eye = glm::dvec3(s.tree.bounds()[0].ring.centre) + 6 * radius * random_direction(random);
    if (with_gaze) viewpoint.gaze = glm::normalize(-viewpoint.eye + radius * random_direction(random));
    viewpoint.lighting = random_lighting(random, s.tree, seed % 2 == 0);
    FollowOptions options;
    options.cull_back_faces = seed % 3 == 0 && s.tree.closedness() == Closedness::closed_outward;
    options.threshold = seed % 5 == 0 ? 2.0f : 1.0f;
    Cut cut(s.tree);
    for (int frame = 0; frame < 60; ++frame) {
        const auto stats = require(cut.follow(criterion, viewpoint, options));
        Cut fresh(s.tree);
        ASSERT_TRUE(fresh.follow(criterion, viewpoint, options));
        for (NodeId node = 0; node < s.tree.interior_count(); ++node)
            ASSERT_EQ(cut.is_unfolded(node), fresh.is_unfolded(node))
                << s.name << ", seed " << seed << ", frame " << frame << ", node " << node;
        if (frame % 10 == 9) ASSERT_EQ(support::fault_in_cut(cut), "");
        const bool do_rest = seed % 4 < 2 && frame / 10 % 2 == 0; // they begin to move, and stand still again
        if (!do_rest)
            move_lights(random, viewpoint.lighting, radius, frame % 13 == 12 ? 1 : 0.02 * random_unit(random));
        if (eye_moves) viewpoint.eye += 0.02 * radius * random_direction(random);
        if (eye_moves && with_gaze) viewpoint.gaze = glm::normalize(*viewpoint.gaze + 0.01 * random_direction(random));
    }
}

TEST(FollowLights, ComesToTheCutThatAFreshOneComesTo) {
    std::uint64_t seed = 0;
    for (const Subject& s : subjects())
        for (const bool with_gaze : {false, true})
            for (const bool eye_moves : {false, true})
                for (int again = 0; again < 2; ++again) expect_cuts_without_history(s, with_gaze, eye_moves, ++seed);
}

TEST(FollowLights, TestsOnlyWhatTheLightMayChange) {
    const Subject& s = subjects()[0];
    const DistanceCriterion criterion = lit_criterion(s, false);
    Viewpoint viewpoint;
    viewpoint.eye = glm::dvec3(s.tree.bounds()[0].ring.centre) +
                    glm::dvec3(0, 0, 60 * static_cast<double>(s.tree.bounds()[0].ring.radius));
    viewpoint.lighting = lit_by(directional({1, 1, 1}, 0.8), 0.1);
    Cut cut(s.tree);
    const std::uint64_t at_first = cut.follow(criterion, viewpoint)->node_tests;
    EXPECT_EQ(cut.follow(criterion, viewpoint)->node_tests, 0u);
    std::uint64_t later = 0;
    constexpr int frames = 90;
    for (int frame = 1; frame <= frames; ++frame) {
        const double angle = frame * 0.2 * M_PI / 180;
        viewpoint.lighting.lights[0] = directional({std::cos(angle), 1, 1 + std::sin(angle)}, 0.8);
        later += cut.follow(criterion, viewpoint)->node_tests;
    }
    EXPECT_LT(later, frames * at_first / 5);
    EXPECT_GT(later, 0u);
}

TEST(FollowLights, RefusesASceneWithoutThem) {
    const Subject& s = subjects()[0];
    const DistanceCriterion criterion = lit_criterion(s, false);
    Cut cut(s.tree);
    const auto stats = cut.follow(criterion, {});
    ASSERT_FALSE(stats);
    EXPECT_NE(stats.error().message.find("The scene is black"), std::string::npos);
}

} // namespace unseen::vdtree::lighting_test
