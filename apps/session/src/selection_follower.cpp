#include <unseen/session/internal/selection_search.h>
#include <unseen/session/internal/selections.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <queue>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <unseen/session/session.h>
#include <unseen/vdtree/internal/errors.h>

namespace unseen::session {
namespace {

// What a level costs falls with the distance: the pixels of an object with its square, and how far its triangles stray
// on the screen with the distance itself.
constexpr double cost_falls = 3;
// From corners that are so many times farther from an object, or nearer, one does not conclude more.
constexpr double most_ratio = 8;
// Objects of which all corners see nothing are still told apart: by their size, for each halving of the triangles so
// much of what a covered pixel could lose.
constexpr double unseen_cost = 1e-5;

struct WeighedCorner {
    const SelectionCorner* corner;
    double weight;
};

} // namespace

std::vector<int> levels_within(std::span<const LevelCosts> objects, std::uint64_t budget) {
    struct Step {
        double cost; // a triangle saved
        std::uint64_t saved;
        std::size_t object;
        int to;
    };
    const auto is_worse = [](const Step& a, const Step& b) {
        if (a.cost != b.cost) return a.cost > b.cost;
        if (a.saved != b.saved) return a.saved < b.saved;
        return a.object > b.object;
    };
    std::priority_queue<Step, std::vector<Step>, decltype(is_worse)> queue(is_worse);
    std::vector<int> levels(objects.size(), 0);
    std::uint64_t total = 0;
    const auto triangles = [&](std::size_t i, int level) {
        return std::uint64_t{objects[i].triangles[static_cast<std::size_t>(level)]};
    };
    const auto cost = [&](std::size_t i, int level) { return objects[i].costs[static_cast<std::size_t>(level)]; };
    const auto add = [&](std::size_t i) {
        const int from = levels[i], last = static_cast<int>(objects[i].triangles.size()) - 1;
        std::optional<Step> best;
        for (int to = from + 1; to <= last; ++to) {
            const std::uint64_t saved = triangles(i, from) - triangles(i, to);
            const Step step{(cost(i, to) - cost(i, from)) / static_cast<double>(std::max<std::uint64_t>(saved, 1)),
                            saved, i, to};
            if (!best || is_worse(*best, step)) best = step;
        }
        if (best) queue.push(*best);
    };
    for (std::size_t i = 0; i < objects.size(); ++i) total += triangles(i, 0);
    if (total > budget)
        for (std::size_t i = 0; i < objects.size(); ++i) add(i);
    while (total > budget && !queue.empty()) {
        const Step step = queue.top();
        queue.pop();
        total -= step.saved;
        levels[step.object] = step.to;
        add(step.object);
    }
    // What is left.
    while (total <= budget) {
        double most = 0;
        std::optional<Step> best;
        for (std::size_t i = 0; i < objects.size(); ++i)
            for (int to = levels[i] - 1; to >= 0; --to) {
                const std::uint64_t more = triangles(i, to) - triangles(i, levels[i]);
                if (total + more > budget) break;
                const double gain =
                    (cost(i, levels[i]) - cost(i, to)) / static_cast<double>(std::max<std::uint64_t>(more, 1));
                if (gain > most) most = gain, best = Step{gain, more, i, to};
            }
        if (!best) break;
        total += best->saved;
        levels[best->object] = best->to;
    }
    return levels;
}

struct SelectionFollower::Impl {
    Selections file;
    const Selections::Data& selections = file.data();
    SelectionFollowOptions options;
    std::vector<WorldSphere> spheres;
    std::vector<int> levels; // of the last frame; empty: there was none

    Impl(Selections file_, const SelectionFollowOptions& options_) : file(std::move(file_)), options(options_) {}

    // The corners of the cell that the eye is in, or of the nearest one, by linear weights.
    std::vector<WeighedCorner> around(glm::dvec3 eye) const {
        const SelectionGrid& grid = selections.grid;
        const glm::dvec3 at = (eye - grid.origin) / grid.step;
        const SelectionCell* best = nullptr;
        double least = 0;
        glm::dvec3 share(0);
        for (const SelectionCell& cell : selections.cells) {
            const glm::dvec3 low(cell.at.x, cell.at.y, cell.at.z);
            glm::dvec3 in = glm::clamp((at - low) / static_cast<double>(cell.size), glm::dvec3(0), glm::dvec3(1));
            glm::dvec3 off = at - (low + in * static_cast<double>(cell.size));
            if (grid.is_on_ground()) in.y = off.y = 0;
            const double distance = glm::dot(off, off);
            if (best && !(distance < least)) continue;
            best = &cell, least = distance, share = in;
        }
        std::vector<WeighedCorner> corners;
        for (const LatticePoint& p : corners_of(grid, *best)) {
            const auto weight = [](bool is_high, double s) { return is_high ? s : 1 - s; };
            corners.push_back({selections.corner(p), weight(p.x > best->at.x, share.x) *
                                                         (grid.is_on_ground() ? 1 : weight(p.y > best->at.y, share.y)) *
                                                         weight(p.z > best->at.z, share.z)});
        }
        return corners;
    }

