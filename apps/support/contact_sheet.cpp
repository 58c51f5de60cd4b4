#include "contact_sheet.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <unseen/render/renderer.h>
#include <unseen/session_gpu/as_seen.h>
#include <unseen/session_gpu/scene_renderer.h>
#include <unseen/vdtree/internal/number_format.h>

#include "fold_map.h"
#include "picture_columns.h"

namespace unseen::app {
namespace {

using perception::Image;

// The pictures of a cut on one of the sheets, one below the other; code values, of a cell's size.
using Pictures = std::vector<Image>;

struct Column {
    SheetCut cut;
    Image light; // cd/m2, of the whole window
    Pictures pictures, maps;
};

// By one fold test, in four ways. Maps know no budget.
std::vector<Column> wishes(const session::Session& session, const vdtree::View& view, const SheetOptions& o) {
    std::vector<Column> columns;
    const auto add = [&](const char* name, session::Goal goal) -> SheetCut& {
        SheetCut& cut = columns.emplace_back().cut;
        cut.name = name;
        cut.request.goal = goal;
        cut.request.fold_test = o.fold_test;
        cut.request.purpose = session::Purpose::picture;
        return cut;
    };
    add("full", session::Goal::full());
    add("imperceptible", session::Goal::imperceptible());
    const auto usual = std::max<vdtree::Index>(1, (session.tree().triangle_count() + 2) / 4); // a quarter
    if (o.has_cuts) add("budget", session::Goal::budget(o.budget.value_or(usual)));
    add("gaze-directed", session::Goal::imperceptible()).gaze = session::Gaze{
        o.gaze_px.value_or(session::gaze_aside(session.observer().display, view, session::usual_degrees_aside))};
    return columns;
}

bool is_on_maps(const SheetCut& cut) { return cut.request.goal.kind != session::Goal::Kind::budget; }

// The same camera in a window that fits a cell. Pixels are coarser there, so nothing is measured in it.
vdtree::View small_view(const vdtree::View& view, int cell_px) {
    vdtree::View small = view;
    const double shrink = std::min(1.0, static_cast<double>(cell_px) / std::max(view.width, view.height));
    small.width = std::max(1, static_cast<int>(std::lround(view.width * shrink)));
    small.height = std::max(1, static_cast<int>(std::lround(view.height * shrink)));
    return small;
}

class SheetMaker {
public:
    SheetMaker(session::Session& session, const vdtree::View& view, const render::Context& context,
               render::Renderer& renderer, const SheetOptions& o)
        : session_(session), view_(view), context_(context), renderer_(renderer), o_(o) {}

    // Makes the cut, draws and judges it.
    Result<void> fill(Column& column, const Image& full) {
        SheetCut& made = column.cut;
        session_.set_gaze(made.gaze);
        // Parallel views have no picture of depths.
        auto simplified = view_.orthographic_height
                              ? session_.simplify(view_, made.request)
                              : session::simplify_as_seen(session_, context_, view_, made.request);
        if (!simplified) return simplified.error();
        const vdtree::Cut& cut = simplified->cuts.front();
        if (auto ok = draw(column, cut); !ok) return ok.error();
        made.pixels = column.light.values.size();
        made.report = std::move(*simplified);
        return full.values.empty() ? Result<void>() : judge(column, full);
    }

private:
    Result<void> draw(Column& column, const vdtree::Cut& cut) {
        auto lighting = session_.lighting(view_);
        if (!lighting) return lighting.error();
        render::DrawOptions options;
        options.samples = o_.samples;
        options.background = session_.background();
        options.lighting = std::move(*lighting);
        const auto whole = draw(cut, view_, options);
        if (!whole) return whole.error();
        column.cut.draw_ms = whole->draw_ms;
        column.light = session::light_image(*whole, session_.observer().display);
        if (o_.has_cuts) {
            const vdtree::View small = small_view(view_, o_.cell_px.value_or(usual_cell_px));
            if (auto ok = draw_twice(column.pictures, cut, small, options); !ok) return ok;
        }
        if (!o_.has_maps || !is_on_maps(column.cut)) return {};
        const vdtree::View small = small_view(view_, o_.cell_px.value_or(usual_maps_cell_px));
        if (auto ok = draw_twice(column.maps, cut, small, options); !ok) return ok;
        return draw_maps(column, cut, small);
    }

    Result<render::Frame> draw(const vdtree::Cut& cut, const vdtree::View& view, const render::DrawOptions& options) {
        return renderer_.draw(cut, view, options, session_.scene().objects.front().placement);
    }

