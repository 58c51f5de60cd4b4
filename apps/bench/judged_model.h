// A model whose simplifications are drawn and judged, view by view.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>

#include <unseen/session_gpu/picture_judge.h>

#include "session_options.h"

namespace unseen::app {

// How a model is looked at.
struct Look {
    ViewOptions view; // but for its window
    std::optional<glm::dvec2> gaze_px = {};
    perception::Display display = {}; // flat
    std::optional<perception::Luminance> background = {};
};

// Judges pictures of a view of 64 samples a pixel, whose steps by themselves may show where pixels are coarse and the
// background is dark. So what shows, but by less than twice the threshold, is drawn again with 256 and judged by these.
class CarefulJudge {
public:
    // The full model of the session, as this renderer of it draws it.
    CarefulJudge(std::shared_ptr<session::SceneRenderer> renderer, const session::Session& session,
                 const vdtree::View& view)
        : renderer_(std::move(renderer)), session_(session), view_(view) {}

    session::PictureVerdict judge(session::SceneRenderer& renderer, std::span<const vdtree::Cut> cuts);

private:
    std::shared_ptr<session::SceneRenderer> renderer_;
    const session::Session& session_;
    vdtree::View view_;
    std::map<int, session::PictureJudge> judges_; // by samples
};

// Another simplification of a session's only object, drawn like it.
struct DrawnPeer {
    DrawnPeer(const render::Context& context, const session::Session& own, const vdtree::Mesh& simple);

    session::Session session;
    session::SceneRenderer renderer;
};

// What was seen of a cut, by both judges of the default observer.
struct Seen {
    vdtree::Index triangles = 0;
    session::PictureVerdict verdict;
};

class JudgedModel {
public:
    JudgedModel(const render::Context& context, std::string name, vdtree::VertexTree tree, int window_px);

    const std::string& name() const { return name_; }
    vdtree::Index triangles() const { return plain_.session->tree().triangle_count(); }
    const vdtree::View& view() const { return view_; }

    // From now on everything is seen so.
    void look(const Look& look);
    // What a fold test looks at: the tree as it was built or, if the test asks for it, with the errors of its folds.
    session::Session& session(FoldTest test) { return *stand(test).session; }

    // How many triangles a request for a picture leaves.
    vdtree::Index count(const session::Request& request);
    // Against the full model, which is drawn once a look.
    Seen judge(const session::Request& request);
    Seen judge(const vdtree::Cut& cut); // of the tree with errors

private:
    struct Stand { // a session, whose place does not change, with what draws it
        std::unique_ptr<session::Session> session;
        std::shared_ptr<session::SceneRenderer> renderer;
    };
    Stand make_stand(vdtree::VertexTree tree) const;
    Stand& stand(FoldTest test);
    session::Simplification simplify(Stand& stand, session::Request request);
    Seen judge(Stand& stand, std::span<const vdtree::Cut> cuts);

    render::Context context_;
    std::string name_;
    int window_px_;
    Look look_;
    vdtree::View view_;
    Stand plain_, measured_; // the second when it is first asked for
    std::optional<CarefulJudge> judge_;
};

} // namespace unseen::app
