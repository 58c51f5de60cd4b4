// The index buffer on the GPU, patched from draw to draw: the pictures are those of renderers that begin anew.
#include "context_impl.h"
#include "gl_test.h"
#include "scenes.h"

#include <unseen/render/renderer.h>
#include <unseen/vdtree/active_triangles.h>

namespace patching_test {

using namespace unseen::render;
using namespace unseen::render::testing;
using unseen::vdtree::Cut;
using unseen::vdtree::View;

class PatchingTest : public GlTest {
protected:
    void SetUp() override {
        GlTest::SetUp();
        if (IsSkipped()) return;
        context().impl().makes_indices = true; // in software, too
        scene_ = std::make_unique<Scene>(bumpy_sphere(96));
        renderer_ = make_renderer();
    }

    const unseen::vdtree::VertexTree& tree() const { return scene_->tree; }

    std::unique_ptr<Renderer> make_renderer() {
        auto made = Renderer::create(context(), tree());
        EXPECT_TRUE(made) << made.error().message;
        return made ? std::make_unique<Renderer>(std::move(*made)) : nullptr;
    }

    static View orbit(double degrees, double distance = 4) {
        const double angle = degrees * std::acos(-1.0) / 180;
        View view;
        view.eye = distance * glm::dvec3(std::sin(angle), 0.2, std::cos(angle));
        view.width = view.height = 96;
        return view;
    }

    unseen::vdtree::AdjustStats follow(Cut& cut, const View& view, double tolerance_px) {
        // One criterion for each tolerance: another one would start over.
        auto& criterion = criteria_[tolerance_px];
        if (!criterion) {
            auto made = unseen::vdtree::extent_criterion(tree(), view, tolerance_px);
            EXPECT_TRUE(made);
            criterion = std::make_unique<unseen::vdtree::DistanceCriterion>(std::move(*made));
        }
        unseen::vdtree::Viewpoint viewpoint;
        viewpoint.eye = view.eye - tree().origin();
        auto stats = cut.follow(*criterion, viewpoint);
        EXPECT_TRUE(stats) << stats.error().message;
        return stats ? *stats : unseen::vdtree::AdjustStats{};
    }

    Frame draw(Renderer& renderer, const Cut& cut, const View& view) {
        auto frame = renderer.draw(cut, view, {.samples = 2});
        EXPECT_TRUE(frame) << frame.error().message;
        return frame ? std::move(*frame) : Frame{};
    }

    // Exactly: triangles come in another order, but none lies on top of another one.
    void expect_as_from_scratch(const Frame& frame, const View& view, double tolerance_px) {
        Cut fresh(tree());
        follow(fresh, view, tolerance_px);
        const auto renderer = make_renderer();
        const Frame expected = draw(*renderer, fresh, view);
        EXPECT_EQ(frame.luminance, expected.luminance);
        EXPECT_EQ(frame.colour, expected.colour);
    }

    std::unique_ptr<Scene> scene_;
    std::unique_ptr<Renderer> renderer_;
    std::map<double, std::unique_ptr<unseen::vdtree::DistanceCriterion>> criteria_;
};

TEST_F(PatchingTest, ManySmallMovesDrawWhatBeginningAnewDraws) {
    Cut cut(tree());
    std::uint64_t patched = 0, changed = 0;
    for (int frame = 0; frame < 120; ++frame) {
        const View view = orbit(0.4 * frame, 4 - 0.01 * frame);
        const auto stats = follow(cut, view, 4);
        const Frame drawn = draw(*renderer_, cut, view);
        const std::uint64_t whole = cut.indices().size_bytes();
        changed += stats.folds + stats.unfolds > 0;
        patched += renderer_->uploaded_bytes() > 0 && renderer_->uploaded_bytes() < whole / 2;
        if (frame % 30 == 29) expect_as_from_scratch(drawn, view, 4);
    }
    EXPECT_GT(changed, 60u);
    EXPECT_GT(patched, changed / 2) << "of " << changed << " changed frames: bytes must follow the changes";
}

TEST_F(PatchingTest, AStillViewUploadsNothing) {
    Cut cut(tree());
    follow(cut, orbit(0), 4);
    draw(*renderer_, cut, orbit(0));
    EXPECT_EQ(renderer_->uploaded_bytes(), cut.indices().size_bytes());
    follow(cut, orbit(0), 4);
    draw(*renderer_, cut, orbit(0));
    EXPECT_EQ(renderer_->uploaded_bytes(), 0u);
}

TEST_F(PatchingTest, BytesAreSixteenForEachTriangleThatComesAndEachRunOfLeaves) {
    Cut cut(tree());
    unseen::vdtree::ActiveTriangles active(tree());
    int told = 0;
    for (int frame = 0; frame < 200; ++frame) {
        const View view = orbit(0.2 * frame);
        follow(cut, view, 4);
        draw(*renderer_, cut, view);
        if (!active.update(cut) || cut.changes().empty() || ++told == 1) continue; // the first one brings the form
        std::uint64_t runs = 0;                                                    // of 64 leaves at most
        for (const auto& run : active.changed_runs()) runs += (run.count + 63) / 64;
        EXPECT_EQ(renderer_->uploaded_bytes(), 16 * (active.changed_slots().size() + runs)) << "frame " << frame;
    }
    EXPECT_GT(told, 20);
}

// What the renderer has not seen it must not take for known: steps without a draw, jumps, other cuts, other ways to
// change a cut.
TEST_F(PatchingTest, MissedChangesUploadTheWhole) {
    Cut cut(tree()), other(tree());
    for (int frame = 0; frame < 60; ++frame) {
        const View view = orbit(frame == 40 ? 180 : 0.4 * frame);
        follow(cut, view, 4);
        if (frame % 7 == 3) continue; // not drawn
        if (frame % 11 == 5) {
            follow(other, view, 9);
            expect_as_from_scratch(draw(*renderer_, other, view), view, 9);
        }
        if (frame == 30) {
            cut.unfold_all();
            const Frame full = draw(*renderer_, cut, view);
            EXPECT_EQ(full.luminance, draw(*make_renderer(), scene_->cut, view).luminance);
            cut.fold_all();
            follow(cut, view, 4);
        }
        const Frame drawn = draw(*renderer_, cut, view);
        if (frame % 7 == 4 || frame % 11 == 5 || frame == 30 || frame == 40) expect_as_from_scratch(drawn, view, 4);
    }
}

TEST_F(PatchingTest, GrowsWithTheCut) {
    Cut cut(tree());
    const double nearest = 1.5;
    std::size_t before = 0;
    for (double distance = 12; distance > nearest; distance *= 0.985) {
        const View view = orbit(20, distance);
        follow(cut, view, 4);
        const Frame drawn = draw(*renderer_, cut, view);
        if (cut.indices().size() > before * 2) {
            before = cut.indices().size();
            expect_as_from_scratch(drawn, view, 4);
        }
    }
    EXPECT_GT(before, 3u * 1000u);
}

} // namespace patching_test
