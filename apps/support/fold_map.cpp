#include "fold_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <unseen/perception/criterion.h>
#include <unseen/vdtree/internal/normal_mask.h>
#include <unseen/vdtree/internal/number_format.h>

#include "colour_bar.h"

namespace unseen::app {
namespace {

using perception::Image;
using vdtree::NodeId;

// ---- what a node's fold is worth

// How values become colours: from `low` on by logarithms, or evenly.
struct Scale {
    double low = 0, high = 1;
    bool is_logarithmic = false;
    std::vector<double> ticks;
    std::string unit;

    double place(double value) const { // 0..1
        const double at = is_logarithmic ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
        return at > 0 ? std::min(at, 1.0) : 0; // 0 for NaN
    }
};

Scale scale_of(FoldMap map, const perception::Display& display, double largest) {
    switch (map) {
    case FoldMap::cost:
        return {1.0 / 64, 1, true, {1.0 / 64, 1.0 / 16, 1.0 / 4, 1}, "fold cost; 1: just imperceptible, red: more"};
    case FoldMap::frequency: {
        Scale scale{0.1,
                    perception::nyquist(perception::finest_pixels_per_degree(display)).value(),
                    true,
                    {0.1, 0.3, 1, 3, 10, 30},
                    "cycles per degree"};
        std::erase_if(scale.ticks, [&](double tick) { return tick > scale.high; });
        return scale;
    }
    case FoldMap::contrast: return {0.01, 1, true, {0.01, 0.03, 0.1, 0.3, 1}, "Michelson contrast"};
    case FoldMap::eccentricity: break;
    }
    const double high = std::max(largest, 1.0);
    return {0, high, false, {0, std::round(high / 2), std::floor(high)}, "degrees from the gaze"};
}

// The scene as it is seen, in the tree's frame.
class Sight {
public:
    Sight(const session::Session& session, const vdtree::View& view)
        : tree_(session.tree()), display_(session.observer().display) {
        const vdtree::Similarity& placement = session.scene().objects.front().placement;
        perception::FoldTestOptions options;
        options.display = display_;
        if (session.observer().gaze) options.gaze_px = session.observer().gaze->px;
        viewpoint_ = perception::viewpoint_of(tree_, view, options, placement);
        const vdtree::LuminanceRange range = tree_.luminance_range();
        darkest_ = std::min(range.lo, session.background());
        brightest_ = std::max(range.hi, session.background());
        pixel_deg_ = 1 / perception::coarsest_pixels_per_degree(display_).value();
        has_gaze_ = viewpoint_.gaze.has_value();
        ahead_ = placement.direction_to_mesh(-vdtree::camera_frame(view).back);
        const double half_screen_deg = perception::physical_field(display_, view.height).value() / 2;
        magnification_ = std::tan(half_screen_deg / perception::degrees_per_radian) /
                         std::tan(view.fov_y_degrees / 2 / perception::degrees_per_radian);
        if (has_gaze_) gaze_on_screen_ = on_screen(*viewpoint_.gaze);
    }

    double frequency(NodeId node) const {
        const vdtree::Sphere& ring = tree_.bounds()[node].ring;
        const glm::dvec3 to_centre = glm::dvec3(ring.centre) - viewpoint_.eye;
        const double distance = glm::length(to_centre);
        const double angle =
            ring.radius < distance ? 2 * std::asin(ring.radius / distance) * perception::degrees_per_radian : 180;
        return 1 / (2 * std::clamp(angle * largest_magnification(to_centre), pixel_deg_, 180.0));
    }

    double contrast(NodeId node) const {
        const vdtree::NodeBounds& around = tree_.bounds()[node];
        const glm::dvec3 to_eye = viewpoint_.eye - glm::dvec3(around.ring.centre);
        const double distance = glm::length(to_eye);
        const bool is_silhouette =
            (around.flags & (vdtree::irregular_ring | vdtree::translucent_ring)) || !(around.ring.radius < distance) ||
            vdtree::facing(around.slabs, glm::vec3(to_eye / distance), static_cast<float>(distance),
                           around.ring.radius) == vdtree::Facing::mixed;
        vdtree::LuminanceRange range = tree_.ring_luminance()[node];
        if (is_silhouette) range = {std::min(range.lo, darkest_), std::max(range.hi, brightest_)};
        const double lo = perception::to_luminance(display_, static_cast<double>(range.lo)).value(),
                     hi = perception::to_luminance(display_, static_cast<double>(range.hi)).value();
        return (hi - lo) / (hi + lo);
    }

