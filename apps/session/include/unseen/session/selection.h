// Levels of detail within a budget of triangles, chosen so that pictures lose least: Arlebrink and Linde, "Image
// Quality-Driven Level of Detail Selection on a Triangle Budget" (2018).
//
// The search chooses levels for one camera. Each object is drawn alone at each level, once. A choice of levels is then
// composed from these images by depth, and only in the rectangle of the object that changes, so a search draws nothing.
// precompute_selections() in <unseen/session_gpu/precompute_selections.h> searches for cameras all over a scene and
// writes Selections. A SelectionFollower chooses the levels of each frame from these.
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include <unseen/perception/display.h>
#include <unseen/session/level_chain.h>
#include <unseen/session/scene.h>
#include <unseen/vdtree/result.h>

namespace unseen::session {

// ---- one camera

// What a picture loses against that of full detail. Sums over pixels; 0: nothing.
enum class SelectionQuality {
    ssim,     // 1 - SSIM, over all windows, as perception::ssim() counts it
    pixels,   // that differ by more than perception::threshold_map_modern() calls unseen
    contrast, // by how many thresholds pixels differ, beyond one
};
std::string name_of(SelectionQuality quality); // "ssim", ...

// Pixels; the last ones excluded.
struct PixelRect {
    int left = 0, top = 0, right = 0, bottom = 0;

    bool is_empty() const noexcept { return right <= left || bottom <= top; }
    int width() const noexcept { return right - left; }
    int height() const noexcept { return bottom - top; }
    friend bool operator==(const PixelRect&, const PixelRect&) = default;
};
PixelRect united(const PixelRect& a, const PixelRect& b); // around both

// An object alone at one level: the pixels of its rectangle, row by row.
struct LevelImage {
    PixelRect box; // of the pixels that it covers; empty: none
    std::vector<float> values;
    std::vector<float> depth; // near plane / distance along the axis; 0: the object is not there
};

struct ObjectImages {
    std::size_t object = 0;               // of the scene
    std::vector<LevelImage> levels;       // 0: full detail
    std::vector<std::uint32_t> triangles; // by level, falling
};

// A camera's picture in parts. Values are what the quality compares: 8-bit codes of grey for SSIM, else cd/m2.
struct LayeredPicture {
    int width = 0, height = 0;
    std::vector<float> background, background_depth; // by pixel, from the top left
    std::vector<ObjectImages> objects;               // those in sight
};

// All objects at these levels (by entry of picture.objects), by depth; where depths are the same the first one shows.
std::vector<float> put_together(const LayeredPicture& picture, std::span<const int> levels);

// What a picture loses, kept by place so that only what changes is counted anew. A value.
class PictureLoss {
public:
    // `display` counts for thresholds. Of SSIM: at least 11 x 11 pixels. Fails on smaller ones, and on values that are
    // not finite.
    static Result<PictureLoss> create(SelectionQuality quality, int width, int height, std::vector<float> reference,
                                      const perception::Display& display = {});

    double total() const noexcept { return total_; } // of the picture that is held; at first the reference: 0

    // What another picture, which differs from the one held in the rectangle alone, would lose more than that.
    double change(std::span<const float> picture, const PixelRect& changed) const;
    void take(std::span<const float> picture, const PixelRect& changed); // holds that one from now on

    // The loss of a whole picture, ignoring what is held. Equal but for the order of the sums.
    double of(std::span<const float> picture) const;

    int places() const noexcept { return columns_ * rows_; } // that the loss is summed over
    // How far around a pixel places are that it counts for.
    PixelRect places_of(const PixelRect& changed) const;

private:
    PictureLoss() = default;
    void count(std::span<const float> picture, const PixelRect& places, std::vector<double>& losses) const;

    SelectionQuality quality_ = SelectionQuality::ssim;
    int width_ = 0, height_ = 0;
    int columns_ = 0, rows_ = 0;                            // of places
    std::vector<float> reference_, thresholds_;             // thresholds: cd/m2
    std::vector<double> reference_mean_, reference_square_; // of SSIM's windows
    std::vector<double> losses_;                            // by place
    double total_ = 0;
};

struct SearchOptions {
    std::uint64_t budget = 0; // triangles of objects in sight
    // Candidates whose surroundings changed are counted anew when they come first, and not at once. Else all of them
    // are.
    bool is_lazy = true;
};

struct FoundSelection {
    std::vector<int> levels; // by entry of the picture's objects
    std::uint64_t triangles = 0;
    double loss = 0;
    bool holds = false; // the budget; else every object has its last level
    std::uint64_t evaluations = 0;
    // By entry, by level from 1 on: what that level loses where all others have full detail.
    std::vector<std::vector<double>> alone;
};

// From full detail, always lowering by one level the object that loses least for each triangle saved, until the budget
// holds; then raises again what fits into what is left, most gained first. Ties go to more triangles saved, then to the
// first entry. `measures_alone`: fills in `alone`, one evaluation a level. Fails where PictureLoss::create() does.
Result<FoundSelection> select_greedily(const LayeredPicture& picture, SelectionQuality quality,
                                       const perception::Display& display, const SearchOptions& options,
                                       bool measures_alone = false);

// The best of all, by trying all. Fails above most_combinations.
constexpr std::uint64_t most_combinations = 1'000'000;
Result<FoundSelection> select_exhaustively(const LayeredPicture& picture, SelectionQuality quality,
                                           const perception::Display& display, const SearchOptions& options);

// ---- all cameras of a scene

// A place of the lattice that all corners are on.
struct LatticePoint {
    std::int32_t x = 0, y = 0, z = 0;
    friend auto operator<=>(const LatticePoint&, const LatticePoint&) = default;
};

// Cells of a quadtree on the ground (xz), or of an octree in space, over a grid of equal ones. Lengths in lattice
// steps.
struct SelectionGrid {
    glm::dvec3 origin = glm::dvec3(0); // of the lattice, world units
    double step = 1;                   // world units; above 0
    LatticePoint cells = {1, 0, 1};    // of the grid, each 2^depth steps a side; y is 0: on the ground
    int depth = 0;                     // how often a cell may be parted at most, 0 to most_selection_depth

