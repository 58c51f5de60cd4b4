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

struct Judged {
    double triangles;
    session::PictureVerdict verdict;
};
Result<Judged> judged(session::Session& session, session::SceneRenderer& renderer, const vdtree::View& view,
                      const session::PictureJudge& judge) {
    const auto made = session.simplify(view, {.purpose = session::Purpose::picture, .reasons = false});
    if (!made) return made.error();
    const auto frame = renderer.draw(session::drawn_cuts(made->cuts), view, judge.drawing());
    if (!frame) return frame.error();
    const auto verdict = judge.judge(*frame);
    if (!verdict) return verdict.error();
    return Judged{static_cast<double>(made->stats.triangles), *verdict};
}

// One mesh, from its view and from farther away.
struct Judges {
    session::PictureJudge near, far;
    vdtree::View far_view;
};

// `measure`: what makes the tree.
Result<AccuracyPoint> point(const AccuracySubject& subject, const Judges& judges, const std::string& name,
                            const std::function<Result<vdtree::VertexTree>()>& measure, const std::string& note = {}) {
    const auto start = BenchClock::now();
    auto measured = measure();
    if (!measured) return measured.error();
    const double seconds = seconds_since(start);
    auto session = session::Session::create(session::Scene::of(std::move(*measured)), subject.session.observer());
    if (!session) return session.error();
    auto renderer = session::SceneRenderer::create(subject.context, *session);
    if (!renderer) return renderer.error();
    const auto near = judged(*session, *renderer, subject.view, judges.near);
    if (!near) return near.error();
    const auto far = judged(*session, *renderer, judges.far_view, judges.far);
    if (!far) return far.error();
    return AccuracyPoint{.name = name,
                         .values = {seconds, near->verdict.v, near->triangles,
                                    static_cast<double>(near->verdict.visible), far->triangles, far->verdict.v},
                         .note = note};
}

} // namespace

Result<AccuracyPoints> measurement_points(AccuracySubject& subject, const AccuracyBenchOptions& options) {
    // Measured once for each way: larger meshes take too many minutes.
    constexpr vdtree::Index most_triangles = 1'000'000;
    const vdtree::VertexTree& tree = subject.session.tree();
    if (tree.triangle_count() > most_triangles || !tree.texture().empty()) {
        subject.left_out.push_back(tree.texture().empty()
                                       ? "all of it, for it has more than " + grouped(most_triangles) + " triangles."
                                       : "all of it, for it has a texture.");
        return AccuracyPoints();
    }
    constexpr double times_as_far = 8;
    vdtree::View far = subject.view;
    far.eye = far.target + times_as_far * (far.eye - far.target);
    auto judge = session::PictureJudge::create(subject.context, subject.session, subject.view, options.samples);
    if (!judge) return judge.error();
    auto judge_far = session::PictureJudge::create(subject.context, subject.session, far, options.samples);
    if (!judge_far) return judge_far.error();
    const Judges judges{std::move(*judge), std::move(*judge_far), far};
    // Without what is measured of it, which is of the light that was conserved.
    vdtree::BuildOptions build;
    build.light = tree.light();
    build.prelit = tree.is_prelit();
    vdtree::Cut full(tree);
    full.unfold_all();
    const auto plain = vdtree::build_tree(vdtree::extract_mesh(full).view(), build);
    if (!plain) return plain.error();
    std::optional<vdtree::VertexTree> usual;
    const auto measure_usual = [&]() -> Result<vdtree::VertexTree> {
        auto made = session::measured(*plain);
        if (made) usual = made->share();
        return made;
    };
    AccuracyPoints points;
    for (auto made :
         {point(subject, judges, "the program's, all cores", measure_usual),
          point(
              subject, judges, "one thread", [&] { return session::measured(*plain, 1); }, "the same numbers"),
          point(
              subject, judges, "without conserving light", [&] { return perception::measure_folds(*plain); },
              "proxies keep the luminance that they were built with"),
          point(
              subject, judges, "without stages", [&] { return usual ? without_stages(*usual) : measure_usual(); },
              "what the pictures of the whole mesh add; its time is not told apart")}) {
        if (!made) return made.error();
        points.push_back(std::move(*made));
    }
    points.front().is_default = true;
    points.back().values[0] = points.front().values[0];
    return points;
}

} // namespace unseen::app
