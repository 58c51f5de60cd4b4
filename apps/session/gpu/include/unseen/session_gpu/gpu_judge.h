// The modern judge on the GPU: perception's tables, render's passes.
//
//     const auto context = render::Context::headless();
//     auto judge = session::GpuJudge::create(*context, reference, options);
//     const auto judgement = judge->judge(test); // as perception::Judge has it
#pragma once

#include <optional>
#include <utility>

#include <unseen/perception/image.h>
#include <unseen/perception/judge.h>
#include <unseen/perception/judge_tables.h>
#include <unseen/render/context.h>
#include <unseen/render/elevation.h>
#include <unseen/render/visibility.h>

namespace unseen::session {

// perception::Judge on the GPU. V and thresholds are its own within 1e-3; with half floats V within 1%. Used from the
// context's thread. Move-only; keeps a handle to the context.
class GpuJudge {
public:
    // Errors: those of perception::Judge::create; a picture that is larger than the GPU's textures, or than its memory.
    static Result<GpuJudge> create(const render::Context& context, const perception::Image& reference,
                                   const perception::JudgeOptions& options,
                                   render::VisibilityPrecision precision = render::VisibilityPrecision::full);
    // Of what is on the GPU already. Waits for the GPU once, for the reference's range of luminances.
    static Result<GpuJudge> create(const render::Context& context, const render::LuminanceTexture& reference,
                                   const perception::JudgeOptions& options,
                                   render::VisibilityPrecision precision = render::VisibilityPrecision::full);

    // Uploads, judges and reads V back. Errors: those of perception::Judge::judge.
    Result<perception::Judgement> judge(const perception::Image& test);
    // Of what is on the GPU, where V stays.
    Result<render::VisibilitySummary> judge(const render::LuminanceTexture& test);

    // perception::threshold_map_modern() of the reference.
    Result<perception::Image> threshold_map();

    // For what stays on the GPU.
    render::VisibilityPasses& passes() noexcept { return passes_; }

private:
    GpuJudge(const render::Context& context, render::VisibilityPasses passes, int width, int height)
        : context_(context), passes_(std::move(passes)), width_(width), height_(height) {}

    render::Context context_;
    render::VisibilityPasses passes_;
    int width_, height_;
    std::optional<render::LuminanceImage> test_; // made for the first picture that is uploaded
};

// The tables in render's terms.
render::VisibilityTables visibility_tables(const perception::JudgeTables& tables);
render::ElevationTables elevation_tables(const perception::Rpg99Tables& tables);

} // namespace unseen::session