    bool is_on_ground() const noexcept { return cells.y == 0; }
    std::int32_t cell_size() const noexcept { return std::int32_t{1} << depth; }
    glm::dvec3 place(const LatticePoint& p) const {
        return origin + step * glm::dvec3(static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z));
    }
};
constexpr int most_selection_depth = 8;
constexpr std::int32_t most_grid_cells = 4096; // along an axis
constexpr std::uint64_t most_selection_corners = 1'000'000;

// Of an object, full detail among them.
constexpr int default_selected_levels = 5;

struct SelectionCell {
    LatticePoint at; // of its corner with the least coordinates
    std::int32_t size = 1;
    friend auto operator<=>(const SelectionCell&, const SelectionCell&) = default;
};
std::vector<LatticePoint> corners_of(const SelectionGrid& grid, const SelectionCell& cell); // 4, or 8
std::vector<SelectionCell> cells_of(const SelectionGrid& grid);                             // of the grid

// An object that a camera has in sight.
struct SelectedLevel {
    std::uint32_t object = 0;
    std::uint8_t level = 0;
    std::vector<float> costs; // of level 1 and on: what the picture loses with it where all else has full detail
};

// A camera: a window with a field of 90 degrees along an axis.
struct SelectionCamera {
    std::vector<SelectedLevel> objects; // ascending
    float loss = 0;                     // of the selection, a pixel
};

struct SelectionCorner {
    LatticePoint at;
    std::vector<SelectionCamera> cameras; // by direction
};

// The directions of cameras: +x, -x, +z, -z, and in space +y, -y.
constexpr std::array<glm::dvec3, 6> selection_directions = {glm::dvec3(1, 0, 0), glm::dvec3(-1, 0, 0),
                                                            glm::dvec3(0, 0, 1), glm::dvec3(0, 0, -1),
                                                            glm::dvec3(0, 1, 0), glm::dvec3(0, -1, 0)};

// All that a .sel file holds. A value.
struct Selections {
    SelectionQuality quality = SelectionQuality::ssim;
    std::uint64_t budget = 0; // of a frame, in triangles; a camera's selection keeps to half of it
    std::int32_t window_px = 256;
    std::int32_t levels = default_selected_levels; // of an object, at most; 2 to most_levels
    SelectionGrid grid;
    std::uint64_t scene = 0;                           // a fingerprint, see scene_fingerprint()
    std::vector<std::vector<std::uint32_t>> triangles; // by object, by level
    std::vector<SelectionCorner> corners;              // ascending by place
    std::vector<SelectionCell> cells;                  // those that are not parted, ascending

    const SelectionCorner* corner(const LatticePoint& at) const; // null: there is none
    int directions() const noexcept { return grid.is_on_ground() ? 4 : 6; }
};

// Differs, but for bad luck, where objects, their places, or the triangles of their levels differ.
std::uint64_t scene_fingerprint(const Scene& scene, std::span<const std::vector<std::uint32_t>> triangles);

// Of all that corners depend on but the place: what selections say but for their corners and cells.
std::uint64_t search_key(const Selections& selections);

// Whether the corners' selections differ by more than so many levels, in the mean over the objects that any of them has
// in sight and that are not of the last level everywhere.
bool corners_differ(std::span<const SelectionCorner* const> corners, double levels);

// Binary, see docs/file-format.md. Written to a temporary name and renamed.
Result<void> write_selections(const std::filesystem::path& file, const Selections& selections);
// Nothing that a file says is believed: counts are checked against its size before memory is taken, and every number
// against its range. Errors name the file and the byte.
Result<Selections> read_selections(const std::filesystem::path& file);

// The corners that a search has finished, one by one: a file that an interrupted search goes on from. A part that was
// cut short while it was written is left out.
class SelectionJournal {
public:
    // Reads what is there of this very search, and goes on behind it; else begins anew. `key`: of all that corners
    // depend on.
    static Result<SelectionJournal> open(const std::filesystem::path& file, std::uint64_t key);
    const std::vector<SelectionCorner>& done() const noexcept { return done_; } // when it was opened

    Result<void> add(const SelectionCorner& corner); // on the disk when it returns, but for the system's own buffers
    void remove() const;

private:
    std::filesystem::path file_;
    std::vector<SelectionCorner> done_;
};

// For messages between processes.
std::vector<std::byte> to_bytes(const SelectionCorner& corner);
Result<SelectionCorner> corner_from(std::span<const std::byte> bytes);

// ---- frames

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
