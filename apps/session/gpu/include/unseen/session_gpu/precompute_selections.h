// Selects levels of detail for cameras all over a scene, beforehand: the second stage of Arlebrink and Linde (2018).
//
// Corners of a grid on the ground, or in space, have four or six cameras each. Cells whose corners select differently
// are parted, as often as the grid allows. What is done is kept in a file beside the result, and an interrupted search
// goes on from there. Several processes share the corners; the result is the same.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>

#include <unseen/render/context.h>
#include <unseen/session/selection.h>
#include <unseen/session/session.h>
#include <unseen/vdtree/function_ref.h>

namespace unseen::vdtree {
class Team;
}

namespace unseen::session {

struct PrecomputeOptions {
    std::uint64_t budget = 0; // of a frame, triangles of objects; above 0
    SelectionQuality quality = SelectionQuality::ssim;
    int levels = default_selected_levels; // of an object, each of half of the triangles; 2 to most_levels
    int window_px = 256;
    double spacing = 0;  // of the grid's corners, world units; 0: a tenth of the longer side
    int depth = 1;       // how often a cell may be parted, 0 to most_selection_depth
    double differ = 0.5; // cells are parted whose corners differ by more levels, in the mean
    bool is_in_space = false;
    std::optional<double> eye_height =
        {}; // y of cameras on the ground, world units; none: the scene's camera's, or 1.7
    // The box of the grid, world units; none: around the middles of all objects.
    std::optional<glm::dvec3> low = {}, high = {};
    int threads = 0; // one draws, the others search; 1: by turns; 0: as many as there are cores
    // With the share that is done, after each corner. Returning false stops: what is done is kept.
    std::function<bool(double share, const char* stage)> progress = {};
};

struct PrecomputeReport {
    std::size_t corners = 0, cells = 0, cameras = 0; // cameras: that have an object in sight
    std::size_t resumed = 0;                         // corners that an earlier search had finished
    // Of this process: seconds of the whole, of loading, and, of these, of drawing and reading back; of searching, by
    // all threads together.
    double seconds = 0, load_seconds = 0, draw_seconds = 0, read_seconds = 0, search_seconds = 0;
    std::uint64_t drawings = 0, drawn_triangles = 0, evaluations = 0;
    std::size_t over_budget = 0; // cameras whose coarsest levels exceed their half of the budget
    int processes = 1;
};

// Writes the selections to `file`; `file`.part keeps what is done until then. Every member of a team calls this with the
// same scene and options; the first one writes. Fails on options out of range, where drawing or writing does, and with
// ErrorCode::cancelled where progress says so.
Result<PrecomputeReport> precompute_selections(const render::Context& context, Session& session,
                                               const std::filesystem::path& file, const PrecomputeOptions& options,
                                               vdtree::Team* team = nullptr);

} // namespace unseen::session
