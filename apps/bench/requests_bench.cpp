#include "requests_bench.h"

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <unseen/render/context.h>
#include <unseen/session/session.h>

#include "contact_sheet.h"
#include "session_options.h"
#include "terminal.h"

namespace unseen::app {
namespace {

constexpr vdtree::Index usual_budget = 10'000; // triangles
constexpr double usual_tolerance_px = 5;

// Named as the options of `unseen`. The first is the full model.
std::vector<SheetCut> usual_requests(const session::Session& session) {
    std::vector<SheetCut> requests;
    const auto add = [&](const char* options, session::Goal goal) -> SheetCut& {
        SheetCut& made = requests.emplace_back();
        made.name = options;
        made.request.goal = goal;
        return made;
    };
    const auto aside =
        session::gaze_aside(session.observer().display, session.default_view(), session::usual_degrees_aside);
    add("--full", session::Goal::full());
    add("--imperceptible", session::Goal::imperceptible());
    SheetCut& gazed = add("", session::Goal::imperceptible());
    gazed.gaze = session::Gaze{glm::round(aside)};
    gazed.name =
        "--imperceptible --gaze " + std::to_string(std::lround(aside.x)) + " " + std::to_string(std::lround(aside.y));
    const vdtree::Index budget = std::min(usual_budget, session.tree().triangle_count());
    add("", session::Goal::budget(budget)).name = "--triangles " + std::to_string(budget);
    add("--pixels 5", session::Goal::pixels(usual_tolerance_px));
    return requests;
}

} // namespace

Result<RequestsBenchResult> bench_requests(const std::string& model) {
    auto context = render::Context::headless();
    if (!context) return context.error();
    auto session = open_session(model, {}, {});
    if (!session) return session.error();
    std::vector<SheetCut> cuts = usual_requests(*session);
    std::vector<session::Report> meshes;
    for (const SheetCut& cut : cuts) { // as for who reads the tree and asks once
        auto fresh = make_session(session->tree().share(), {}, {});
        if (!fresh) return fresh.error();
        fresh->set_gaze(cut.gaze);
        auto made = fresh->simplify(cut.request);
        if (!made) return made.error();
        meshes.push_back(std::move(*made));
    }
    for (SheetCut& cut : cuts) cut.request.purpose = session::Purpose::picture;
    if (auto judged = judge_cuts(*session, session->default_view(), *context, cuts); !judged) return judged.error();

    RequestsBenchResult result;
    result.table.rows = {
        {"request", "triangles", "in the picture", "time", "pixels visible to the judge", "imperceptible from"}};
    for (std::size_t i = 0; i < cuts.size(); ++i) {
        const session::Report& mesh = meshes[i];
        const double from = mesh.imperceptible_from_m;
        const std::uint64_t visible = cuts[i].judgement ? cuts[i].judgement->visible_pixels : 0; // the model itself
        result.table.rows.push_back({"`" + cuts[i].name + "`", grouped(mesh.stats.triangles),
                                     grouped(cuts[i].report.stats.triangles), rounded(mesh.adapt_ms, 2) + " ms",
                                     grouped(visible), std::isnan(from) ? "" : rounded(from, 3) + " m"});
        result.requests.push_back({{"request", cuts[i].name},
                                   {"triangles", mesh.stats.triangles},
                                   {"picture_triangles", cuts[i].report.stats.triangles},
                                   {"adapt_ms", mesh.adapt_ms},
                                   {"visible_pixels", visible},
                                   {"imperceptible_from_m", number_or_null(from)}});
    }
    return result;
}

} // namespace unseen::app
