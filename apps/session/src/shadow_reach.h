// Where shadows may fall that can be seen, and how far the outlines that cast them may move before they are.
//
// All that stands in a scene is covered with small balls, once. For a view, each ball that may be in its window says
// how far the outline of a shadow may move there. A map for each light has the least of these, by the direction from
// the light and the way to it: what casts a shadow looks up what lies behind it.
#pragma once

#include <unseen/perception/internal/shadow_edges.h>
#include <unseen/session/session.h>
#include <unseen/vdtree/internal/light_bounds.h>

namespace unseen::session {

// One of all objects, and then of the backdrop.
struct Standing {
    const Object* object = nullptr;
    const vdtree::LightBounds* light_bounds = nullptr; // null: not known
    bool hides_back_faces = false; // where it is looked at from outside: closed, and nothing shows through
};

// Balls around all triangles of all that stands there. In world units.
class ShadowReceivers {
public:
    // Cost: some hundred milliseconds for the largest scenes.
    explicit ShadowReceivers(std::vector<Standing> standing);

    struct Ball {
        WorldSphere sphere;
        std::uint32_t standing = 0;
        vdtree::NodeId node = vdtree::no_node; // whose ring it is, or ...
        std::uint32_t triangle = 0;            // ... of which it is a part
    };
    struct Triangle {
        glm::dvec3 corners[3], normals[3]; // of the vertices
    };

    const std::vector<Standing>& standing() const noexcept { return standing_; }
    const std::vector<Ball>& balls() const noexcept { return balls_; }
    const std::vector<Triangle>& triangles() const noexcept { return triangles_; }

    // By ball: whether a light may light any of it. What faces away is dark, in shadow or not.
    std::vector<bool> find_lit(const vdtree::LightSource& light) const;

private:
    std::vector<Standing> standing_;
    std::vector<Ball> balls_;
    std::vector<Triangle> triangles_;
    double edge_ = 0; // world units: half the width of drawn edges of shadows
    friend class ShadowReach;
};

// Whether shadows are the same, but for rounding from one object's frame to another's.
bool is_alike(const vdtree::Lighting& a, const vdtree::Lighting& b);

struct LitReceivers {
    vdtree::Lighting lighting;                // in the world
    std::vector<std::vector<bool>> of_lights; // of those that cast shadows
};

class ShadowReach {
public:
    // `lighting`: in the world. `window`: the frustum's planes around the eye, in the world; what is out of it does not
    // count. None: all does. `moves`: it is to hold for views from nearby, too. Cost: some milliseconds.
    ShadowReach(const ShadowReceivers& receivers, const LitReceivers& lit,
                std::shared_ptr<const perception::ShadowEdges> edges, glm::dvec3 eye,
                std::span<const vdtree::Plane> window, bool moves);
    ShadowReach(const ShadowReach&) = delete;
    ShadowReach& operator=(const ShadowReach&) = delete;
    ~ShadowReach();

    // Whether it holds for these, too.
    bool holds_for(const vdtree::Lighting& lighting, const perception::ShadowEdges* edges, glm::dvec3 eye,
                   std::span<const vdtree::Plane> window) const;

    bool is_of(glm::dvec3 eye, std::span<const vdtree::Plane> window) const; // this very view
    bool moves() const noexcept { return moves_; }

    // World units: how far outlines of what is in this sphere may move. Infinite where no light casts a shadow of it
    // that can be seen; 0 where the eye may be in one. Cost: some hundred nanoseconds a light.
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
    std::vector<Seen> find_seen(const ShadowReceivers& receivers);
    MappedLight mapped(const vdtree::LightSource& light, const ShadowReceivers& receivers, const std::vector<bool>& lit,
                       const std::vector<Seen>& seen) const;

    vdtree::Lighting lighting_;
    std::shared_ptr<const perception::ShadowEdges> edges_;
    glm::dvec3 eye_;
    std::vector<vdtree::Plane> window_;
    bool moves_;
    double near_by_ = 0; // world units: how far the eye may be from `eye_`
    double scene_radius_ = 0, edge_ = 0;
    std::vector<MappedLight> lights_;
};

} // namespace unseen::session
