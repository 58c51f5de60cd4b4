#include "shadow_reach.h"

#include <algorithm>
#include <cmath>
#include <queue>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/normal_mask.h>

namespace unseen::session {
namespace {

using vdtree::LightSource;
using vdtree::NodeId;
using Ball = ShadowReceivers::Ball;
using Triangle = ShadowReceivers::Triangle;
using Corners = std::array<glm::dvec3, 3>;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double outward = 1 + 1e-6; // far more than rounding in floats, and of lights that come from another frame

// ---- receivers

constexpr std::size_t most_balls = 40'000;
constexpr double finest = 1.0 / 500; // of the scene's radius: smaller balls are not parted

// A share of the scene's radius: half the width of drawn edges of shadows, by texels of the maps that are fitted to the
// scene.
constexpr double edge_width = 1.0 / 300;

// A node of an object's tree, or a part of a triangle.
struct Piece {
    WorldSphere sphere;
    std::uint32_t object = 0;
    NodeId node = vdtree::no_node;
    Corners part = {};
    std::uint32_t triangle = 0;
    bool operator<(const Piece& other) const { return sphere.radius < other.sphere.radius; }
};

WorldSphere around(const Corners& part) {
    WorldSphere best{{}, infinity};
    for (std::size_t i = 0; i < 3; ++i) {
        const glm::dvec3 middle = (part[i] + part[(i + 1) % 3]) * 0.5;
        const double radius = std::max(glm::length(part[i] - middle), glm::length(part[(i + 2) % 3] - middle));
        if (radius < best.radius) best = {middle, radius};
    }
    return best;
}

// Parts the largest ones first.
class Cover {
public:
    explicit Cover(const std::vector<Standing>& standing) : standing_(standing) {
        for (std::uint32_t i = 0; i < standing.size(); ++i) {
            const Object& object = *standing[i].object;
            auto sound = vdtree::SoundTree::of(object.tree); // else it stays whole
            trees_.push_back(sound ? std::optional(std::move(*sound)) : std::nullopt);
            Piece whole = piece_of(i, vdtree::VertexTree::root());
            const WorldSphere all = world_sphere(object);
            whole.sphere.radius =
                std::max(whole.sphere.radius, glm::length(all.centre - whole.sphere.centre) + all.radius);
            pieces_.push(whole);
        }
    }

    void part(double least_radius, std::vector<Ball>& balls) {
        while (!pieces_.empty()) {
            const Piece piece = pieces_.top();
            pieces_.pop();
            const bool is_last = balls.size() + pieces_.size() >= most_balls || piece.sphere.radius <= least_radius;
            if (is_last || (piece.node != vdtree::no_node && !trees_[piece.object]))
                balls.push_back(
                    {{piece.sphere.centre, piece.sphere.radius * outward}, piece.object, piece.node, piece.triangle});
            else if (piece.node != vdtree::no_node) part_node(piece);
            else part_triangle(piece);
        }
    }
    std::vector<Triangle> take_triangles() { return std::move(triangles_); }

private:
    Piece piece_of(std::uint32_t standing, NodeId node) const {
        const Object& of = *standing_[standing].object;
        const vdtree::Sphere ring = of.tree.bounds()[node].ring;
        return {{of.placement.to_world(of.tree.origin() + glm::dvec3(ring.centre)),
                 of.placement.scale * static_cast<double>(ring.radius)},
                standing,
                node};
    }

