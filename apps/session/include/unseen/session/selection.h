// Levels of detail within a budget of triangles, chosen so that pictures lose least: Arlebrink and Linde, "Image
// Quality-Driven Level of Detail Selection on a Triangle Budget" (2018).
//
// precompute_selections() in <unseen/session_gpu/precompute_selections.h> searches for cameras all over a scene and
// writes Selections. A SelectionFollower chooses the levels of each frame from these.
#pragma once

#include <unseen/session/level_chain.h>
#include <unseen/session/scene.h>

namespace unseen::session {

// What a picture loses against that of full detail. Sums over pixels; 0: nothing.
enum class SelectionQuality {
    ssim,     // 1 - SSIM, over all windows, as perception::ssim() counts it
    pixels,   // that differ by more than perception::threshold_map_modern() calls unseen
    contrast, // by how many thresholds pixels differ, beyond one
};
std::string name_of(SelectionQuality quality); // "ssim", ...

// Levels of an object, full detail among them; and how often a cell of the grid may be parted.
constexpr int default_selected_levels = 5, most_selection_depth = 8;

// All that a .sel file holds. A value that shares its data.
class Selections {
public:
    // Nothing that a file says is believed: counts are checked against its size before memory is taken, and every number
    // against its range. Errors name the file and the byte.
    static Result<Selections> read(const std::filesystem::path& file);

    int levels() const noexcept; // of an object, at most

    struct Data; // the library's own
    explicit Selections(Data data);
    const Data& data() const noexcept { return *data_; }

private:
    std::shared_ptr<const Data> data_;
};

enum class SelectionBlend {
    costs,   // what levels cost at the corners around the eye, weighted by place, for the objects in the frame
    nearest, // the selections of the nearest corner's two nearest directions, as Arlebrink and Linde have it
};

struct SelectionFollowOptions {
    std::uint64_t budget = 0; // triangles of objects in the frame; 0: that of the selections. Of costs alone.
    SelectionBlend blend = SelectionBlend::costs;
    // An object gets a better level only if its loss exceeds this many times the loss of what makes room for it.
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
    SelectionFollower(SelectionFollower&&) noexcept = default;
    SelectionFollower& operator=(SelectionFollower&&) noexcept = default;

    // Chooses the levels of the next frame. Cost: microseconds an object in the frame.
    Result<ChosenLevels> choose(const vdtree::View& view);

private:
    struct Impl;
    explicit SelectionFollower(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::session