    // Shaded, and with the triangles' edges.
    Result<void> draw_twice(Pictures& pictures, const vdtree::Cut& cut, const vdtree::View& small,
                            render::DrawOptions options) {
        for (const bool has_edges : {false, true}) {
            options.wireframe = has_edges;
            const auto frame = draw(cut, small, options);
            if (!frame) return frame.error();
            pictures.push_back(session::code_image(*frame, session_.observer().display));
        }
        return {};
    }

    // Where there is none, as that of the cost in the full model, nothing: such columns are shorter.
    Result<void> draw_maps(Column& column, const vdtree::Cut& cut, const vdtree::View& small) {
        if (column.cut.request.goal.kind == session::Goal::Kind::full) return {};
        for (const FoldMap map : {FoldMap::cost, FoldMap::frequency, FoldMap::contrast, FoldMap::eccentricity}) {
            if (map == FoldMap::eccentricity && !column.cut.gaze) continue;
            auto drawn = draw_fold_map(cut, session_, view_, column.cut.request, map, small);
            if (!drawn) return drawn.error();
            column.maps.push_back(std::move(*drawn));
        }
        return {};
    }

    Result<void> judge(Column& column, const Image& full) {
        perception::JudgeOptions options;
        options.display = session_.observer().display;
        if (column.cut.gaze) options.gaze_px = column.cut.gaze->px;
        options.csf_table = session_.observer().csf;
        options.gain = options.csf_table ? 1 : session_.observer().person.gain;
        auto judgement = perception::judge_modern(full, column.light, options);
        if (!judgement) return judgement.error();
        column.cut.judgement = std::move(*judgement);
        return {};
    }

    session::Session& session_;
    const vdtree::View& view_;
    const render::Context& context_;
    render::Renderer& renderer_;
    const SheetOptions& o_;
};

// Columns beside each other: those that have pictures of the kind.
Result<Image> compose(std::vector<Column>& columns, Pictures Column::*kind, const session::Session& session,
                      const vdtree::View& view, const std::string& model) {
    std::vector<PictureColumn> shown;
    for (Column& column : columns) {
        if ((column.*kind).empty()) continue;
        const SheetCut& cut = column.cut;
        PictureColumn& made = shown.emplace_back();
        made.name = cut.name + ": " + grouped(cut.report.stats.triangles) + " triangles";
        const double from = cut.report.imperceptible_from_m;
        if (cut.judgement)
            made.verdict = grouped(cut.judgement->visible_pixels) + " pixels visible; from " + rounded(from, 3) +
                           (std::isfinite(from) ? " m none" : " none");
        made.pictures = std::move(column.*kind);
    }
    const perception::Display& display = session.observer().display;
    return compose_columns(model + "   " + std::to_string(view.width) + "x" + std::to_string(view.height) +
                               " pixels, " + rounded(perception::pixels_per_degree(display).value(), 4) +
                               " per degree, seen from " + rounded(display.distance.value(), 3) + " m",
                           shown);
}

// The first is the full model.
Result<void> fill_all(std::vector<Column>& columns, session::Session& session, const vdtree::View& view,
                      render::Context& context, const SheetOptions& o) {
    // Before anything is made of the tree, which may change.
    for (const Column& column : columns)
        if (const auto ready = session.prepare(view, column.cut.request); !ready) return ready.error();
    auto renderer = render::Renderer::create(context, session.tree());
    if (!renderer) return renderer.error();
    SheetMaker maker(session, view, context, *renderer, o);
    const std::optional<session::Gaze> gaze_before = session.observer().gaze;
    Image full;
    for (Column& column : columns) {
        const double share = static_cast<double>(&column - columns.data()) / static_cast<double>(columns.size());
        if (o.progress && !o.progress(share, column.cut.name.c_str()))
            return Error{ErrorCode::cancelled, "The drawing was cancelled."};
        if (auto ok = maker.fill(column, full); !ok) return ok;
        if (full.values.empty()) full = std::move(column.light);
    }
    session.set_gaze(gaze_before);
    return {};
}

} // namespace

Result<ContactSheet> draw_contact_sheet(session::Session& session, const vdtree::View& view, render::Context& context,
                                        const SheetOptions& o) {
    std::vector<Column> columns = wishes(session, view, o);
    if (auto filled = fill_all(columns, session, view, context, o); !filled) return filled.error();
    ContactSheet out;
    for (const auto& [is_wanted, kind, image] :
         {std::tuple(o.has_cuts, &Column::pictures, &out.sheet), std::tuple(o.has_maps, &Column::maps, &out.maps)}) {
        if (!is_wanted) continue;
        auto composed = compose(columns, kind, session, view, o.model);
        if (!composed) return composed.error();
        *image = std::move(*composed);
    }
    for (Column& column : columns) out.cuts.push_back(std::move(column.cut));
    return out;
}

} // namespace unseen::app
