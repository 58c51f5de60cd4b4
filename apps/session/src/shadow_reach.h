// Where shadows may fall that can be seen, and how far the outlines that cast them may move before they are.
//
// All that stands in a scene is covered with small balls, once. For a view, each ball that may be in its window says how
// far the outline of a shadow may move there. A map for each light has the least of these, by the direction from the
// light and the way to it: what casts a shadow looks up what lies behind it.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <perception/shadow_edges.h>
#include <session/scene.h>
#include <session/session.h>
#include <vdtree/distance_criterion.h>
#include <vdtree/lighting.h>

namespace unseen::session {

// Balls around all triangles of all objects and of the backdrop. In world units.
class ShadowReceivers {
public:
    // Cost: some hundred milliseconds for the largest scenes.
    static ShadowReceivers cover(const Scene& scene);

    struct Ball {
        WorldSphere sphere;
        std::uint32_t corners = none; // of the whole triangle that it is a part of; none: all is in the ball
        static constexpr std::uint32_t none = 0xffffffff;
    };
    using Corners = std::array<glm::dvec3, 3>;

    const std::vector<Ball>& balls() const noexcept { return balls_; }
    const std::vector<Corners>& corners() const noexcept { return corners_; }

private:
    std::vector<Ball> balls_;
    std::vector<Corners> corners_;
};

class ShadowReach {
public:
    // `lighting`: in the world. `window`: the frustum's planes around the eye, in the world; what is out of it does not
    // count. None: all does. Cost: some milliseconds.
    ShadowReach(const ShadowReceivers& receivers, vdtree::Lighting lighting,
                std::shared_ptr<const perception::ShadowEdges> edges, glm::dvec3 eye,
                std::span<const vdtree::Plane> window);
    ShadowReach(const ShadowReach&) = delete;
    ShadowReach& operator=(const ShadowReach&) = delete;
    ~ShadowReach();

    // Whether it holds for these, too: for views from nearby, turned by little.
    bool holds_for(const vdtree::Lighting& lighting, const perception::ShadowEdges* edges, glm::dvec3 eye,
                   std::span<const vdtree::Plane> window) const;

    // World units: how far outlines of what is in this sphere may move. Infinite where no light casts a shadow of it that
    // can be seen; 0 where the eye may be in one. Cost: some hundred nanoseconds a light.
    double unseen_shift(const WorldSphere& sphere) const;

private:
    class Map;
    struct Seen {
        std::uint32_t ball;
        double distance; // of the nearest eye
    };
    struct MappedLight {
        vdtree::LightSource light;
        std::vector<Map> maps; // one of a directional light, six of others
    };
    std::vector<Seen> find_seen(const std::vector<ShadowReceivers::Ball>& balls);
    MappedLight mapped(const vdtree::LightSource& light, const ShadowReceivers& receivers,
                       const std::vector<Seen>& seen) const;

    vdtree::Lighting lighting_;
    std::shared_ptr<const perception::ShadowEdges> edges_;
    glm::dvec3 eye_;
    std::vector<vdtree::Plane> window_;
    double near_by_ = 0; // world units: how far the eye may be from `eye_`
    double scene_radius_ = 0;
    std::vector<MappedLight> lights_;
};

} // namespace unseen::session