    // Each triangle vanishes at one node, and is in the ring of every node below that has two of its corners.
    void part_node(const Piece& piece) {
        const vdtree::SoundTree& tree = *trees_[piece.object];
        const vdtree::Similarity& placement = standing_[piece.object].object->placement;
        tree.for_each_child(piece.node, [&](NodeId child) {
            if (!tree.is_place(child)) pieces_.push(piece_of(piece.object, child));
        });
        for (vdtree::Index t = tree.first_triangle()[piece.node]; t < tree.first_triangle()[piece.node + 1]; ++t) {
            Triangle whole;
            for (int k = 0; k < 3; ++k) {
                const vdtree::WedgeId leaf = tree.wedge_of_leaf(tree.triangles()[t][static_cast<std::size_t>(k)]);
                whole.corners[k] = placement.to_world(tree.origin() + glm::dvec3(tree.positions()[leaf]));
                whole.normals[k] = placement.rotation * glm::dvec3(glm::vec3(tree.normals()[leaf]));
            }
            triangles_.push_back(whole);
            const Corners all = {whole.corners[0], whole.corners[1], whole.corners[2]};
            pieces_.push(
                {around(all), piece.object, vdtree::no_node, all, static_cast<std::uint32_t>(triangles_.size() - 1)});
        }
    }

    void part_triangle(const Piece& piece) {
        std::size_t longest = 0;
        const auto side = [&](std::size_t i) { return glm::length(piece.part[(i + 1) % 3] - piece.part[i]); };
        for (std::size_t i = 1; i < 3; ++i)
            if (side(i) > side(longest)) longest = i;
        const glm::dvec3 a = piece.part[longest], b = piece.part[(longest + 1) % 3], c = piece.part[(longest + 2) % 3];
        const glm::dvec3 middle = (a + b) * 0.5;
        for (const Corners& half : {Corners{a, middle, c}, Corners{middle, b, c}})
            pieces_.push({around(half), piece.object, vdtree::no_node, half, piece.triangle});
    }

