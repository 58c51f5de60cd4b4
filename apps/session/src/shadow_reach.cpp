#include "shadow_reach.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <queue>

#include <glm/geometric.hpp>

namespace unseen::session {
namespace {

using vdtree::LightSource;
using vdtree::NodeId;
using Ball = ShadowReceivers::Ball;
using Corners = ShadowReceivers::Corners;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double outward = 1 + 1e-6; // far more than rounding in floats, and of lights that come from another frame

// ---- receivers

constexpr std::size_t most_balls = 40'000;
constexpr double finest = 1.0 / 500; // of the scene's radius: smaller balls are not parted

// A node of an object's tree, or a part of a triangle.
struct Piece {
    WorldSphere sphere;
    std::uint32_t object = 0;
    NodeId node = vdtree::no_node;
    Corners part = {};
    std::uint32_t corners = Ball::none;
    bool operator<(const Piece& other) const { return sphere.radius < other.sphere.radius; }
};

WorldSphere around(const Corners& part) {
    WorldSphere best{{}, infinity};
    for (int i = 0; i < 3; ++i) {
        const glm::dvec3 middle = (part[i] + part[(i + 1) % 3]) * 0.5;
        const double radius = std::max(glm::length(part[i] - middle), glm::length(part[(i + 2) % 3] - middle));
        if (radius < best.radius) best = {middle, radius};
    }
    return best;
}

// Parts the largest ones first.
class Cover {
public:
    explicit Cover(const Scene& scene) {
        for (const std::vector<Object>* all : {&scene.objects, &scene.backdrop})
            for (const Object& object : *all) add(object);
    }

    void part(double least_radius, std::vector<Ball>& balls) {
        while (!pieces_.empty()) {
            const Piece piece = pieces_.top();
            pieces_.pop();
            const bool is_last = balls.size() + pieces_.size() >= most_balls || piece.sphere.radius <= least_radius;
            if (is_last || (piece.node != vdtree::no_node && !trees_[piece.object]))
                balls.push_back({{piece.sphere.centre, piece.sphere.radius * outward}, piece.corners});
            else if (piece.node != vdtree::no_node) part_node(piece);
            else part_triangle(piece);
        }
    }
    std::vector<Corners> take_corners() { return std::move(corners_); }

private:
    void add(const Object& object) {
        auto sound = vdtree::SoundTree::of(object.tree); // else it stays whole
        trees_.push_back(sound ? std::optional(std::move(*sound)) : std::nullopt);
        objects_.push_back(&object);
        const vdtree::Sphere around = object.tree.bounding_sphere();
        Piece whole = piece_of(static_cast<std::uint32_t>(objects_.size() - 1), vdtree::VertexTree::root());
        const double apart = glm::length(glm::dvec3(around.centre) -
                                         glm::dvec3(object.tree.bounds()[vdtree::VertexTree::root()].ring.centre));
        const double all = (apart + static_cast<double>(around.radius)) * object.placement.scale;
        whole.sphere.radius = std::max(whole.sphere.radius, all);
        pieces_.push(whole);
    }

    Piece piece_of(std::uint32_t object, NodeId node) const {
        const Object& of = *objects_[object];
        const vdtree::Sphere ring = of.tree.bounds()[node].ring;
        return {{of.placement.to_world(of.tree.origin() + glm::dvec3(ring.centre)),
                 of.placement.scale * static_cast<double>(ring.radius)},
                object,
                node};
    }

    // Each triangle vanishes at one node, and is in the ring of every node below that has two of its corners.
    void part_node(const Piece& piece) {
        const vdtree::SoundTree& tree = *trees_[piece.object];
        const Object& object = *objects_[piece.object];
        tree.for_each_child(piece.node, [&](NodeId child) {
            if (!tree.is_leaf(child)) pieces_.push(piece_of(piece.object, child));
        });
        const auto corner = [&](vdtree::Index leaf) {
            return object.placement.to_world(tree.origin() +
                                             glm::dvec3(tree.positions()[tree.interior_count() + leaf]));
        };
        for (vdtree::Index t = tree.first_triangle()[piece.node]; t < tree.first_triangle()[piece.node + 1]; ++t) {
            const vdtree::Triangle& triangle = tree.triangles()[t];
            const Corners whole = {corner(triangle[0]), corner(triangle[1]), corner(triangle[2])};
            corners_.push_back(whole);
            pieces_.push(
                {around(whole), piece.object, vdtree::no_node, whole, static_cast<std::uint32_t>(corners_.size() - 1)});
        }
    }

