// Let E be an eye within reach of the picture's eye O, and X a hidden place. The line from E to X is compared with that
// from O to X, point by point at the same share of the way: points there differ by a part of what E and O differ by, w. So
// the image of the one, as O has it, is X's own image but for f (w_x - t w_z) / z, where t is the tangent of X's direction
// and z the distance along the axis. Up to the least distance of the surface around the line is in front of the surface, and
// X is behind it.
#include <unseen/vdtree/occlusion_map.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/errors.h>

namespace unseen::vdtree {
namespace {

// Pixels; gaps that open by less count as closed. What folds move of outlines is as wide and is not seen.
constexpr double narrowest_gap_px = 0.25;
// Pixels around: samples lie anywhere in theirs, and outlines of what is drawn are off by less than a pixel.
constexpr double margin_px = 2;
// Share of a distance: reciprocals are floats, and went through a few roundings.
constexpr double depth_rounding = 1e-5;
// A question looks at so many cells along each axis at most.
constexpr int cells_a_side = 3;
// The image may move farther once it is known what is how near there; rarely more often than this.
constexpr int most_turns = 4;

} // namespace

struct OcclusionMap::Grids {
    View view;
    EyeReach reach;
    glm::dvec3 along;   // the reach's, right, down and ahead
    double around = 0;  // the reach's, as images have it where they are stretched most
    double deepest = 0; // how far ahead an eye may be
    CameraFrame camera;
    double focal_px = 1;
    glm::dvec2 half_tangent; // of the window's sides
    double cell_px = 1;
    struct Grid {
        int columns = 0, rows = 0;
        std::vector<float> least, most; // of 2 x 2 of the grid before; least is 0 at holes
    };
    std::vector<Grid> levels;

    struct Box {
        double left, top, right, bottom; // pixels
    };
    struct Range {
        float least, most;
    };
    Range range_in(const Box& box) const noexcept;
    // By how much what is at reciprocal distances up to this may move, in the box.
    Box widened(const Box& box, double reciprocal) const noexcept;
    // By how many pixels neighbours move apart for each unit that their reciprocals differ by.
    double opening(glm::dvec2 px) const noexcept;

