// Levels of detail for a moving view, within a budget of triangles, from what cameras around it lost by them.
#pragma once

#include <memory>

#include <unseen/session/selection.h>

namespace unseen::session {

enum class SelectionBlend {
    costs,   // what levels cost at the corners around the eye, weighted by place, for the objects in the frame
    nearest, // the selections of the nearest corner's two nearest directions, as Arlebrink and Linde have it
};

struct SelectionFollowOptions {
    std::uint64_t budget = 0; // triangles of objects in the frame; 0: that of the selections. Of costs alone.
    SelectionBlend blend = SelectionBlend::costs;
    // Of costs: an object gets a better level only where its loss is above so many times that of what is done for it.
    double hysteresis = 1.25; // 1 or more
    int most_changes = 4;     // of a frame, beyond those that the budget asks for; 1 or more
};

struct ChosenLevels {
    std::vector<int> levels;     // by object; -1: out of the frame
    std::uint64_t triangles = 0; // of objects in the frame
    bool holds = true;           // the budget; else all have their coarsest levels
    int changes = 0;             // objects that have another level than in the frame before, and were in that
};

// Move-only; refers to nothing of others.
class SelectionFollower {
public:
    // `triangles`: of the scene's levels. Fails where the selections are of another scene or of other levels, and on
    // options out of range.
    static Result<SelectionFollower> create(Selections selections, const Scene& scene,
                                            std::span<const std::vector<std::uint32_t>> triangles,
                                            const SelectionFollowOptions& options = {});
    SelectionFollower(SelectionFollower&&) noexcept;
    SelectionFollower& operator=(SelectionFollower&&) noexcept;
    ~SelectionFollower();

    // Of the next frame. Cost: microseconds an object in the frame.
    Result<ChosenLevels> choose(const vdtree::View& view);

    const Selections& selections() const noexcept;

private:
    struct Impl;
    explicit SelectionFollower(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

// Levels that lose least within the budget: from the finest on, always down where least is lost for each triangle, over
// as many levels as make that least; then up again where it fits. By object: what levels cost, ascending from 0, and
// their triangles, falling.
struct LevelCosts {
    std::vector<double> costs;
    std::span<const std::uint32_t> triangles;
};
std::vector<int> levels_within(std::span<const LevelCosts> objects, std::uint64_t budget);

} // namespace unseen::session
