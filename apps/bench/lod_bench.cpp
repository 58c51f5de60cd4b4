#include <algorithm>
#include <filesystem>
#include <memory>

#include <unseen/render/context.h>
#include <unseen/session_gpu/lod.h>
#include <unseen/session_gpu/picture_judge.h>

#include "bench_tools.h"
#include "benches.h"
#include "judged_model.h"
#include "peer_simplify.h"
#include "session_options.h"
#include "terminal.h"

namespace unseen::app {
namespace {

struct LodSeen {
    double pixels = 0; // of all sides: the larger count of the two judges
    double v = 0;      // the largest of either

    void add(const session::PictureVerdict& verdict) {
        pixels += static_cast<double>(std::max(verdict.visible_pixels, verdict.second_visible_pixels));
        v = std::max({v, verdict.v, verdict.second_v});
    }
};

// One model's levels, and meshoptimizer's of as many triangles.
void add_model(const render::Context& context, const std::string& model, BenchTable& table) {
    ViewOptions view;
    view.as = session::LoadAs::model; // the peer takes one mesh
    session::Session session = require(open_session(model, view, {}));
    constexpr int most_levels = 5; // with the full mesh
    const session::Lod lod = require(session::make_levels(session, context, {.chain = {.levels = most_levels}}));
    const auto renderer =
        std::make_shared<session::SceneRenderer>(require(session::SceneRenderer::create(context, session)));
    const vdtree::Mesh full = whole_mesh(session.tree());
    const std::string name = std::filesystem::path(model).filename().string();
    const session::LodObject& object = lod.objects[0];
    if (object.levels.size() == 1) table.notes.push_back(name + ": " + object.notes.back());
    for (std::size_t level = 0; level < object.levels.size() && object.levels.size() > 1; ++level) {
        // Level 0 is the control: what the peer's way of being drawn shows by itself, where the first level begins.
        const double distance = object.levels[std::max<std::size_t>(level, 1)].distance;
        vdtree::Mesh simple;
        if (has_meshoptimizer())
            simple = level == 0 ? full : simplified_by_meshoptimizer(full, object.levels[level].triangles, true);
        std::unique_ptr<DrawnPeer> peer;
        if (!simple.triangles.empty()) peer = std::make_unique<DrawnPeer>(context, session, simple);
        std::vector<vdtree::Cut> cuts;
        cuts.push_back(object.cut(level));
        constexpr std::uint64_t other_directions = 77'000'000'000; // that making the levels had nothing to do with
        LodSeen ours, theirs;
        for (const glm::dvec3& direction :
             session::lod_directions(session::usual_lod_directions, other_directions + level)) {
            const vdtree::View seen = session::lod_view(lod, object.sphere, direction, distance);
            CarefulJudge judge(renderer, session, seen);
            ours.add(judge.judge(*renderer, cuts));
            if (peer) theirs.add(judge.judge(peer->renderer, session::whole_cuts(peer->session)));
        }
        const Cell empty("-", Json());
        table.rows.push_back({{level == 0 ? name : "", name},
                              {std::to_string(level), level},
                              count(object.levels[level].triangles),
                              number(distance, 4),
                              level > 0 ? number(session::height_px(lod, object.levels[level]), 3) : empty,
                              level > 0 ? number(object.levels[level].pixel_error, 2) : empty,
                              count(ours.pixels),
                              number(ours.v, 2),
                              count(static_cast<double>(simple.triangles.size())),
                              peer ? count(theirs.pixels) : empty,
                              peer ? number(theirs.v, 2) : empty});
    }
}

} // namespace

BenchReport bench_lod(const BenchOptions& options) {
    const render::Context context = require(render::Context::headless());
    BenchTable table{.columns = {{"model", "model"},
                                 {"level", "level"},
                                 {"triangles", "triangles"},
                                 {"from, m", "distance_m"},
                                 {"height, px", "height_px"},
                                 {"error, px", "pixel_error"},
                                 {"visible pixels", "visible_pixels"},
                                 {"largest V", "v"},
                                 {"meshoptimizer: triangles", "peer_triangles"},
                                 {"visible pixels", "peer_visible_pixels"},
                                 {"largest V", "peer_v"}}};
    const BenchFolder folder;
    for (const std::string& model : options.inputs.empty() ? make_corner_models(folder) : options.inputs)
        add_model(context, model, table);
    table.notes.push_back("pixels that either judge sees, of all " + std::to_string(session::usual_lod_directions) +
                          " sides together");
    if (!has_meshoptimizer()) table.notes.push_back("this build is without meshoptimizer");
    return {{std::move(table)}};
}

} // namespace unseen::app
