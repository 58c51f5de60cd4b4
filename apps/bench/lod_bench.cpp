#include "lod_bench.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>

#include <unseen/render/context.h>
#include <unseen/session_gpu/lod.h>
#include <unseen/session_gpu/picture_judge.h>
#include <unseen/vdtree/builder.h>

#include "peer_simplify.h"
#include "session_options.h"
#include "terminal.h"

namespace unseen::app {
namespace {

// The seed of directions that making the levels had nothing to do with.
constexpr std::uint64_t other_directions = 77'000'000'000;

struct LodSeen {
    std::uint64_t pixels = 0; // of all sides: the larger count of the two judges
    double v = 0;             // the largest of either
    vdtree::Index triangles = 0;
};

void add(LodSeen& seen, const session::PictureVerdict& verdict) {
    seen.pixels += std::max(verdict.visible, verdict.second_visible);
    seen.v = std::max({seen.v, verdict.v, verdict.second_v});
}

// The peer's mesh, drawn like the model itself.
Result<session::Session> session_of_peer(const session::Session& session, const vdtree::Mesh& simple) {
    const vdtree::VertexTree& own = session.tree();
    vdtree::BuildOptions how;
    how.light = own.light();
    how.prelit = own.is_prelit();
    auto tree = vdtree::build_tree(simple.view(), how);
    if (!tree) return tree.error();
    session::Scene scene;
    scene.objects.push_back(session::Object{std::move(*tree), session.scene().objects[0].placement});
    scene.background = session.scene().background;
    return session::Session::create(std::move(scene), session.observer());
}

} // namespace

Result<LodBenchResult> bench_lod(const std::vector<std::string>& models, int levels) {
    auto context = render::Context::headless();
    if (!context) return context.error();
    LodBenchResult result;
    result.table.rows = {{"model", "level", "triangles", "from, m", "visible pixels", "largest V",
                          "meshoptimizer: triangles", "visible pixels", "largest V"}};
    for (const std::string& model : models) {
        ViewOptions view;
        view.as = session::LoadAs::model; // the peer takes one mesh
        auto session = open_session(model, view, {});
        if (!session) return session.error();
        const auto start = std::chrono::steady_clock::now();
        const auto lod = session::make_levels(*session, *context, {.chain = {.levels = levels}});
        if (!lod) return lod.error();
        const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        const session::LodObject& object = lod->objects[0];
        auto renderer = session::SceneRenderer::create(*context, *session);
        if (!renderer) return renderer.error();
        const auto shared = std::make_shared<session::SceneRenderer>(std::move(*renderer));
        const vdtree::Mesh full = whole_mesh(session->tree());
        const std::string name = std::filesystem::path(model).filename().string();
        // Level 0 is the control: what the peer's way of being drawn shows by itself, where the first level begins.
        for (std::size_t i = 0; i < object.levels.size() && object.levels.size() > 1; ++i) {
            const session::LodLevel& level = object.levels[i];
            const double distance = object.levels[std::max<std::size_t>(i, 1)].distance;
            LodSeen ours{.triangles = level.triangles}, theirs;
            std::optional<session::Session> peer;
            std::optional<session::SceneRenderer> peer_renderer;
            if (has_meshoptimizer()) {
                const vdtree::Mesh simple = i == 0 ? full : simplified_by_meshoptimizer(full, level.triangles, true);
                theirs.triangles = static_cast<vdtree::Index>(simple.triangles.size());
                if (!simple.triangles.empty()) {
                    auto made = session_of_peer(*session, simple);
                    if (!made) return made.error();
                    peer = std::move(*made);
                    auto drawn = session::SceneRenderer::create(*context, *peer);
                    if (!drawn) return drawn.error();
                    peer_renderer = std::move(*drawn);
                }
            }
            std::vector<vdtree::Cut> cuts;
            cuts.push_back(object.cut(i));
            for (const glm::dvec3& direction :
                 session::lod_directions(session::usual_lod_directions, other_directions + i)) {
                const vdtree::View seen = session::lod_view(*lod, object.sphere, direction, distance);
                auto judge = session::PictureJudge::create(shared, *session, seen, lod->samples);
                if (!judge) return judge.error();
                const auto verdict = judge->judge(cuts);
                if (!verdict) return verdict.error();
                add(ours, *verdict);
                if (!peer_renderer) continue;
                const auto whole = session::whole_cuts(*peer);
                const auto frame = peer_renderer->draw(session::drawn_cuts(whole), seen, judge->drawing());
                if (!frame) return frame.error();
                const auto other = judge->judge(*frame);
                if (!other) return other.error();
                add(theirs, *other);
            }
            const bool has_peer = peer_renderer.has_value();
            result.table.rows.push_back({i == 0 ? name : "", std::to_string(i), grouped(ours.triangles),
                                         rounded(distance, 4), grouped(ours.pixels), rounded(ours.v, 2),
                                         grouped(theirs.triangles), has_peer ? grouped(theirs.pixels) : "-",
                                         has_peer ? rounded(theirs.v, 2) : "-"});
            result.rows.push_back({{"model", name},
                                   {"level", i},
                                   {"triangles", ours.triangles},
                                   {"distance_m", distance},
                                   {"visible_pixels", ours.pixels},
                                   {"v", number_or_null(ours.v)},
                                   {"peer_triangles", theirs.triangles},
                                   {"peer_visible_pixels", has_peer ? Json(theirs.pixels) : Json()},
                                   {"peer_v", has_peer ? number_or_null(theirs.v) : Json()},
                                   {"make_s", seconds}});
        }
        if (object.levels.size() == 1) result.table.notes.push_back(name + ": " + object.notes.back());
    }
    result.table.notes.push_back("pixels that either judge sees, of all " +
                                 std::to_string(session::usual_lod_directions) + " sides together");
    if (!has_meshoptimizer()) result.table.notes.push_back("this build is without meshoptimizer");
    return result;
}

} // namespace unseen::app
