// A model whose simplifications are drawn and judged, view by view.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>

#include <unseen/perception/image.h>
#include <unseen/perception/judge.h>
#include <unseen/render/renderer.h>
#include <unseen/vdtree/cut.h>

#include "session_options.h"

namespace unseen::app {

// The judges, of the default observer. The first shares castleCSF with the fold tests; the second has another model of
// contrast sensitivity and adds its bands up as squares: perception::second_judge_options().
enum class Judge { modern, second };
inline constexpr std::array judges = {Judge::modern, Judge::second};
inline constexpr perception::CsfModel usual_second =
    perception::CsfModel::barten_fitted; // of the eye's physics, by its own laws of area and of frequency

// Where they run. The GPU's says what the CPU's says within 0.1%.
enum class JudgeDevice { cpu, gpu };

struct Verdicts {
    vdtree::Index triangles = 0;
    std::array<std::uint64_t, judges.size()> visible_pixels = {};
    std::array<double, judges.size()> largest = {}; // V
};

class JudgedModel {
public:
    // Keeps a handle to the context.
    static Result<JudgedModel> create(const render::Context& context, std::string name, vdtree::VertexTree tree,
                                      int window_px, perception::CsfModel second = usual_second,
                                      JudgeDevice device = JudgeDevice::cpu);

    const std::string& name() const { return name_; }
    const vdtree::VertexTree& tree() const { return plain_.session->tree(); }
    vdtree::Index triangles() const { return tree().triangle_count(); }

    // What a fold test looks at: the tree as it was built or, where the test asks for it, with the errors of its folds.
    Result<session::Session*> session(FoldTest test);
    const vdtree::View& view() const { return view_; }

    // From now on it is seen on such a flat screen, before this background (none: the usual one). Look anew then.
    Result<void> put(const perception::Display& display, std::optional<perception::Luminance> background);
    // From now on everything is seen so. Of the options, the window's size is the model's own.
    Result<void> look(ViewOptions view);

    struct Picture {
        vdtree::Index triangles = 0;
        perception::Image luminance; // cd/m2
    };
    Result<Picture> draw(const WhatOptions& what);
    // Against the full model, which is drawn once a view.
    Result<Verdicts> judge(const WhatOptions& what); // by all judges
    Result<perception::Judgement> judge(const WhatOptions& what, Judge judge);
    // Another cut of the tree with errors, that of session(FoldTest::error), by the first judge.
    Result<perception::Judgement> judge(const vdtree::Cut& cut, const std::optional<glm::dvec2>& gaze_px);

    // The cut alone.
    Result<vdtree::Index> count(const WhatOptions& what);

private:
    struct Stand { // a session with what draws it
        std::unique_ptr<session::Session> session;
        std::unique_ptr<render::Renderer> renderer;
    };
    JudgedModel() = default;
    Result<Stand*> stand(FoldTest test);
    Result<Stand> make_stand(vdtree::VertexTree tree);
    Result<session::Session> make_session(vdtree::VertexTree tree) const;
    Result<session::Simplification> simplify(Stand& stand, const WhatOptions& what);
    Result<Picture> draw(Stand& stand, const WhatOptions& what);
    Result<Picture> draw(Stand& stand, const vdtree::Cut& cut);
    Result<const perception::Image*> full();
    Result<perception::Judgement> judge(const Picture& picture, const std::optional<glm::dvec2>& gaze_px, Judge judge);

    std::optional<render::Context> context_;
    std::string name_;
    perception::Display display_;
    std::optional<perception::Luminance> background_;
    perception::CsfModel second_ = usual_second;
    JudgeDevice device_ = JudgeDevice::cpu;
    vdtree::View view_;
    Stand plain_, measured_; // the second with the errors of folds; made when it is first asked for
    std::optional<perception::Image> full_;
};

} // namespace unseen::app