    void part_triangle(const Piece& piece) {
        int longest = 0;
        const auto side = [&](int i) { return glm::length(piece.part[(i + 1) % 3] - piece.part[i]); };
        for (int i = 1; i < 3; ++i)
            if (side(i) > side(longest)) longest = i;
        const glm::dvec3 a = piece.part[longest], b = piece.part[(longest + 1) % 3], c = piece.part[(longest + 2) % 3];
        const glm::dvec3 middle = (a + b) * 0.5;
        for (const Corners& half : {Corners{a, middle, c}, Corners{middle, b, c}})
            pieces_.push({around(half), piece.object, vdtree::no_node, half, piece.corners});
    }

    std::vector<const Object*> objects_;
    std::vector<std::optional<vdtree::SoundTree>> trees_;
    std::vector<Corners> corners_;
    std::priority_queue<Piece> pieces_;
};

// ---- the window

// Views from nearby: by this share of the way to the nearest ball that may be seen, but no more than this share of the
// scene's radius, and no less than that one.
constexpr double near_by = 1.0 / 16, farthest_near_by = 1.0 / 32, nearest_near_by = 1.0 / 5000;
// Of the scene's radius: half the width of drawn edges of shadows, by texels of the maps that are fitted to the scene.
constexpr double edge_width = 1.0 / 300;
constexpr double turned = 0.05; // radians, and what else may change of the window's planes

// Rounding of lights that are the same in the world, but come from other objects' frames.
bool is_same(const LightSource& a, const LightSource& b, double scene_radius) {
    constexpr double rounding = 1e-9;
    const double size = rounding * (scene_radius + glm::length(a.position));
    return a.kind == b.kind && a.casts_shadow == b.casts_shadow &&
           std::abs(a.intensity - b.intensity) <= rounding * a.intensity &&
           (a.kind != LightSource::Kind::directional || glm::length(a.direction - b.direction) <= rounding) &&
           (a.kind == LightSource::Kind::directional || (glm::length(a.position - b.position) <= size &&
                                                         std::abs(a.distance - b.distance) <= rounding * a.distance));
}

// ---- what a light sees

// Of a ball, in a map's coordinates.
struct Footprint {
    double low[2], high[2], from, to; // across, and along the light
};

struct Range {
    double low = infinity, high = -infinity;
    void include(double from, double to) { low = std::min(low, from), high = std::max(high, to); }
    double size() const { return high > low ? high - low : 1; }
};

} // namespace

ShadowReceivers ShadowReceivers::cover(const Scene& scene) {
    ShadowReceivers all;
    WorldSphere scene_sphere{{}, 0};
    for (const std::vector<Object>* objects : {&scene.objects, &scene.backdrop})
        for (const Object& object : *objects) {
            const WorldSphere own = world_sphere(object);
            if (scene_sphere.radius == 0) scene_sphere = own;
            scene_sphere.radius =
                std::max(scene_sphere.radius, glm::length(own.centre - scene_sphere.centre) + own.radius);
        }
    Cover cover(scene);
    cover.part(finest * scene_sphere.radius, all.balls_);
    all.corners_ = cover.take_corners();
    return all;
}

// The plane across a directional light, or the side of a cube around a light with a place, in cells, each with slabs
// along the light. A cell has the least value of all balls that reach into it or beyond it; coarser maps have the least
// of four cells each.
class ShadowReach::Map {
public:
    static constexpr std::size_t slabs = 16, plane_cells = 128, side_cells = 64;