    double eccentricity(NodeId node) const {
        const vdtree::Sphere& ring = tree_.bounds()[node].ring;
        const glm::dvec3 to_centre = glm::dvec3(ring.centre) - viewpoint_.eye;
        const double distance = glm::length(to_centre);
        if (!has_gaze_ || !(ring.radius < distance)) return 0;
        const glm::dvec3 seen = on_screen(to_centre);
        const double angle =
            std::atan2(glm::length(glm::cross(seen, gaze_on_screen_)), glm::dot(seen, gaze_on_screen_));
        return std::max(0.0, angle - std::asin(ring.radius / distance) * largest_magnification(to_centre)) *
               perception::degrees_per_radian;
    }

private:
    // Where the viewer sees on the screen what the camera sees there.
    glm::dvec3 on_screen(glm::dvec3 direction) const {
        const double depth = glm::dot(direction, ahead_);
        return depth > 0 ? depth * ahead_ + magnification_ * (direction - depth * ahead_) : direction;
    }
    // The magnification of small angles there, the larger one of along the radius and across it.
    double largest_magnification(glm::dvec3 direction) const {
        const double depth = glm::dot(direction, ahead_), m = magnification_;
        if (!(depth > 0)) return std::max(m, 1 / m);
        const glm::dvec3 aside = direction - depth * ahead_;
        const double t2 = glm::dot(aside, aside) / (depth * depth), across_squared = (1 + t2) / (1 + m * m * t2);
        return m * std::max(across_squared, std::sqrt(across_squared));
    }

    const vdtree::VertexTree& tree_;
    const perception::Display& display_;
    vdtree::Viewpoint viewpoint_;
    float darkest_ = 0, brightest_ = 1;
    double pixel_deg_ = 0;
    bool has_gaze_ = false;
    glm::dvec3 ahead_{0}, gaze_on_screen_{0};
    double magnification_ = 1; // of tangents, from the camera to the screen
};

// ---- colours

// From dark blue by green to yellow, evenly bright steps; for people with any kind of colour vision.
glm::vec3 colour_at(double place) {
    constexpr std::array<glm::vec3, 6> stops = {glm::vec3(0.16f, 0.05f, 0.37f), glm::vec3(0.20f, 0.27f, 0.54f),
                                                glm::vec3(0.14f, 0.46f, 0.55f), glm::vec3(0.20f, 0.64f, 0.47f),
                                                glm::vec3(0.56f, 0.78f, 0.28f), glm::vec3(0.99f, 0.91f, 0.24f)};
    return mixed_colour(stops, place);
}

constexpr glm::vec3 too_much{0.9f, 0.15f, 0.1f}, unfolded{0.45f}, background{0};

// ---- drawing: the nearest triangle at each pixel's centre, coloured by its nearest corner

struct Corner {
    glm::dvec3 place; // right, up, depth from the eye
    NodeId node;      // whose vertex it is
};

// What lies beyond a plane close before the eye: a polygon of up to four corners. New corners are those of the nearer
// end.
std::vector<Corner> clipped(const std::array<Corner, 3>& triangle, double nearest) {
    std::vector<Corner> kept;
    for (std::size_t i = 0; i < 3; ++i) {
        const Corner &a = triangle[i], &b = triangle[(i + 1) % 3];
        const bool a_in = a.place.z > nearest, b_in = b.place.z > nearest;
        if (a_in) kept.push_back(a);
        if (a_in != b_in) {
            const double t = (nearest - a.place.z) / (b.place.z - a.place.z);
            kept.push_back({glm::mix(a.place, b.place, t), a_in ? a.node : b.node});
        }
    }
    return kept;
}

class Raster {
public:
    Raster(const session::Session& session, const vdtree::View& view)
        : tree_(session.tree()), width_(view.width), height_(view.height), frame_(vdtree::camera_frame(view)),
          eye_(view.eye), placement_(session.scene().objects.front().placement),
          focal_px_(view.height / 2.0 / std::tan(view.fov_y_degrees * std::numbers::pi / 360)),
          nearness_(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), 0),
          nodes_(nearness_.size(), vdtree::no_node) {
        nearest_ = 1e-6 * std::max(session.bounding_sphere().radius, std::numeric_limits<double>::min());
        for (NodeId node = 0; node < tree_.node_count(); ++node) node_of_wedge_.resize(tree_.wedge_end(node), node);
    }

    void draw(const vdtree::Cut& cut) {
        const auto indices = cut.indices();
        for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
            const auto polygon =
                clipped({corner(indices[i]), corner(indices[i + 1]), corner(indices[i + 2])}, nearest_);
            for (std::size_t k = 2; k < polygon.size(); ++k) draw({polygon[0], polygon[k - 1], polygon[k]});
        }
    }
    // The node whose vertex is nearest, or no_node.
    NodeId node_at(int x, int y) const { return nodes_[at(x, y)]; }

private:
    std::size_t at(int x, int y) const {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
    }

    Corner corner(vdtree::WedgeId wedge) const {
        const glm::dvec3 from_eye = placement_.to_world(tree_.origin() + glm::dvec3(tree_.positions()[wedge])) - eye_;
        return {{glm::dot(from_eye, frame_.right), glm::dot(from_eye, frame_.up), -glm::dot(from_eye, frame_.back)},
                node_of_wedge_[wedge]};
    }

