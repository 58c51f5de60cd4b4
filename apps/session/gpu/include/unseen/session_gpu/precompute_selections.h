// Selects levels of detail for cameras all over a scene, beforehand: the second stage of Arlebrink and Linde (2018).
//
// Each corner of a grid on the ground, or in space, has four or six cameras. Cells whose corners select differently are
// split, as often as the grid allows. Finished corners are kept in a file beside the result, from which an interrupted
// search resumes. Several processes may share the corners; the result is the same.
#pragma once

#include <unseen/render/context.h>
#include <unseen/session/session.h>

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
    double differ = 0.5; // cells are split if their corners differ by more levels than this in the mean
    bool is_in_space = false;
    // y of cameras on the ground, world units; not set: the scene's camera's, or 1.7
    std::optional<double> eye_height = {};
    // The box of the grid, world units; none: around the middles of all objects.
    std::optional<glm::dvec3> low = {}, high = {};
    int threads = 0;        // one draws, the others search; 1: by turns; 0: as many as there are cores
    Progress progress = {}; // called after each corner; returning false stops, and keeps what is done
};

struct PrecomputeReport {
    std::size_t corners = 0, cells = 0, cameras = 0; // cameras: that have an object in sight
    std::size_t resumed = 0;                         // corners that an earlier search had finished
    // Seconds of this process: the whole, loading, and, of these, drawing and reading back; searching, by
    // all threads together.
    double seconds = 0, load_seconds = 0, draw_seconds = 0, read_seconds = 0, search_seconds = 0;
    std::uint64_t drawings = 0, drawn_triangles = 0, evaluations = 0;
    std::size_t over_budget = 0; // cameras whose coarsest levels exceed their half of the budget
    int processes = 1;
};

// Writes the selections to `file`; until then `file`.part keeps finished corners. Every member of a team calls this
// with the same scene and options; the first one writes. Fails on options out of range, where drawing or writing does,
// and with ErrorCode::cancelled if the progress callback says so.
Result<PrecomputeReport> precompute_selections(const render::Context& context, Session& session,
                                               const std::filesystem::path& file, const PrecomputeOptions& options,
                                               vdtree::Team* team = nullptr);

} // namespace unseen::session