    std::vector<LevelCosts> costs_of(const std::vector<std::size_t>& objects, glm::dvec3 eye) const {
        std::vector<LevelCosts> costs;
        std::vector<std::size_t> place(spheres.size(), spheres.size()); // among the objects
        const auto distance = [&](std::size_t object, glm::dvec3 from) {
            return std::max(glm::length(spheres[object].centre - from), spheres[object].radius);
        };
        const double pixels = static_cast<double>(selections.window_px) * static_cast<double>(selections.window_px);
        for (std::size_t i = 0; i < objects.size(); ++i) {
            const std::size_t object = objects[i];
            place[object] = i;
            LevelCosts& own = costs.emplace_back();
            own.triangles = selections.triangles[object];
            const double size = spheres[object].radius / distance(object, eye);
            for (const std::uint32_t count : own.triangles)
                own.costs.push_back(unseen_cost * pixels * size * size *
                                    std::log2(static_cast<double>(std::max(own.triangles.front(), 1U)) /
                                              static_cast<double>(std::max(count, 1U))));
        }
        for (const WeighedCorner& around_eye : around(eye)) {
            if (!(around_eye.weight > 0)) continue;
            const glm::dvec3 from = selections.grid.place(around_eye.corner->at);
            for (const SelectionCamera& camera : around_eye.corner->cameras)
                for (const SelectedLevel& seen : camera.objects) {
                    const std::size_t i = place[seen.object];
                    if (i == spheres.size()) continue;
                    const double ratio = std::clamp(distance(seen.object, from) / distance(seen.object, eye),
                                                    1 / most_ratio, most_ratio);
                    const double factor = around_eye.weight * std::pow(ratio, cost_falls);
                    for (std::size_t k = 0; k < seen.costs.size(); ++k)
                        costs[i].costs[k + 1] += factor * static_cast<double>(seen.costs[k]);
                }
        }
        // Sums of pictures' losses need not rise with the level; what is coarser is not better.
        for (LevelCosts& own : costs)
            for (std::size_t k = 1; k < own.costs.size(); ++k) own.costs[k] = std::max(own.costs[k], own.costs[k - 1]);
        return costs;
    }

    std::vector<int> nearest(const vdtree::View& view) const {
        const SelectionCorner* corner = nullptr;
        double least = 0;
        for (const WeighedCorner& candidate : around(view.eye)) {
            const glm::dvec3 off = selections.grid.place(candidate.corner->at) - view.eye;
            if (const double d = glm::dot(off, off); !corner || d < least) corner = candidate.corner, least = d;
        }
        const glm::dvec3 ahead = glm::normalize(view.target - view.eye);
        std::vector<std::size_t> directions(corner->cameras.size());
        std::iota(directions.begin(), directions.end(), std::size_t{0});
        std::stable_sort(directions.begin(), directions.end(), [&](std::size_t a, std::size_t b) {
            return glm::dot(selection_directions[a], ahead) > glm::dot(selection_directions[b], ahead);
        });
        std::vector<int> chosen;
        for (const auto& counts : selections.triangles) chosen.push_back(static_cast<int>(counts.size()) - 1);
        for (std::size_t d = 0; d < 2; ++d)
            for (const SelectedLevel& seen : corner->cameras[directions[d]].objects)
                chosen[seen.object] = std::min(chosen[seen.object], static_cast<int>(seen.level));
        return chosen;
    }

