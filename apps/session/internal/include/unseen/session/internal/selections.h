// What files of selections hold: levels of detail for cameras all over a scene, and the grid that these stand on.
#pragma once

#include <unseen/session/selection.h>

namespace unseen::session {

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
    glm::dvec3 place(const LatticePoint& p) const { return origin + step * glm::dvec3(p.x, p.y, p.z); }
};
constexpr std::int32_t most_grid_cells = 4096; // along an axis
constexpr std::uint64_t most_selection_corners = 1'000'000;

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

struct Selections::Data {
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

// The key of everything that corners depend on except their place: all of `selections` but corners and cells.
std::uint64_t search_key(const Selections::Data& selections);

// Whether the corners' selections differ by more than so many levels, in the mean over the objects that any of them has
// in sight and that are not of the last level everywhere.
bool corners_differ(std::span<const SelectionCorner* const> corners, double levels);

// Binary, see docs/file-format.md. Written to a temporary name and renamed.
Result<void> write_selections(const std::filesystem::path& file, const Selections::Data& selections);
// As Selections::read().
Result<Selections::Data> read_selections(const std::filesystem::path& file);

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

} // namespace unseen::session