    static Map across(glm::dvec3 along) {
        Map map(plane_cells);
        const glm::dvec3 least = std::abs(along.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
        map.axes_[2] = along;
        map.axes_[0] = glm::normalize(glm::cross(along, least));
        map.axes_[1] = glm::cross(along, map.axes_[0]);
        return map;
    }
    static Map side(glm::dvec3 position, int number) {
        Map map(side_cells);
        map.has_place_ = true;
        map.origin_ = position;
        const int axis = number / 2;
        for (int k = 0; k < 3; ++k) map.axes_[k] = glm::dvec3(0);
        map.axes_[2][axis] = number % 2 == 0 ? 1 : -1;
        map.axes_[0][(axis + 1) % 3] = 1;
        map.axes_[1][(axis + 2) % 3] = 1;
        return map;
    }

    // None where it is not in the map.
    std::optional<Footprint> footprint(const WorldSphere& sphere) const {
        const glm::dvec3 to = sphere.centre - origin_;
        const double u = glm::dot(to, axes_[0]), v = glm::dot(to, axes_[1]), w = glm::dot(to, axes_[2]);
        const double r = sphere.radius;
        if (!has_place_) return Footprint{{u - r, v - r}, {u + r, v + r}, w - r, w + r};
        const double distance = glm::length(to);
        Footprint all{{-1, -1}, {1, 1}, distance - r, distance + r};
        if (!(distance > r)) return all;
        // No direction into it is farther than this from that to its centre; all of the side have at least this along
        // its axis.
        const double spread = 2 * std::sin(std::asin(r / distance) / 2) * outward;
        constexpr double least_along = std::numbers::inv_sqrt3 / outward;
        if (w / distance + spread < least_along) return std::nullopt;
        const double least = std::max(w / distance - spread, least_along), most = w / distance + spread;
        for (int k = 0; k < 2; ++k) {
            const double low = (k == 0 ? u : v) / distance - spread, high = (k == 0 ? u : v) / distance + spread;
            all.low[k] = std::max(low < 0 ? low / least : low / most, -1.0);
            all.high[k] = std::min(high < 0 ? high / most : high / least, 1.0);
            if (all.low[k] > 1 || all.high[k] < -1) return std::nullopt;
        }
        return all;
    }

    void begin(const Range (&across)[2], const Range& along) {
        for (int k = 0; k < 2; ++k) {
            first_[k] = has_place_ ? -1 : across[k].low;
            per_unit_[k] = static_cast<double>(cells_) / (has_place_ ? 2 : across[k].size());
        }
        from_ = along.low;
        slabs_per_unit_ = static_cast<double>(slabs) / along.size();
        std::size_t values = 0;
        for (std::size_t side = cells_; side > 0; side /= 2) {
            first_value_.push_back(values);
            values += slabs * side * side;
        }
        values_.assign(values, std::numeric_limits<float>::infinity());
    }

    void add(const Footprint& of, double value) {
        const auto least = static_cast<float>(value / outward);
        const std::size_t slab = slab_at(of.to);
        for (std::size_t y = cell(1, of.low[1]); y <= cell(1, of.high[1]); ++y)
            for (std::size_t x = cell(0, of.low[0]); x <= cell(0, of.high[0]); ++x) {
                float& at = values_[(slab * cells_ + y) * cells_ + x];
                at = std::min(at, least);
            }
    }

    void finish() {
        const std::size_t plane = cells_ * cells_;
        for (std::size_t slab = slabs - 1; slab-- > 0;)
            for (std::size_t i = slab * plane; i < (slab + 1) * plane; ++i)
                values_[i] = std::min(values_[i], values_[i + plane]);
        std::size_t side = cells_ / 2;
        for (std::size_t level = 1; level < first_value_.size(); ++level, side /= 2) {
            const float* const finer = values_.data() + first_value_[level - 1];
            float* const own = values_.data() + first_value_[level];
            for (std::size_t row = 0; row < slabs * side; ++row) { // of all slabs
                const float* const two = finer + 4 * side * row;
                for (std::size_t x = 0; x < side; ++x)
                    own[row * side + x] = std::min(std::min(two[2 * x], two[2 * x + 1]),
                                                   std::min(two[2 * side + 2 * x], two[2 * side + 2 * x + 1]));
            }
        }
    }

    // The least value behind where the footprint begins.
    double least(const Footprint& of) const {
        for (int k = 0; k < 2; ++k)
            if (!(of.high[k] >= first_[k] && (of.low[k] - first_[k]) * per_unit_[k] <= static_cast<double>(cells_)))
                return infinity;
        if (!((of.from - from_) * slabs_per_unit_ <= static_cast<double>(slabs))) return infinity;
        std::size_t x[2] = {cell(0, of.low[0]), cell(0, of.high[0])}, y[2] = {cell(1, of.low[1]), cell(1, of.high[1])};
        std::size_t level = 0, side = cells_;
        for (; level + 1 < first_value_.size() && (x[1] - x[0] > 2 || y[1] - y[0] > 2); ++level, side /= 2)
            for (std::size_t* const at : {&x[0], &x[1], &y[0], &y[1]}) *at /= 2;
        float least = std::numeric_limits<float>::infinity();
        const float* const slab = values_.data() + first_value_[level] + slab_at(of.from) * side * side;
        for (std::size_t row = y[0]; row <= y[1]; ++row)
            for (std::size_t column = x[0]; column <= x[1]; ++column)
                least = std::min(least, slab[row * side + column]);
        return static_cast<double>(least);
    }

private:
    explicit Map(std::size_t cells) : cells_(cells) {}

    std::size_t cell(int k, double at) const {
        const double place = (at - first_[k]) * per_unit_[k];
        return place > 0 ? std::min(static_cast<std::size_t>(std::min(place, 1e9)), cells_ - 1) : 0;
    }
    std::size_t slab_at(double at) const {
        const double place = (at - from_) * slabs_per_unit_;
        return place > 0 ? std::min(static_cast<std::size_t>(std::min(place, 1e9)), slabs - 1) : 0;
    }

    std::size_t cells_;
    bool has_place_ = false;
    glm::dvec3 origin_ = glm::dvec3(0), axes_[3];
    double first_[2] = {0, 0}, per_unit_[2] = {1, 1}, from_ = 0, slabs_per_unit_ = 1;
    std::vector<std::size_t> first_value_; // by level
    std::vector<float> values_;            // by level, slab, row and column
};

ShadowReach::ShadowReach(const ShadowReceivers& receivers, vdtree::Lighting lighting,
                         std::shared_ptr<const perception::ShadowEdges> edges, glm::dvec3 eye,
                         std::span<const vdtree::Plane> window)
    : lighting_(std::move(lighting)), edges_(std::move(edges)), eye_(eye), window_(window.begin(), window.end()) {
    if (receivers.balls().empty()) return;
    const glm::dvec3 middle = receivers.balls().front().sphere.centre;
    for (const Ball& ball : receivers.balls())
        scene_radius_ = std::max(scene_radius_, glm::length(ball.sphere.centre - middle) + ball.sphere.radius);
    const std::vector<Seen> seen = find_seen(receivers.balls());
    for (const LightSource& light : lighting_.lights)
        if (light.casts_shadow) lights_.push_back(mapped(light, receivers, seen));
}

ShadowReach::~ShadowReach() = default;

std::vector<ShadowReach::Seen> ShadowReach::find_seen(const std::vector<Ball>& balls) {
    std::vector<Seen> seen;
    const auto find = [&] {
        seen.clear();
        for (std::size_t i = 0; i < balls.size(); ++i) {
            const glm::dvec3 to = balls[i].sphere.centre - eye_;
            const double distance = glm::length(to), radius = balls[i].sphere.radius;
            const double margin = radius + turned * distance + near_by_;
            if (std::any_of(window_.begin(), window_.end(),
                            [&](const vdtree::Plane& plane) { return glm::dot(plane.normal, to) < -margin; }))
                continue;
            const double nearest = distance - radius - near_by_;
            seen.push_back({static_cast<std::uint32_t>(i), nearest > 0 ? nearest : 0}); // 0 for NaN
        }
    };
    find();
    double nearest = infinity;
    for (const Seen& ball : seen) nearest = std::min(nearest, ball.distance);
    near_by_ = std::clamp(near_by * nearest, nearest_near_by * scene_radius_, farthest_near_by * scene_radius_);
    find();
    return seen;
}

ShadowReach::MappedLight ShadowReach::mapped(const LightSource& light, const ShadowReceivers& receivers,
                                             const std::vector<Seen>& seen) const {
    MappedLight all{light, {}};
    const bool has_place = light.kind != LightSource::Kind::directional;
    if (has_place)
        for (int side = 0; side < 6; ++side) all.maps.push_back(Map::side(light.position, side));
    else all.maps.push_back(Map::across(-light.direction));
    const double everywhere = has_place ? 0 : edges_->widest_unseen(light.intensity);
    // Shadows of lights with a place grow with the distance from them: values there are of outlines at a distance of 1.
    const auto value_of = [&](const Ball& ball, double distance) {
        if (!has_place) return distance * everywhere;
        const double middle = glm::length(ball.sphere.centre - light.position);
        // Light is interpolated between corners, which may be nearer.
        double nearest = middle - ball.sphere.radius;
        if (ball.corners != Ball::none) {
            nearest = infinity;
            for (const glm::dvec3& corner : receivers.corners()[ball.corners])
                nearest = std::min(nearest, glm::length(corner - light.position));
        }
        if (!(nearest > 0)) return 0.0;
        const double ratio = light.distance / nearest;
        return distance * edges_->widest_unseen(light.intensity * ratio * ratio) / (middle + ball.sphere.radius);
    };
    std::vector<double> values;
    values.reserve(seen.size());
    for (const Seen& ball : seen) {
        const double value = value_of(receivers.balls()[ball.ball], ball.distance);
        values.push_back(value >= 0 ? value : 0); // 0 for NaN: a distance of 0 times an infinite width
    }
    for (Map& map : all.maps) {
        std::vector<std::pair<std::size_t, Footprint>> footprints;
        Range across[2], along;
        for (std::size_t i = 0; i < seen.size(); ++i) {
            const auto footprint = map.footprint(receivers.balls()[seen[i].ball].sphere);
            if (!footprint) continue;
            footprints.emplace_back(i, *footprint);
            for (int k = 0; k < 2; ++k) across[k].include(footprint->low[k], footprint->high[k]);
            along.include(footprint->from, footprint->to);
        }
        if (footprints.empty()) along = across[0] = across[1] = {0, 0};
        map.begin(across, along);
        for (const auto& [i, footprint] : footprints) map.add(footprint, values[i]);
        map.finish();
    }
    return all;
}

bool ShadowReach::holds_for(const vdtree::Lighting& lighting, const perception::ShadowEdges* edges, glm::dvec3 eye,
                            std::span<const vdtree::Plane> window) const {
    return edges == edges_.get() && glm::length(eye - eye_) <= near_by_ &&
           std::equal(window.begin(), window.end(), window_.begin(), window_.end(),
                      [](const vdtree::Plane& a, const vdtree::Plane& b) {
                          return glm::length(a.normal - b.normal) <= turned;
                      }) &&
           std::equal(lighting.lights.begin(), lighting.lights.end(), lighting_.lights.begin(), lighting_.lights.end(),
                      [&](const LightSource& a, const LightSource& b) { return is_same(a, b, scene_radius_); });
}

double ShadowReach::unseen_shift(const WorldSphere& sphere) const {
    double least = infinity;
    const WorldSphere wide{sphere.centre, sphere.radius * outward + edge_width * scene_radius_};
    for (const MappedLight& mapped : lights_) {
        double own = infinity;
        for (const Map& map : mapped.maps)
            if (const auto footprint = map.footprint(wide)) own = std::min(own, map.least(*footprint));
        if (mapped.light.kind != LightSource::Kind::directional && std::isfinite(own)) {
            const double nearest = glm::length(wide.centre - mapped.light.position) - wide.radius;
            own = nearest > 0 ? own * nearest : 0;
        }
        least = own >= 0 ? std::min(least, own) : 0; // 0 for NaN
    }
    return least;
}

} // namespace unseen::session
