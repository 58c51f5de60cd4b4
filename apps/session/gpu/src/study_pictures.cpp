#include <unseen/session_gpu/study_pictures.h>

#include <algorithm>

#include <unseen/session_gpu/frame_image.h>
#include <unseen/session_gpu/scene_renderer.h>
#include <unseen/vdtree/internal/errors.h>

namespace unseen::session {
namespace {

using calibration::StudyPair;
namespace fs = std::filesystem;

Result<void> validate(const StudyPicturesOptions& options) {
    constexpr int most_views = 360, most_samples = 256;
    if (options.views < 1 || options.views > most_views)
        return invalid_argument("The views of a study must be 1 to 360.");
    if (options.samples < 1 || options.samples > most_samples)
        return invalid_argument("The samples of a study's pictures must be 1 to 256.");
    return {};
}

// Pictures of a session, as its display shows them.
class Photographer {
public:
    static Result<Photographer> create(Session& session, const render::Context& context,
                                       const StudyPicturesOptions& options) {
        auto renderer = SceneRenderer::create(context, session);
        if (!renderer) return renderer.error();
        return Photographer(session, options, std::move(*renderer));
    }

    Result<fs::path> take(std::span<const vdtree::Cut> cuts, const vdtree::View& view, const std::string& name) {
        render::DrawOptions drawing;
        drawing.samples = options_->samples;
        drawing.background = session_->background();
        const auto frame = renderer_.draw(drawn_cuts(cuts), view, drawing);
        if (!frame) return frame.error();
        fs::path file = options_->folder / (options_->prefix + name + ".png");
        if (const auto ok = perception::write_image(file, code_image(*frame, session_->observer().display)); !ok)
            return ok.error();
        return file;
    }
    // Of what a request makes of the view.
    Result<fs::path> take(Request request, const vdtree::View& view, const std::string& name) {
        request.purpose = Purpose::picture;
        const auto made = session_->simplify(view, request);
        if (!made) return made.error();
        return take(made->cuts, view, name);
    }

private:
    Photographer(Session& session, const StudyPicturesOptions& options, SceneRenderer renderer)
        : session_(&session), options_(&options), renderer_(std::move(renderer)) {}

    Session* session_;
    const StudyPicturesOptions* options_;
    SceneRenderer renderer_;
};

vdtree::View turned(const vdtree::View& view, const StudyPicturesOptions& options, int number) {
    return vdtree::orbited(view, number * options.degrees);
}

std::string file_name(int view, const std::string& what) { return "view" + std::to_string(view + 1) + "-" + what; }

} // namespace

Result<std::vector<StudyPair>> draw_study_pairs(Session& session, const render::Context& context,
                                                const vdtree::View& view, const std::vector<StudyCondition>& conditions,
                                                const StudyPicturesOptions& options) {
    if (const auto valid = validate(options); !valid) return valid.error();
    // Errors of folds are measured first, for trees must not change once they are on the GPU.
    for (const StudyCondition& condition : conditions)
        if (const auto ready = session.prepare(view, condition.request); !ready) return ready.error();
    auto photographer = Photographer::create(session, context, options);
    if (!photographer) return photographer.error();
    std::vector<StudyPair> pairs;
    for (int number = 0; number < options.views; ++number) {
        const vdtree::View from = turned(view, options, number);
        const auto original = photographer->take(Request{.goal = Goal::full()}, from, file_name(number, "original"));
        if (!original) return original.error();
        if (options.pairs_original) pairs.push_back({"original", *original, *original, false, {}});
        for (std::size_t i = 0; i < conditions.size(); ++i) {
            if (options.progress)
                options.progress((number + static_cast<double>(i) / static_cast<double>(conditions.size())) /
                                 options.views);
            const StudyCondition& condition = conditions[i];
            const auto other = photographer->take(condition.request, from, file_name(number, std::to_string(i + 1)));
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
    auto photographer = Photographer::create(session, context, options);
    if (!photographer) return photographer.error();
    const LevelChain& chain = control->chain(0);
    std::vector<StudyPair> pairs;
    for (int number = 0; number < options.views; ++number) {
        if (options.progress) options.progress(static_cast<double>(number) / options.views);
        const vdtree::View from = turned(view, options, number);
        const auto settled = control->settle(from);
        if (!settled) return settled.error();
        const int kept = settled->levels.front();
        if (kept < 0) return invalid_argument("The scene's object is out of the window.");
        std::optional<fs::path> best;
        for (int level = 0; level < chain.size(); ++level) {
            const vdtree::Cut cut = chain.cut(level);
            const auto picture =
                photographer->take(std::span(&cut, 1), from, file_name(number, "level" + std::to_string(level)));
            if (!picture) return picture.error();
            if (level == 0) {
                best = *picture;
                if (options.pairs_original) pairs.push_back({"original", *best, *best, false, {}});
                continue;
            }
            const char* const decision = level < kept ? "decrease" : level == kept ? "maintain" : "increase";
            pairs.push_back({"level " + std::to_string(level) + ", " + decision, *best, *picture, false, level > kept});
        }
    }
    return pairs;
}

} // namespace unseen::session
