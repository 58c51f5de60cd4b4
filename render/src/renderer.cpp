// One tree and one cut on the GPU, drawn as a scene of one item.
#include <unseen/render/renderer.h>

#include <unseen/vdtree/internal/stopwatch.h>

#include "context_impl.h"
#include "gl.h"

namespace unseen::render {
namespace {

Frame frame_of(std::span<const glm::vec4> pixels, int width, int height) {
    Frame frame;
    frame.width = width;
    frame.height = height;
    frame.luminance.resize(pixels.size());
    frame.colour.resize(3 * pixels.size());
    for (std::size_t i = 0; i < pixels.size(); ++i) {
        frame.luminance[i] = pixels[i].a;
        frame.colour[3 * i] = pixels[i].r;
        frame.colour[3 * i + 1] = pixels[i].g;
        frame.colour[3 * i + 2] = pixels[i].b;
    }
    return frame;
}

} // namespace

struct Renderer::Impl {
    GpuCut cut;
    std::optional<SampleSum> sum; // made for the first frame off screen, and for each of another size

    Item item(const DrawOptions& options, const vdtree::Similarity& placement) const {
        return {cut, placement, options.shading, options.wireframe, options.lighting};
    }
    Result<void> fit_sum(int width, int height);
    Result<Frame> draw(const vdtree::View& view, const DrawOptions& options, const vdtree::Similarity& placement);
    Result<void> draw_to_window(const vdtree::View& view, const DrawOptions& options,
                                const vdtree::Similarity& placement);
};

Result<void> Renderer::Impl::fit_sum(int width, int height) {
    if (sum && sum->width() == width && sum->height() == height) return {};
    sum.reset(); // the old one first, so that both sizes need not fit at a time
    auto made = SampleSum::create(cut.tree().context(), width, height);
    if (!made) return made.error();
    sum = std::move(*made);
    return {};
}

Result<Frame> Renderer::Impl::draw(const vdtree::View& view, const DrawOptions& options,
                                   const vdtree::Similarity& placement) {
    if (auto valid = vdtree::validate(view); !valid) return valid.error();
    if (auto fitted = fit_sum(view.width, view.height); !fitted) return fitted.error();
    glFinish(); // what came before is not this frame's time
    const auto start = vdtree::Clock::now();
    const Item one = item(options, placement);
    if (auto drawn = sum->draw({&one, 1}, view, {options.samples, options.seed, options.background}); !drawn)
        return drawn.error();
    const auto pixels = sum->mean();
    if (!pixels) return pixels.error();
    const double draw_ms = vdtree::ms_since(start);
    Frame frame = frame_of(*pixels, view.width, view.height);
    frame.draw_ms = draw_ms;
    return frame;
}

Result<void> Renderer::Impl::draw_to_window(const vdtree::View& view, const DrawOptions& options,
                                            const vdtree::Similarity& placement) {
    if (auto valid = vdtree::validate(view); !valid) return valid;
    auto window = Target::foreign(cut.tree().context(), view.width, view.height);
    if (!window) return window.error();
    const Item one = item(options, placement);
    return render::draw({&one, 1}, {.view = view}, *window, {.colour = glm::vec4(options.background)});
}

Result<Renderer> Renderer::create(const Context& context, const vdtree::VertexTree& tree) {
    auto on_gpu = GpuTree::create(context, tree);
    if (!on_gpu) return on_gpu.error();
    return Renderer(std::make_unique<Impl>(Impl{GpuCut(*on_gpu), {}}));
}

Renderer::Renderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;
Renderer::~Renderer() = default;

std::uint64_t Renderer::uploaded_bytes() const noexcept { return impl_->cut.uploaded_bytes(); }

Result<Frame> Renderer::draw(const vdtree::Cut& cut, const vdtree::View& view, const DrawOptions& options,
                             const vdtree::Similarity& placement) {
    if (auto followed = impl_->cut.follow(cut); !followed) return followed.error();
    return impl_->draw(view, options, placement);
}

Result<Frame> Renderer::draw(const vdtree::Geomorph& geomorph, const vdtree::View& view, const DrawOptions& options,
                             const vdtree::Similarity& placement) {
    if (auto followed = impl_->cut.follow(geomorph); !followed) return followed.error();
    return impl_->draw(view, options, placement);
}

Result<void> Renderer::draw_to_window(const vdtree::Cut& cut, const vdtree::View& view, const DrawOptions& options,
                                      const vdtree::Similarity& placement) {
    if (auto followed = impl_->cut.follow(cut); !followed) return followed;
    return impl_->draw_to_window(view, options, placement);
}

Result<void> Renderer::draw_to_window(const vdtree::Geomorph& geomorph, const vdtree::View& view,
                                      const DrawOptions& options, const vdtree::Similarity& placement) {
    if (auto followed = impl_->cut.follow(geomorph); !followed) return followed;
    return impl_->draw_to_window(view, options, placement);
}

} // namespace unseen::render
