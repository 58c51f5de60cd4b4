// The cuts of a model side by side: whole, imperceptible, by a budget and gaze-directed, each with its wireframe, and how
// visible they are; and maps of what their folds cost.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <glm/vec2.hpp>

#include <unseen/perception/image.h>
#include <unseen/perception/judge.h>
#include <unseen/render/context.h>
#include <unseen/session/session.h>
#include <unseen/vdtree/function_ref.h>

namespace unseen::app {

struct SheetOptions {
    std::string model;                               // for the title
    std::optional<vdtree::Index> budget = {};        // triangles; default: a quarter of the model's
    std::optional<glm::dvec2> gaze_px = {};          // default: session::gaze_aside()
    std::optional<session::FoldTest> fold_test = {}; // of all cuts; default: as for a picture
    int samples = 64;                                // a pixel, of what is judged
    std::optional<int> cell_px = {};                 // the longer side of a picture; default: by sheet
    bool has_cuts = true, has_maps = false;          // which sheets are wanted; one at least
    Progress progress = {};
};
inline constexpr int usual_cell_px = 480, usual_maps_cell_px = 320;

// One column.
struct SheetCut {
    std::string name;
    session::Request request;
    std::optional<session::Gaze> gaze;
    session::Report report;
    double draw_ms = 0;
    std::size_t pixels = 0;                         // of the window
    std::optional<perception::Judgement> judgement; // against the full model; none for that itself
};

struct ContactSheet {
    std::vector<SheetCut> cuts;
    // Code values; empty where not wanted. The maps' sheet has no budget: it is the other cuts, and below them maps of
    // cost, frequency, contrast and eccentricity.
    perception::Image sheet, maps;
};

// Of the session's only object, seen by `view`. Each cut is made, drawn and judged once, whatever sheets are wanted. Cost: some seconds for each cut of a megapixel, most of it for the
// judge and, in software, for drawing.
Result<ContactSheet> draw_contact_sheet(session::Session& session, const vdtree::View& view, render::Context& context,
                                        const SheetOptions& options);

} // namespace unseen::app
