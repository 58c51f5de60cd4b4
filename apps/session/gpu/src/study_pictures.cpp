#include <unseen/session_gpu/study_pictures.h>

#include <algorithm>
#include <cmath>

#include <unseen/session_gpu/scene_renderer.h>
#include <unseen/vdtree/internal/errors.h>

namespace unseen::session {
namespace {

using calibration::LevelStep;
using calibration::StudyPair;
namespace fs = std::filesystem;

Result<void> validate(const StudyPicturesOptions& options) {
    constexpr int most_views = 360, most_samples = 256;
    if (options.views < 1 || options.views > most_views)
        return invalid_argument("The views of a study must be 1 to 360.");
    if (options.samples < 1 || options.samples > most_samples)
        return invalid_argument("The samples of a study's pictures must be 1 to 256.");
    if (options.distances.empty()) return invalid_argument("A study needs a distance to look from.");
    for (const double distance : options.distances)
        if (!(distance > 0 && std::isfinite(distance)))
            return invalid_argument("The distances of a study's views must be above 0.");
    return {};
}

// Pictures of a session, as its display shows them.
struct Photographer {
    Session& session;
    const StudyPicturesOptions& options;
    SceneRenderer renderer;

    Result<fs::path> take(std::span<const vdtree::Cut> cuts, const vdtree::View& view, const std::string& name) {
        const auto frame =
            renderer.draw(drawn_cuts(cuts), view, {.samples = options.samples, .background = session.background()});
        if (!frame) return frame.error();
        fs::path file = options.folder / (options.prefix + name + ".png");
        if (const auto ok = perception::write_image(file, code_image(*frame, session.observer().display)); !ok)
            return ok.error();
        return file;
    }
    // Draws what a request makes of the view.
    Result<fs::path> take(Request request, const vdtree::View& view, const std::string& name) {
        request.purpose = Purpose::picture;
        const auto made = session.simplify(view, request);
        if (!made) return made.error();
        return take(made->cuts, view, name);
    }
};

// From each distance all around.
std::vector<vdtree::View> views_of(const vdtree::View& view, const StudyPicturesOptions& options) {
    std::vector<vdtree::View> views;
    for (const double distance : options.distances)
        for (int number = 0; number < options.views; ++number) {
            vdtree::View& turned = views.emplace_back(vdtree::orbited(view, number * options.degrees));
            turned.eye = turned.target + distance * (turned.eye - turned.target);
        }
    return views;
}

std::string file_name(std::size_t view, const std::string& what) {
    return "view" + std::to_string(view + 1) + "-" + what;
}

// `share`: of the view that is being drawn.
Result<void> go_on(const StudyPicturesOptions& options, std::size_t view, double share, std::size_t views) {
    if (!options.progress ||
        options.progress((static_cast<double>(view) + share) / static_cast<double>(views), "pictures"))
        return {};
    return Error{ErrorCode::cancelled, "Drawing the pictures of a study was stopped."};
}

} // namespace

Result<std::vector<StudyPair>> draw_study_pairs(Session& session, const render::Context& context,
                                                const vdtree::View& view, const std::vector<StudyCondition>& conditions,
                                                const StudyPicturesOptions& options) {
    if (const auto valid = validate(options); !valid) return valid.error();
    // Errors of folds are measured first, for trees must not change once they are on the GPU.
    for (const StudyCondition& condition : conditions)
        if (const auto ready = session.prepare(view, condition.request); !ready) return ready.error();
    auto renderer = SceneRenderer::create(context, session);
    if (!renderer) return renderer.error();
    Photographer photographer{session, options, std::move(*renderer)};
    std::vector<StudyPair> pairs;
    const std::vector<vdtree::View> views = views_of(view, options);
    for (std::size_t number = 0; number < views.size(); ++number) {
        const vdtree::View& from = views[number];
        const auto original = photographer.take(Request{.goal = Goal::full()}, from, file_name(number, "original"));
        if (!original) return original.error();
        if (options.pairs_original) pairs.push_back({"original", *original, *original, false, {}});
        for (std::size_t i = 0; i < conditions.size(); ++i) {
            if (const auto on = go_on(options, number, static_cast<double>(i) / static_cast<double>(conditions.size()),
                                      views.size());
                !on)
                return on.error();
            const StudyCondition& condition = conditions[i];
            const auto other = photographer.take(condition.request, from, file_name(number, std::to_string(i + 1)));
            if (!other) return other.error();
            pairs.push_back({condition.name, *original, *other, condition.is_training, {}});
        }
    }
    return pairs;
}

Result<std::vector<StudyPair>> draw_level_pairs(Session& session, const render::Context& context,
                                                const vdtree::View& view, const LevelControlOptions& levels,
                                                const StudyPicturesOptions& options) {
    if (const auto valid = validate(options); !valid) return valid.error();
    if (session.scene().objects.size() != 1)
        return invalid_argument("Pairs of levels are made of scenes with one object, and this one has " +
                                std::to_string(session.scene().objects.size()) + ".");
    auto control = LevelControl::create(context, session, view, levels);
    if (!control) return control.error();
    auto renderer = SceneRenderer::create(context, session);
    if (!renderer) return renderer.error();
    Photographer photographer{session, options, std::move(*renderer)};
    const LevelChain& chain = control->chain(0);
    std::vector<StudyPair> pairs;
    const std::vector<vdtree::View> views = views_of(view, options);
    for (std::size_t number = 0; number < views.size(); ++number) {
        if (const auto on = go_on(options, number, 0, views.size()); !on) return on.error();
        const vdtree::View& from = views[number];
        const auto settled = control->settle(from);
        if (!settled) return settled.error();
        const int kept = settled->levels.front();
        if (kept < 0) return invalid_argument("The scene's object is out of the window.");
        std::map<int, fs::path> pictures; // by level, those that were needed
        const auto picture = [&](int level) -> Result<fs::path> {
            if (const auto there = pictures.find(level); there != pictures.end()) return there->second;
            const vdtree::Cut cut = chain.cut(level);
            auto taken =
                photographer.take(std::span(&cut, 1), from, file_name(number, "level" + std::to_string(level)));
            if (taken) pictures.emplace(level, *taken);
            return taken;
        };
        const auto add = [&](LevelStep step, int better, int level, bool is_seen) -> Result<void> {
            const auto original = picture(better), other = picture(level);
            if (!original) return original.error();
            if (!other) return other.error();
            pairs.push_back({calibration::level_condition(kept, step), *original, *other, false, is_seen});
            return {};
        };
        if (options.pairs_original) {
            const auto best = picture(0);
            if (!best) return best.error();
            pairs.push_back({"original", *best, *best, false, {}});
        }
        Result<void> added;
        if (kept >= 2) added = add(LevelStep::decrease, 0, kept - 1, false);
        if (added && kept >= 1) added = add(LevelStep::maintain, kept - 1, kept, false);
        if (added && kept + 1 < chain.size()) added = add(LevelStep::increase, 0, kept + 1, true);
        if (!added) return added.error();
    }
    if (std::ranges::all_of(pairs, [](const StudyPair& pair) { return pair.original == pair.other; }))
        return invalid_argument("The object has no level but the full mesh: there is nothing to compare.");
    return pairs;
}

} // namespace unseen::session