    // From the levels of the last frame only so far towards those that were chosen as the budget asks for, and as is worth
    // it.
    void keep_what_holds(const std::vector<std::size_t>& objects, const std::vector<LevelCosts>& costs,
                         std::vector<int>& chosen) const {
        const std::vector<int> wanted = chosen;
        std::uint64_t total = 0;
        const auto triangles = [&](std::size_t i, int level) {
            return std::uint64_t{costs[i].triangles[static_cast<std::size_t>(level)]};
        };
        const auto cost = [&](std::size_t i, int level) { return costs[i].costs[static_cast<std::size_t>(level)]; };
        for (std::size_t i = 0; i < objects.size(); ++i) {
            if (levels[objects[i]] >= 0) chosen[i] = levels[objects[i]];
            total += triangles(i, chosen[i]);
        }
        // Among the objects finer than wanted, the one that loses least for each triangle, except `without`.
        const auto cheapest = [&](const std::vector<int>& now) {
            std::size_t best = objects.size();
            double least = 0;
            for (std::size_t i = 0; i < objects.size(); ++i) {
                if (now[i] >= wanted[i]) continue;
                const double ratio =
                    (cost(i, wanted[i]) - cost(i, now[i])) /
                    static_cast<double>(std::max<std::uint64_t>(triangles(i, now[i]) - triangles(i, wanted[i]), 1));
                if (best == objects.size() || ratio < least) best = i, least = ratio;
            }
            return best;
        };
        while (total > options.budget) {
            const std::size_t i = cheapest(chosen);
            if (i == objects.size()) break; // what was chosen does not hold it either
            total -= triangles(i, chosen[i]) - triangles(i, wanted[i]);
            chosen[i] = wanted[i];
        }
        std::vector<std::size_t> coarser;
        for (std::size_t i = 0; i < objects.size(); ++i)
            if (chosen[i] > wanted[i]) coarser.push_back(i);
        const auto gain = [&](std::size_t i) {
            return (cost(i, chosen[i]) - cost(i, wanted[i])) /
                   static_cast<double>(std::max<std::uint64_t>(triangles(i, wanted[i]) - triangles(i, chosen[i]), 1));
        };
        std::stable_sort(coarser.begin(), coarser.end(),
                         [&](std::size_t a, std::size_t b) { return gain(a) > gain(b); });
        int changes = 0;
        for (const std::size_t i : coarser) {
            if (changes >= options.most_changes) return;
            std::vector<int> tried = chosen;
            tried[i] = wanted[i];
            std::uint64_t sum = total + triangles(i, wanted[i]) - triangles(i, chosen[i]);
            double lost = cost(i, wanted[i]);
            int made = 1;
            while (sum > options.budget) {
                const std::size_t other = cheapest(tried);
                if (other == objects.size()) break;
                sum -= triangles(other, tried[other]) - triangles(other, wanted[other]);
                lost += cost(other, wanted[other]) - cost(other, tried[other]);
                tried[other] = wanted[other];
                ++made;
            }
            if (sum > options.budget || !(cost(i, chosen[i]) > options.hysteresis * lost)) continue;
            if (changes > 0 && changes + made > options.most_changes) return;
            chosen = std::move(tried);
            total = sum;
            changes += made;
        }
    }
};

Result<SelectionFollower> SelectionFollower::create(Selections selections, const Scene& scene,
                                                    std::span<const std::vector<std::uint32_t>> triangles,
                                                    const SelectionFollowOptions& options) {
    if (!(options.hysteresis >= 1 && std::isfinite(options.hysteresis)) || options.most_changes < 1)
        return invalid_argument("Levels are followed with a hysteresis of 1 or more, and one change a frame or more.");
    const Selections::Data& data = selections.data();
    if (data.triangles.size() != scene.objects.size() || !std::ranges::equal(triangles, data.triangles) ||
        data.scene != scene_fingerprint(scene, triangles))
        return Error{ErrorCode::malformed_data,
                     "The selections are of another scene, or of other levels of this one: make them anew with "
                     "'unseen levels precompute'."};
    auto impl = std::make_shared<Impl>(std::move(selections), options);
    if (impl->options.budget == 0) impl->options.budget = impl->selections.budget;
    for (const Object& object : scene.objects) impl->spheres.push_back(world_sphere(object));
    return SelectionFollower(std::move(impl));
}

Result<ChosenLevels> SelectionFollower::choose(const vdtree::View& view) {
    if (auto valid = vdtree::validate_perspective(view, "A selection of levels"); !valid) return valid.error();
    Impl& own = *impl_;
    std::vector<std::size_t> objects;
    for (std::size_t i = 0; i < own.spheres.size(); ++i)
        if (is_in_sight(own.spheres[i], view)) objects.push_back(i);
    ChosenLevels result;
    result.levels.assign(own.spheres.size(), -1);
    std::vector<int> chosen;
    if (own.options.blend == SelectionBlend::nearest) {
        const std::vector<int> all = own.nearest(view);
        for (const std::size_t object : objects) chosen.push_back(all[object]);
    } else {
        const std::vector<LevelCosts> costs = own.costs_of(objects, view.eye);
        chosen = levels_within(costs, own.options.budget);
        if (!own.levels.empty()) own.keep_what_holds(objects, costs, chosen);
    }
    for (std::size_t i = 0; i < objects.size(); ++i) {
        result.levels[objects[i]] = chosen[i];
        result.triangles += own.selections.triangles[objects[i]][static_cast<std::size_t>(chosen[i])];
    }
    result.holds = result.triangles <= own.options.budget;
    for (std::size_t i = 0; i < own.levels.size(); ++i)
        result.changes += own.levels[i] >= 0 && result.levels[i] >= 0 && own.levels[i] != result.levels[i];
    own.levels = result.levels;
    return result;
}

} // namespace unseen::session