    void draw(const std::array<Corner, 3>& corners) {
        std::array<glm::dvec3, 3> p; // x, y in pixels, 1 / depth
        for (std::size_t i = 0; i < 3; ++i) {
            const glm::dvec3& c = corners[i].place;
            p[i] = {width_ / 2.0 + focal_px_ * c.x / c.z, height_ / 2.0 - focal_px_ * c.y / c.z, 1 / c.z};
        }
        const double area = (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[2].x - p[0].x) * (p[1].y - p[0].y);
        if (!(std::abs(area) > 0)) return;
        const auto [left, right] = std::minmax({p[0].x, p[1].x, p[2].x});
        const auto [top, bottom] = std::minmax({p[0].y, p[1].y, p[2].y});
        const int x_end = static_cast<int>(std::min<double>(width_, std::ceil(right + 0.5))),
                  y_end = static_cast<int>(std::min<double>(height_, std::ceil(bottom + 0.5)));
        for (int y = static_cast<int>(std::max(0.0, std::floor(top - 0.5))); y < y_end; ++y) {
            for (int x = static_cast<int>(std::max(0.0, std::floor(left - 0.5))); x < x_end; ++x) {
                const glm::dvec2 q(x + 0.5, y + 0.5);
                std::array<double, 3> w;
                for (std::size_t i = 0; i < 3; ++i) {
                    const glm::dvec3 &a = p[(i + 1) % 3], &b = p[(i + 2) % 3];
                    w[i] = ((b.x - a.x) * (q.y - a.y) - (q.x - a.x) * (b.y - a.y)) / area;
                }
                if (!(w[0] >= 0 && w[1] >= 0 && w[2] >= 0)) continue;
                const double nearness = w[0] * p[0].z + w[1] * p[1].z + w[2] * p[2].z;
                if (!(nearness > nearness_[at(x, y)])) continue;
                nearness_[at(x, y)] = nearness;
                nodes_[at(x, y)] =
                    corners[static_cast<std::size_t>(std::max_element(w.begin(), w.end()) - w.begin())].node;
            }
        }
    }

    const vdtree::VertexTree& tree_;
    int width_, height_;
    vdtree::CameraFrame frame_;
    glm::dvec3 eye_;
    const vdtree::Similarity& placement_;
    double focal_px_, nearest_ = 0;
    std::vector<double> nearness_;
    std::vector<NodeId> nodes_; // by pixel
    std::vector<NodeId> node_of_wedge_;
};

// ---- the scale below

ColourBar bar_of(const Scale& scale) {
    ColourBar bar;
    bar.colour_at = colour_at;
    for (const double tick : scale.ticks) bar.ticks.push_back({scale.place(tick), rounded(tick, 2)});
    bar.unit = scale.unit;
    return bar;
}

} // namespace

Result<Image> draw_fold_map(const vdtree::Cut& cut, session::Session& session, const vdtree::View& seen,
                            const session::Request& request, FoldMap map, const vdtree::View& view) {
    const vdtree::VertexTree& tree = session.tree();
    const Sight sight(session, seen);
    std::vector<float> costs;
    if (map == FoldMap::cost) {
        const auto recipe = session.recipe(seen, request);
        if (!recipe) return recipe.error();
        auto found = vdtree::find_every_cost(tree, *recipe->criterion, recipe->viewpoint,
                                             {.cull_back_faces = recipe->options.cull_back_faces});
        if (!found) return found.error();
        costs = std::move(*found);
    }
    const auto value = [&](NodeId node) {
        switch (map) {
        case FoldMap::cost: return static_cast<double>(costs[node]);
        case FoldMap::frequency: return sight.frequency(node);
        case FoldMap::contrast: return sight.contrast(node);
        case FoldMap::eccentricity: break;
        }
        return sight.eccentricity(node);
    };

    Raster raster(session, view);
    raster.draw(cut);
    double largest = 0;
    if (map == FoldMap::eccentricity)
        for (int y = 0; y < view.height; ++y)
            for (int x = 0; x < view.width; ++x)
                if (const NodeId node = raster.node_at(x, y); node < tree.interior_count())
                    largest = std::max(largest, value(node));
    const Scale scale = scale_of(map, session.observer().display, largest);
    Image image{view.width, view.height, 3, {}};
    image.values.reserve(image.index(0, view.height, 0));
    for (int y = 0; y < view.height; ++y) {
        for (int x = 0; x < view.width; ++x) {
            const NodeId node = raster.node_at(x, y);
            const bool is_covered = node != vdtree::no_node, is_folded = is_covered && node < tree.interior_count();
            const double v = is_folded ? value(node) : 0;
            const bool is_more = is_folded && map == FoldMap::cost && !(v <= 1);
            const glm::vec3 colour = !is_covered  ? background
                                     : !is_folded ? unfolded
                                     : is_more    ? too_much
                                                  : colour_at(scale.place(v));
            image.values.insert(image.values.end(), {colour.r, colour.g, colour.b});
        }
    }
    return with_colour_bar(image, bar_of(scale));
}

} // namespace unseen::app
