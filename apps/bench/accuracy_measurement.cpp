// What the errors of folds are measured by: the steps that can be left out. The settings of the measurement are
// constants (perception/src/measure/measurement.h).
#include "accuracy_axes.h"

#include <functional>
#include <optional>

#include <unseen/perception/fold_measurement.h>
#include <unseen/session_gpu/picture_judge.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>

#include "bench_tools.h"
#include "terminal.h"

namespace unseen::app {
namespace {

// No pictures of the whole mesh, and so no node that folds by one.
Result<vdtree::VertexTree> without_stages(const vdtree::VertexTree& tree) {
    const auto none = tree.with_attribute("fold_stages", vdtree::AttributeDomain::tree, std::vector<float>());
    if (!none) return none.error();
    return none->with_attribute("fold_stage", vdtree::AttributeDomain::interior_node,
                                std::vector<std::uint8_t>(tree.interior_count()));
}

} // namespace

Result<AccuracyPoints> measurement_points(AccuracySubject& subject, const AccuracyBenchOptions& options) {
    // Measured once for each way: larger meshes take minutes.
    constexpr vdtree::Index most_triangles = 200'000;
    const vdtree::VertexTree& tree = subject.session.tree();
    if (tree.triangle_count() > most_triangles || !tree.texture().empty()) return AccuracyPoints();
    auto judge = session::PictureJudge::create(subject.context, subject.session, subject.view, options.samples);
    if (!judge) return judge.error();
    AccuracyPoints points;
    const auto add = [&](const std::string& name, const std::function<Result<vdtree::VertexTree>()>& measure,
                         const std::string& note, bool is_default) -> Result<void> {
        const auto start = BenchClock::now();
        auto measured = measure();
        if (!measured) return measured.error();
        const double seconds = seconds_since(start);
        auto session = session::Session::create(session::Scene::of(std::move(*measured)), subject.session.observer());
        if (!session) return session.error();
        session::Request request{.purpose = session::Purpose::picture};
        request.reasons = false;
        const auto made = session->simplify(subject.view, request);
        if (!made) return made.error();
        constexpr double times_as_far = 8;
        vdtree::View far = subject.view;
        far.eye = far.target + times_as_far * (far.eye - far.target);
        const auto made_far = session->simplify(far, request);
        if (!made_far) return made_far.error();
        auto renderer = session::SceneRenderer::create(subject.context, *session);
        if (!renderer) return renderer.error();
        const auto frame = renderer->draw(session::drawn_cuts(made->cuts), subject.view, judge->drawing());
        if (!frame) return frame.error();
        const auto verdict = judge->judge(*frame);
        if (!verdict) return verdict.error();
        points.push_back(
            {.name = name,
             .values = {seconds, verdict->v, static_cast<double>(made->stats.triangles),
                        static_cast<double>(verdict->visible), static_cast<double>(made_far->stats.triangles)},
             .note = note,
             .is_default = is_default});
        return {};
    };
    // Without what is measured of it, which is of the light that was conserved.
    vdtree::BuildOptions build;
    build.light = tree.light();
    build.prelit = tree.is_prelit();
    vdtree::Cut full(tree);
    full.unfold_all();
    const auto plain = vdtree::build_tree(vdtree::extract_mesh(full).view(), build);
    if (!plain) return plain.error();
    std::optional<vdtree::VertexTree> usual;
    if (auto ok = add(
            "the program's, all cores",
            [&]() -> Result<vdtree::VertexTree> {
                auto made = session::measured(*plain);
                if (made) usual = made->share();
                return made;
            },
            "", true);
        !ok)
        return ok.error();
    if (auto ok = add(
            "one thread", [&] { return session::measured(*plain, 1); }, "the same numbers", false);
        !ok)
        return ok.error();
    if (auto ok = add(
            "without conserving light", [&] { return perception::measure_folds(*plain); },
            "proxies keep the luminance that they were built with", false);
        !ok)
        return ok.error();
    if (auto ok = add(
            "without stages", [&] { return without_stages(*usual); },
            "what the pictures of the whole mesh add; its time is not told apart", false);
        !ok)
        return ok.error();
    points.back().values[0] = points.front().values[0];
    return points;
}

} // namespace unseen::app
