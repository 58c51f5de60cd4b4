// The modern judge on the GPU.
//
//     const auto context = render::Context::headless();
//     auto judge = session::GpuJudge::create(*context, reference, options);
//     const auto judgement = judge->judge(test); // like perception::Judge
#pragma once

#include <cstdint>

#include <unseen/perception/image.h>
#include <unseen/perception/judge.h>
#include <unseen/render/target.h>

namespace unseen::render {
class VisibilityPasses;
}

namespace unseen::session {

// perception::Judge on the GPU. V and thresholds agree with it within 1e-3. Used from the context's thread. Move-only; keeps
// a handle to the context.
class GpuJudge {
public:
    // Fails like perception::Judge::create(), and if a picture exceeds the GPU's textures or memory.
    static Result<GpuJudge> create(const render::Context& context, const perception::Image& reference,
                                   const perception::JudgeOptions& options);
    // The reference is on the GPU already. Waits for the GPU once, for the reference's range of luminances.
    static Result<GpuJudge> create(const render::Context& context, const render::LuminanceTexture& reference,
                                   const perception::JudgeOptions& options);
    GpuJudge(GpuJudge&&) noexcept = default;
    GpuJudge& operator=(GpuJudge&&) noexcept = default;

    // Uploads, judges and reads V back. Fails like perception::Judge::judge().
    Result<perception::Judgement> judge(const perception::Image& test);
    // Judges a picture that is on the GPU, where V stays.
    struct Summary {
        double largest = 0; // V
        std::uint64_t visible_pixels = 0;
    };
    Result<Summary> judge(const render::LuminanceTexture& test);

    render::VisibilityPasses& passes() noexcept; // for the library's own passes

private:
    struct Impl;
    explicit GpuJudge(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::session