    const std::vector<Standing>& standing_;
    std::vector<std::optional<vdtree::SoundTree>> trees_;
    std::vector<Triangle> triangles_;
    std::priority_queue<Piece> pieces_;
};

// ---- what lights do not reach

bool faces_away(const LightSource& light, const Triangle& triangle) {
    for (int k = 0; k < 3; ++k) {
        const glm::dvec3 towards =
            light.kind == LightSource::Kind::directional ? light.direction : light.position - triangle.corners[k];
        if (!(glm::dot(triangle.normals[k], towards) <= 0)) return false; // a normal of 0 is lit by nothing
    }
    return true;
}

// The light's directions differ by so much from that at the ball's middle.
bool faces_away(const LightSource& light, const Standing& standing, const Ball& ball) {
    if (!standing.light_bounds) return false;
    const vdtree::VertexCone& cone = standing.light_bounds->cones()[ball.node];
    glm::dvec3 towards = light.direction;
    double spread = 1e-3; // radians: cones are of floats
    if (light.kind != LightSource::Kind::directional) {
        const glm::dvec3 way = light.position - ball.sphere.centre;
        const double distance = glm::length(way);
        if (!(distance > ball.sphere.radius)) return false;
        towards = way / distance;
        spread += std::asin(ball.sphere.radius / distance);
    }
    if (!(cone.cosine > -1)) return false; // normals may point anywhere
    const glm::dvec3 axis = standing.object->placement.rotation * glm::dvec3(cone.axis);
    const double apart = std::acos(std::clamp(glm::dot(axis, towards), -1.0, 1.0));
    return apart - std::acos(static_cast<double>(cone.cosine)) - spread >= std::numbers::pi / 2;
}

// ---- the window

// Views from nearby: by this share of the way to the nearest ball that may be seen, but no more than this share of the
// scene's radius, and no less than that one. Shadows that are nearer than that may be at the eye.
constexpr double share_near_by = 1.0 / 4, farthest_near_by = 1.0 / 16, nearest_near_by = 1.0 / 100;
constexpr double turned = 0.07; // radians, and what else may change of the window's planes

bool is_alike(const LightSource& a, const LightSource& b) {
    constexpr double rounding = 1e-9; // of lights that are the same in the world, but come from other objects' frames
    if (a.kind != b.kind || a.casts_shadow != b.casts_shadow ||
        !(std::abs(a.intensity - b.intensity) <= rounding * a.intensity))
        return false;
    if (a.kind == LightSource::Kind::directional) return glm::length(a.direction - b.direction) <= rounding;
    return glm::length(a.position - b.position) <= rounding * (a.distance + glm::length(a.position)) &&
           std::abs(a.distance - b.distance) <= rounding * a.distance;
}

// ---- what a light sees

// The footprint of a ball, in a map's coordinates.
struct Footprint {
    double low[2], high[2], from, to; // across, and along the light
};

struct Range {
    double low = infinity, high = -infinity;
    void include(double from, double to) { low = std::min(low, from), high = std::max(high, to); }
    double size() const { return high > low ? high - low : 1; }
};

} // namespace

ShadowReceivers::ShadowReceivers(std::vector<Standing> standing) : standing_(std::move(standing)) {
    WorldSphere all{{}, 0};
    for (const Standing& one : standing_) {
        const WorldSphere own = world_sphere(*one.object);
        if (all.radius == 0) all = own;
        all.radius = std::max(all.radius, glm::length(own.centre - all.centre) + own.radius);
    }
    edge_ = edge_width * all.radius;
    Cover cover(standing_);
    cover.part(finest * all.radius, balls_);
    triangles_ = cover.take_triangles();
}

std::vector<bool> ShadowReceivers::find_lit(const LightSource& light) const {
    std::vector<bool> lit;
    lit.reserve(balls_.size());
    for (const Ball& ball : balls_)
        lit.push_back(!(ball.node == vdtree::no_node ? faces_away(light, triangles_[ball.triangle])
                                                     : faces_away(light, standing_[ball.standing], ball)));
    return lit;
}

bool is_alike(const vdtree::Lighting& a, const vdtree::Lighting& b) {
    return std::equal(a.lights.begin(), a.lights.end(), b.lights.begin(), b.lights.end(),
                      [](const LightSource& one, const LightSource& other) { return is_alike(one, other); });
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
        constexpr double least_along = std::numbers::inv_sqrt3 / outward;
        if (w + std::numbers::sqrt2 * outward * r < least_along * distance) return std::nullopt;
        const double sine = r / distance; // of half the angle under which it is seen
        const double spread = std::sqrt(2 - 2 * std::sqrt((1 - sine) * (1 + sine))) * outward + 1e-7;
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

ShadowReach::ShadowReach(const ShadowReceivers& receivers, const LitReceivers& lit,
                         std::shared_ptr<const perception::ShadowEdges> edges, glm::dvec3 eye,
                         std::span<const vdtree::Plane> window, bool moves)
    : lighting_(lit.lighting), edges_(std::move(edges)), eye_(eye), window_(window.begin(), window.end()),
      moves_(moves), edge_(receivers.edge_) {
    if (receivers.balls().empty()) return;
    const glm::dvec3 middle = receivers.balls().front().sphere.centre;
    for (const Ball& ball : receivers.balls())
        scene_radius_ = std::max(scene_radius_, glm::length(ball.sphere.centre - middle) + ball.sphere.radius);
    const std::vector<Seen> seen = find_seen(receivers);
    for (const LightSource& light : lighting_.lights)
        if (light.casts_shadow) lights_.push_back(mapped(light, receivers, lit.of_lights[lights_.size()], seen));
}

ShadowReach::~ShadowReach() = default;

namespace {

// From all eyes that are so near to this one.
bool is_back(const Standing& standing, const Ball& ball, const Triangle* triangle, glm::dvec3 eye, double near_by) {
    const Object& object = *standing.object;
    const WorldSphere whole = world_sphere(object);
    if (!standing.hides_back_faces || !(glm::length(eye - whole.centre) > whole.radius + near_by)) return false;
    const bool is_inside_out = object.tree.closedness() == vdtree::Closedness::closed_inward;
    if (triangle) {
        const glm::dvec3 across =
            glm::cross(triangle->corners[1] - triangle->corners[0], triangle->corners[2] - triangle->corners[0]);
        const double height = glm::dot(across, eye - triangle->corners[0]) * (is_inside_out ? -1 : 1);
        return height < -glm::length(across) * near_by * outward;
    }
    const vdtree::NodeBounds& bounds = object.tree.bounds()[ball.node];
    if (bounds.flags & vdtree::irregular_ring) return false;
    const glm::dvec3 way = object.placement.to_mesh(eye) - object.tree.origin() - glm::dvec3(bounds.ring.centre);
    const double distance = glm::length(way);
    const double reach = static_cast<double>(bounds.ring.radius) + near_by / object.placement.scale * outward;
    if (!(distance > reach)) return false;
    const vdtree::Facing side = vdtree::facing(bounds.slabs, glm::vec3(way / distance), static_cast<float>(distance),
                                               static_cast<float>(reach * outward));
    return side == (is_inside_out ? vdtree::Facing::front : vdtree::Facing::back);
}

} // namespace

std::vector<ShadowReach::Seen> ShadowReach::find_seen(const ShadowReceivers& receivers) {
    const std::vector<Ball>& balls = receivers.balls();
    std::vector<Seen> seen;
    const auto find = [&](bool without_backs) {
        seen.clear();
        for (std::size_t i = 0; i < balls.size(); ++i) {
            const Ball& ball = balls[i];
            const glm::dvec3 to = ball.sphere.centre - eye_;
            const double distance = glm::length(to), radius = ball.sphere.radius;
            const double margin = radius + (moves_ ? turned : 0) * distance + near_by_;
            if (std::any_of(window_.begin(), window_.end(),
                            [&](const vdtree::Plane& plane) { return glm::dot(plane.normal, to) < -margin; }))
                continue;
            if (without_backs &&
                is_back(receivers.standing()[ball.standing], ball,
                        ball.node == vdtree::no_node ? &receivers.triangles()[ball.triangle] : nullptr, eye_, near_by_))
                continue;
            const double nearest = distance - radius - near_by_;
            seen.push_back({static_cast<std::uint32_t>(i), nearest > 0 ? nearest : 0}); // 0 for NaN
        }
    };
    if (moves_) {
        find(false);
        double nearest = infinity;
        for (const Seen& ball : seen) nearest = std::min(nearest, ball.distance);
        near_by_ =
            std::clamp(share_near_by * nearest, nearest_near_by * scene_radius_, farthest_near_by * scene_radius_);
    }
    find(!window_.empty());
    return seen;
}

ShadowReach::MappedLight ShadowReach::mapped(const LightSource& light, const ShadowReceivers& receivers,
                                             const std::vector<bool>& lit, const std::vector<Seen>& all_seen) const {
    std::vector<Seen> seen;
    for (const Seen& ball : all_seen)
        if (lit[ball.ball]) seen.push_back(ball);
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
        if (ball.node == vdtree::no_node) {
            nearest = infinity;
            for (const glm::dvec3& corner : receivers.triangles()[ball.triangle].corners)
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
    const double largest_turn = moves_ ? turned : 0;
    return edges == edges_.get() && glm::length(eye - eye_) <= near_by_ &&
           std::equal(window.begin(), window.end(), window_.begin(), window_.end(),
                      [&](const vdtree::Plane& a, const vdtree::Plane& b) {
                          return glm::length(a.normal - b.normal) <= largest_turn;
                      }) &&
           is_alike(lighting, lighting_);
}

bool ShadowReach::is_of(glm::dvec3 eye, std::span<const vdtree::Plane> window) const {
    return eye == eye_ &&
           std::equal(window.begin(), window.end(), window_.begin(), window_.end(),
                      [](const vdtree::Plane& a, const vdtree::Plane& b) { return a.normal == b.normal; });
}

double ShadowReach::unseen_shift(const WorldSphere& sphere) const {
    double least = infinity;
    const WorldSphere wide{sphere.centre, sphere.radius * outward + edge_};
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