    glm::dvec2 tangent(double x, double y) const noexcept {
        return (glm::dvec2(x, y) - 0.5 * glm::dvec2(view.width, view.height)) / focal_px;
    }
};

Result<OcclusionMap> OcclusionMap::create(const View& view, DepthCells cells, const EyeReach& reach) {
    if (const auto valid = validate_centred(view, "An occlusion map"); !valid) return valid.error();
    if (!(reach.around >= 0 && std::isfinite(reach.around) && std::isfinite(glm::length(reach.along))))
        return invalid_argument("The reach of an occlusion map must be 0 or more, and finite.");
    if (cells.cell_px < 1 || cells.columns != (view.width + cells.cell_px - 1) / cells.cell_px ||
        cells.rows != (view.height + cells.cell_px - 1) / cells.cell_px)
        return invalid_argument("The cells of an occlusion map must cover the view's window.");
    const std::size_t count = static_cast<std::size_t>(cells.columns) * static_cast<std::size_t>(cells.rows);
    if (cells.least.size() != count || cells.most.size() != count || cells.jump.size() != count)
        return invalid_argument("An occlusion map of this view has " + std::to_string(count) + " cells.");
    auto all = std::make_shared<Grids>();
    all->view = view;
    all->reach = reach;
    all->camera = camera_frame(view);
    const double half = std::tan(view.fov_y_degrees * (std::numbers::pi / 360));
    all->focal_px = view.height / (2 * half);
    all->half_tangent = {half * view.width / view.height, half};
    all->cell_px = cells.cell_px;
    all->along = {glm::dot(reach.along, all->camera.right), -glm::dot(reach.along, all->camera.up),
                  -glm::dot(reach.along, all->camera.back)};
    all->around = reach.around * std::sqrt(1 + glm::dot(all->half_tangent, all->half_tangent));
    all->deepest = std::max(all->along.z, 0.0) + reach.around;
    for (std::size_t i = 0; i < count; ++i) {
        const auto is_fine = [](float x) { return x >= 0 && std::isfinite(x); };
        if (!is_fine(cells.least[i]) || !is_fine(cells.most[i]) || !is_fine(cells.jump[i]))
            return invalid_argument("Cell " + std::to_string(i) +
                                    " of an occlusion map: reciprocals must be 0 or more, and finite.");
        const auto column = static_cast<double>(i % static_cast<std::size_t>(cells.columns)),
                   row = static_cast<double>(i / static_cast<std::size_t>(cells.columns));
        double opens = 0; // linear along each side, so largest at a corner
        for (const double x : {column, column + 1})
            for (const double y : {row, row + 1})
                opens = std::max(opens, all->opening(static_cast<double>(cells.cell_px) * glm::dvec2(x, y)));
        if (!(opens * static_cast<double>(cells.jump[i]) <= narrowest_gap_px)) cells.least[i] = 0;
    }
    all->levels.push_back({cells.columns, cells.rows, std::move(cells.least), std::move(cells.most)});
    while (all->levels.back().columns > 1 || all->levels.back().rows > 1) {
        const Grids::Grid& fine = all->levels.back();
        Grids::Grid coarse{(fine.columns + 1) / 2, (fine.rows + 1) / 2, {}, {}};
        for (int y = 0; y < coarse.rows; ++y)
            for (int x = 0; x < coarse.columns; ++x) {
                const auto place = [&](int column, int row) {
                    return static_cast<std::size_t>(std::min(row, fine.rows - 1)) *
                               static_cast<std::size_t>(fine.columns) +
                           static_cast<std::size_t>(std::min(column, fine.columns - 1));
                };
                const std::size_t four[] = {place(2 * x, 2 * y), place(2 * x + 1, 2 * y), place(2 * x, 2 * y + 1),
                                            place(2 * x + 1, 2 * y + 1)};
                float least = fine.least[four[0]], most = fine.most[four[0]];
                for (const std::size_t i : four) {
                    least = std::min(least, fine.least[i]);
                    most = std::max(most, fine.most[i]);
                }
                coarse.least.push_back(least);
                coarse.most.push_back(most);
            }
        all->levels.push_back(std::move(coarse));
    }
    return OcclusionMap(std::move(all));
}

const View& OcclusionMap::view() const noexcept { return grids_->view; }
const EyeReach& OcclusionMap::reach() const noexcept { return grids_->reach; }

bool OcclusionMap::holds_for(glm::dvec3 eye) const noexcept {
    const glm::dvec3 way = eye - view().eye, along = reach().along;
    const double square = glm::dot(along, along);
    const double share = square > 0 ? std::clamp(glm::dot(way, along) / square, 0.0, 1.0) : 0;
    return glm::length(way - share * along) <= reach().around;
}

double OcclusionMap::Grids::opening(glm::dvec2 px) const noexcept {
    const glm::dvec2 t = tangent(px.x, px.y);
    return focal_px * (glm::length(glm::dvec2(along) - t * along.z) + around);
}

OcclusionMap::Grids::Box OcclusionMap::Grids::widened(const Box& box, double reciprocal) const noexcept {
    const glm::dvec2 first = tangent(box.left, box.top), last = tangent(box.right, box.bottom);
    const glm::dvec2 a = glm::dvec2(along) - first * along.z, b = glm::dvec2(along) - last * along.z;
    const double scale = focal_px * reciprocal;
    return {box.left + scale * (std::min({0.0, a.x, b.x}) - around) - margin_px,
            box.top + scale * (std::min({0.0, a.y, b.y}) - around) - margin_px,
            box.right + scale * (std::max({0.0, a.x, b.x}) + around) + margin_px,
            box.bottom + scale * (std::max({0.0, a.y, b.y}) + around) + margin_px};
}

OcclusionMap::Grids::Range OcclusionMap::Grids::range_in(const Box& box) const noexcept {
    const auto cell = [&](double px, int cells) {
        return std::clamp(static_cast<int>(std::floor(px / cell_px)), 0, cells - 1);
    };
    const int columns = levels.front().columns, rows = levels.front().rows;
    const int left = cell(box.left, columns), right = cell(box.right, columns);
    const int top = cell(box.top, rows), bottom = cell(box.bottom, rows);
    std::size_t level = 0;
    while ((right >> level) - (left >> level) >= cells_a_side || (bottom >> level) - (top >> level) >= cells_a_side)
        ++level;
    const Grid& grid = levels[level];
    Range range{grid.least[static_cast<std::size_t>(top >> level) * static_cast<std::size_t>(grid.columns) +
                           static_cast<std::size_t>(left >> level)],
                0};
    for (int y = top >> level; y <= bottom >> level; ++y)
        for (int x = left >> level; x <= right >> level; ++x) {
            const std::size_t i =
                static_cast<std::size_t>(y) * static_cast<std::size_t>(grid.columns) + static_cast<std::size_t>(x);
            range.least = std::min(range.least, grid.least[i]);
            range.most = std::max(range.most, grid.most[i]);
        }
    return range;
}

bool OcclusionMap::hides(glm::dvec3 centre, double radius) const noexcept {
    return look_at(centre, radius) == Answer::hidden;
}

OcclusionMap::Answer OcclusionMap::look_at(glm::dvec3 centre, double radius) const noexcept {
    const Grids& all = *grids_;
    const glm::dvec3 from_eye = centre - all.view.eye;
    const double along = -glm::dot(from_eye, all.camera.back), nearest = along - radius;
    // Around the eyes, or behind them, or of no size that is a number.
    if (!(nearest > all.deepest)) return nearest + 2 * radius > 0 ? Answer::partly : Answer::seen;
    const double x = glm::dot(from_eye, all.camera.right), y = glm::dot(from_eye, all.camera.up);
    const glm::dvec2 middle(0.5 * all.view.width, 0.5 * all.view.height);
    // All of the ball lies in its box, whose image is that of the corners at its near or at its far side.
    const double farthest = along + radius, f = all.focal_px;
    const auto least = [&](double a) { return a >= 0 ? a / farthest : a / nearest; };
    const auto most = [&](double a) { return a >= 0 ? a / nearest : a / farthest; };
    const Grids::Box ball{middle.x + f * least(x - radius), middle.y - f * most(y + radius),
                          middle.x + f * most(x + radius), middle.y - f * least(y - radius)};
    double counted = 0; // the largest reciprocal that the box is widened for
    for (int turn = 0; turn < most_turns; ++turn) {
        const Grids::Box around = all.widened(ball, counted);
        if (!(around.left >= 0 && around.top >= 0 && around.right <= all.view.width &&
              around.bottom <= all.view.height)) {
            const bool is_beside =
                around.right < 0 || around.bottom < 0 || around.left > all.view.width || around.top > all.view.height;
            return is_beside ? Answer::seen : Answer::partly;
        }
        const auto [far, near] = all.range_in(around);
        // The surface is ahead of the eyes, and the place behind the surface.
        const bool is_covered = static_cast<double>(far) * (nearest * (1 - depth_rounding)) > 1 &&
                                static_cast<double>(near) * all.deepest < 1;
        if (!is_covered) {
            // Nothing there is nearer than even the far side, or what is under it is no larger than a cell.
            const bool is_small = ball.right - ball.left < all.cell_px && ball.bottom - ball.top < all.cell_px;
            return is_small || !(static_cast<double>(near) * farthest > 1) ? Answer::seen : Answer::partly;
        }
        if (static_cast<double>(near) <= counted) return Answer::hidden;
        counted = static_cast<double>(near);
    }
    return Answer::partly;
}

Result<std::shared_ptr<const std::vector<std::uint64_t>>>
find_hidden(const VertexTree& tree, const Similarity& placement, const OcclusionMap& map) {
    const auto sound = SoundTree::of(tree);
    if (!sound) return sound.error();
    constexpr NodeId word = 64;
    const NodeId interior = tree.interior_count();
    auto hidden = std::make_shared<std::vector<std::uint64_t>>((interior + word - 1) / word, 0);
    bool is_any = false;
    for (NodeId node = 0; node < interior;) {
        const Sphere& ring = tree.bounds()[node].ring;
        const glm::dvec3 centre = placement.to_world(tree.origin() + glm::dvec3(ring.centre));
        const auto answer = map.look_at(centre, placement.scale * static_cast<double>(ring.radius));
        if (answer == OcclusionMap::Answer::partly) {
            ++node;
            continue;
        }
        const NodeId end = sound->subtree_end()[node];
        if (answer == OcclusionMap::Answer::hidden) {
            is_any = true;
            for (NodeId under = node; under < end; ++under)
                (*hidden)[under / word] |= std::uint64_t{1} << (under % word);
        }
        node = end;
    }
    if (!is_any) return std::shared_ptr<const std::vector<std::uint64_t>>();
    return std::shared_ptr<const std::vector<std::uint64_t>>(std::move(hidden));
}

} // namespace unseen::vdtree
