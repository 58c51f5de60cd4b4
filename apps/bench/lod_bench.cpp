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

// One model's levels, and meshoptimizer's of as many triangles.
class LodComparison {
public:
    static Result<LodComparison> create(const render::Context& context, const std::string& model, int levels) {
        ViewOptions view;
        view.as = session::LoadAs::model; // the peer takes one mesh
        auto session = open_session(model, view, {});
        if (!session) return session.error();
        const auto start = std::chrono::steady_clock::now();
        auto lod = session::make_levels(*session, context, {.chain = {.levels = levels}});
        if (!lod) return lod.error();
        const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        auto renderer = session::SceneRenderer::create(context, *session);
        if (!renderer) return renderer.error();
        vdtree::Mesh full = whole_mesh(session->tree());
        return LodComparison{context,
                             std::filesystem::path(model).filename().string(),
                             std::make_unique<session::Session>(std::move(*session)),
                             std::move(*lod),
                             std::make_shared<session::SceneRenderer>(std::move(*renderer)),
                             std::move(full),
                             seconds};
    }

    const session::LodObject& object() const { return lod.objects[0]; }

    // Level 0 is the control: what the peer's way of being drawn shows by itself, where the first level begins.
    double distance(std::size_t level) const { return object().levels[std::max<std::size_t>(level, 1)].distance; }

    struct Peer {
        session::Session session;
        session::SceneRenderer renderer;
    };
    // None where it leaves no triangles.
    Result<std::unique_ptr<Peer>> peer(std::size_t level, LodSeen& seen) const {
        const vdtree::Mesh simple =
            level == 0 ? full : simplified_by_meshoptimizer(full, object().levels[level].triangles, true);
        seen.triangles = static_cast<vdtree::Index>(simple.triangles.size());
        if (simple.triangles.empty()) return std::unique_ptr<Peer>();
        auto made = session_of_peer(*session, simple);
        if (!made) return made.error();
        auto drawn = session::SceneRenderer::create(context, *made);
        if (!drawn) return drawn.error();
        return std::make_unique<Peer>(Peer{std::move(*made), std::move(*drawn)});
    }

    Result<void> judge(std::size_t level, Peer* peer, LodSeen& ours, LodSeen& theirs) const {
        std::vector<vdtree::Cut> cuts;
        cuts.push_back(object().cut(level));
        for (const glm::dvec3& direction :
             session::lod_directions(session::usual_lod_directions, other_directions + level)) {
            const vdtree::View seen = session::lod_view(lod, object().sphere, direction, distance(level));
            auto judge = session::PictureJudge::create(renderer, *session, seen, lod.samples);
            if (!judge) return judge.error();
            const auto verdict = judge->judge(cuts);
            if (!verdict) return verdict.error();
            add(ours, *verdict);
            if (!peer) continue;
            const auto whole = session::whole_cuts(peer->session);
            const auto frame = peer->renderer.draw(session::drawn_cuts(whole), seen, judge->drawing());
            if (!frame) return frame.error();
            const auto other = judge->judge(*frame);
            if (!other) return other.error();
            add(theirs, *other);
        }
        return {};
    }

    const render::Context& context;
    std::string name;
    std::unique_ptr<session::Session> session; // whose place does not change: the renderer refers to it
    session::Lod lod;
    std::shared_ptr<session::SceneRenderer> renderer;
    vdtree::Mesh full;
    double seconds;
};

Result<void> add_levels(const LodComparison& model, LodBenchResult& result) {
    const session::LodObject& object = model.object();
    for (std::size_t i = 0; i < object.levels.size() && object.levels.size() > 1; ++i) {
        LodSeen ours{.triangles = object.levels[i].triangles}, theirs;
        std::unique_ptr<LodComparison::Peer> peer;
        if (has_meshoptimizer()) {
            auto made = model.peer(i, theirs);
            if (!made) return made.error();
            peer = std::move(*made);
        }
        if (auto judged = model.judge(i, peer.get(), ours, theirs); !judged) return judged;
        result.table.rows.push_back({i == 0 ? model.name : "", std::to_string(i), grouped(ours.triangles),
                                     rounded(model.distance(i), 4), grouped(ours.pixels), rounded(ours.v, 2),
                                     grouped(theirs.triangles), peer ? grouped(theirs.pixels) : "-",
                                     peer ? rounded(theirs.v, 2) : "-"});
        result.rows.push_back({{"model", model.name},
                               {"level", i},
                               {"triangles", ours.triangles},
                               {"distance_m", model.distance(i)},
                               {"visible_pixels", ours.pixels},
                               {"v", number_or_null(ours.v)},
                               {"peer_triangles", theirs.triangles},
                               {"peer_visible_pixels", peer ? Json(theirs.pixels) : Json()},
                               {"peer_v", peer ? number_or_null(theirs.v) : Json()},
                               {"make_s", model.seconds}});
    }
    if (object.levels.size() == 1) result.table.notes.push_back(model.name + ": " + object.notes.back());
    return {};
}

} // namespace

Result<LodBenchResult> bench_lod(const std::vector<std::string>& models, int levels) {
    auto context = render::Context::headless();
    if (!context) return context.error();
    LodBenchResult result;
    result.table.rows = {{"model", "level", "triangles", "from, m", "visible pixels", "largest V",
                          "meshoptimizer: triangles", "visible pixels", "largest V"}};
    for (const std::string& model : models) {
        const auto comparison = LodComparison::create(*context, model, levels);
        if (!comparison) return comparison.error();
        if (auto added = add_levels(*comparison, result); !added) return added.error();
    }
    result.table.notes.push_back("pixels that either judge sees, of all " +
                                 std::to_string(session::usual_lod_directions) + " sides together");
    if (!has_meshoptimizer()) result.table.notes.push_back("this build is without meshoptimizer");
    return result;
}

} // namespace unseen::app
