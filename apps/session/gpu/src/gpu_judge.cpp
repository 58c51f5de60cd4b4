#include <unseen/session_gpu/gpu_judge.h>

#include <algorithm>

#include <unseen/perception/internal/judge_tables.h>
#include <unseen/render/internal/visibility_passes.h>

namespace unseen::session {
namespace {

// What a texture cannot tell: whether it is one channel of as many values as its size says.
Result<void> check_shape(const perception::Image& image, const char* which) {
    const auto pixels =
        static_cast<std::size_t>(std::max(image.width, 0)) * static_cast<std::size_t>(std::max(image.height, 0));
    if (pixels > 0 && image.channels == 1 && image.values.size() == pixels) return {};
    return Error{ErrorCode::invalid_argument,
                 "judge: the " + std::string(which) + " is not a luminance image (one channel, one pixel or more)"};
}

Result<render::LuminanceImage> upload(const render::Context& context, const perception::Image& image,
                                      const char* which) {
    if (auto ok = check_shape(image, which); !ok) return ok.error();
    return render::LuminanceImage::create(context, image.width, image.height, image.values);
}

} // namespace

struct GpuJudge::Impl {
    render::Context context;
    render::VisibilityPasses passes;
    int width, height;
    std::optional<render::LuminanceImage> test; // made for the first uploaded picture
};

Result<GpuJudge> GpuJudge::create(const render::Context& context, const perception::Image& reference,
                                  const perception::JudgeOptions& options) {
    const auto uploaded = upload(context, reference, "reference");
    if (!uploaded) return uploaded.error();
    return create(context, uploaded->texture(), options);
}

Result<GpuJudge> GpuJudge::create(const render::Context& context, const render::LuminanceTexture& reference,
                                  const perception::JudgeOptions& options) {
    const auto extent = render::luminance_extent(context, reference, "reference");
    if (!extent) return extent.error();
    const auto tables =
        perception::judge_tables(reference.width, reference.height, extent->least, extent->largest, options);
    if (!tables) return tables.error();
    auto passes = render::VisibilityPasses::create(context, *tables, reference);
    if (!passes) return passes.error();
    return GpuJudge(
        std::make_unique<Impl>(Impl{context, std::move(*passes), reference.width, reference.height, std::nullopt}));
}

Result<perception::Judgement> GpuJudge::judge(const perception::Image& image) {
    if (auto ok = check_shape(image, "test"); !ok) return ok.error();
    auto& test = impl_->test;
    if (image.width != impl_->width || image.height != impl_->height || !test) { // the passes refuse another size
        auto uploaded = upload(impl_->context, image, "test");
        if (!uploaded) return uploaded.error();
        test = std::move(*uploaded);
    } else if (auto ok = test->set(image.values); !ok) {
        return ok.error();
    }
    const auto summary = judge(test->texture());
    if (!summary) {
        test.reset();
        return summary.error();
    }
    auto visibility = impl_->passes.read_visibility();
    if (!visibility) return visibility.error();
    perception::Judgement judgement;
    judgement.pixels = visibility->size();
    judgement.visible_pixels = summary->visible_pixels;
    judgement.max_ratio = summary->largest;
    judgement.visibility = {impl_->width, impl_->height, 1, std::move(*visibility)};
    return judgement;
}

Result<GpuJudge::Summary> GpuJudge::judge(const render::LuminanceTexture& test) {
    if (auto judged = impl_->passes.judge(test); !judged) return judged.error();
    const auto summary = impl_->passes.summary();
    if (!summary) return summary.error();
    return Summary{summary->largest, summary->visible_pixels};
}

render::VisibilityPasses& GpuJudge::passes() noexcept { return impl_->passes; }

} // namespace unseen::session
