// How old the gaze that a frame goes by may be.
#include "accuracy_axes.h"

#include <algorithm>

#include <unseen/session_gpu/picture_judge.h>

#include "bench_tools.h"
#include "terminal.h"

namespace unseen::app {

Result<AccuracyPoints> gaze_age_points(AccuracySubject& subject, const AccuracyBenchOptions& options) {
    session::Session& session = subject.session;
    // Each gaze asks for criteria of its own, of every object: with many that takes minutes.
    constexpr std::size_t most_objects = 16;
    if (session.scene().objects.size() > most_objects) {
        subject.left_out.push_back("all of it, for it has more than " + std::to_string(most_objects) + " objects.");
        return AccuracyPoints();
    }
    session::Request request{.purpose = session::Purpose::picture};
    request.reasons = false;
    // Whatever happens, the session is left without a gaze, as it was.
    struct Restore {
        session::Session& session;
        ~Restore() { session.set_gaze({}); }
    } restore{session};
    const auto without = session.simplify(subject.view, request);
    if (!without) return without.error();
    const double all = std::max<double>(1, without->stats.triangles);
    // By now the viewer looks at the middle; some frames ago, at what is to the right of it.
    const auto gaze_at = [&](double degrees, double margin) {
        return session::Gaze{session::gaze_aside(session.observer().display, subject.view, degrees), margin};
    };
    session.set_gaze(gaze_at(0, 0));
    auto judge = session::PictureJudge::create(subject.context, session, subject.view, options.samples);
    if (!judge) return judge.error();
    AccuracyPoints points;
    const auto add = [&](const std::string& name, std::optional<session::Gaze> gaze, bool is_default) -> Result<void> {
        session.set_gaze(gaze);
        const auto made = session.simplify(subject.view, request);
        if (!made) return made.error();
        const auto verdict = judge->judge(made->cuts);
        if (!verdict) return verdict.error();
        points.push_back({.name = name,
                          .values = {made->stats.triangles / all, verdict->v, static_cast<double>(verdict->visible)},
                          .is_default = is_default});
        return {};
    };
    constexpr double degrees_a_frame = 30.0 / 60;
    if (auto ok = add("no gaze", {}, true); !ok) return ok.error();
    if (auto ok = add("of this frame", gaze_at(0, 0), false); !ok) return ok.error();
    for (const int frames : {1, 4, 16}) {
        const double degrees = degrees_a_frame * frames;
        const std::string name = std::to_string(frames) + (frames == 1 ? " frame old" : " frames old");
        if (auto ok = add(name, gaze_at(degrees, 0), false); !ok) return ok.error();
        if (auto ok = add(name + ", margin of " + shortest(degrees) + " deg", gaze_at(degrees, degrees), false); !ok)
            return ok.error();
    }
    return points;
}

} // namespace unseen::app
