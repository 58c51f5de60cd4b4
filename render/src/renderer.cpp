// One tree and one cut on the GPU, drawn as a scene of one item.
#include <unseen/render/internal/frame.h>

#include <algorithm>
#include <limits>

#include <unseen/vdtree/internal/stopwatch.h>

#include "surface_pass.h"

namespace unseen::render {

Result<Frame> draw_frame(std::optional<SampleSum>& sum, const Context& context, std::span<const Item> items,
                         const vdtree::View& view, const Sampling& sampling) {
    if (auto valid = vdtree::validate(view); !valid) return valid.error();
    if (!sum || sum->width() != view.width || sum->height() != view.height) {
        sum.reset(); // the old one first, so that both sizes need not fit at a time
        auto made = SampleSum::create(context, view.width, view.height);
        if (!made) return made.error();
        sum = std::move(*made);
    }
    if (auto done = context.finish(); !done) return done.error(); // what came before is not this frame's time
    const auto start = vdtree::Clock::now();
    if (auto drawn = sum->draw(items, view, sampling); !drawn) return drawn.error();
    const auto pixels = sum->mean();
    if (!pixels) return pixels.error();
    Frame frame{view.width, view.height, {}, {}, vdtree::ms_since(start)};
    frame.luminance.reserve(pixels->size());
    frame.colour.reserve(3 * pixels->size());
    for (const glm::vec4& pixel : *pixels) {
        frame.luminance.push_back(pixel.a);
        frame.colour.insert(frame.colour.end(), {pixel.r, pixel.g, pixel.b});
    }
    return frame;
}

// Reversed depth is near / distance, so the farthest is the least.
Result<std::vector<float>> farthest_depth(const Context& context, std::span<const Item> items, const vdtree::View& view,
                                          int samples, std::uint32_t seed) {
    if (const auto valid = check_samples(samples); !valid) return valid.error();
    if (const auto valid = vdtree::validate_perspective(view, "A picture of depth"); !valid) return valid.error();
    auto target = Target::create(context, view.width, view.height, {.colours = {}, .label = "farthest depth"});
    if (!target) return target.error();
    const auto nearest = near_plane(items, view);
    if (!nearest) return nearest.error();
    std::vector<float> least;
    // What is cut out in part may show what is behind.
    constexpr float nearly_all = 0.999f;
    for (const glm::dvec2 point : n_rooks(samples, seed)) {
        const auto drawn = in_context(context, "Drawing depths", [&]() -> Result<void> {
            const auto pass = SurfacePass::prepare(items, {view, point, *nearest}, target->impl(), 0);
            if (!pass) return pass.error();
            pass->draw(target->impl(), point, {.colour = std::nullopt}, 1, nullptr, nearly_all);
            return {};
        });
        if (!drawn) return drawn.error();
        auto depth = read_depth(*target);
        if (!depth) return depth.error();
        if (least.empty()) least = std::move(*depth);
        else
            for (std::size_t i = 0; i < least.size(); ++i) least[i] = std::min(least[i], (*depth)[i]);
    }
    const auto near_distance = static_cast<float>(*nearest);
    for (float& depth : least) depth = depth > 0 ? near_distance / depth : std::numeric_limits<float>::infinity();
    return least;
}

struct Renderer::Impl {
    GpuCut cut;
    std::optional<SampleSum> sum; // made for the first frame off screen, and for each of another size

    Item item(const DrawOptions& options, const vdtree::Similarity& placement) const {
        return {cut, placement, options.shading, options.wireframe, options.lighting};
    }

    template <class Shown>
    Result<Frame> draw(const Shown& shown, const vdtree::View& view, const DrawOptions& options,
                       const vdtree::Similarity& placement) {
        if (auto followed = cut.follow(shown); !followed) return followed.error();
        const Item one = item(options, placement);
        return draw_frame(sum, cut.tree().context(), {&one, 1}, view,
                          {options.samples, options.seed, options.background});
    }
    template <class Shown>
    Result<void> draw_to_window(const Shown& shown, const vdtree::View& view, const DrawOptions& options,
                                const vdtree::Similarity& placement) {
        if (auto followed = cut.follow(shown); !followed) return followed;
        if (auto valid = vdtree::validate(view); !valid) return valid;
        auto window = Target::foreign(cut.tree().context(), view.width, view.height);
        if (!window) return window.error();
        const Item one = item(options, placement);
        return render::draw({&one, 1}, {.view = view}, *window, {.colour = glm::vec4(options.background)});
    }
};

Result<Renderer> Renderer::create(const Context& context, const vdtree::VertexTree& tree) {
    auto on_gpu = GpuTree::create(context, tree);
    if (!on_gpu) return on_gpu.error();
    return Renderer(std::make_unique<Impl>(Impl{GpuCut(*on_gpu), {}}));
}

std::uint64_t Renderer::uploaded_bytes() const noexcept { return impl_->cut.uploaded_bytes(); }

Result<Frame> Renderer::draw(const vdtree::Cut& cut, const vdtree::View& view, const DrawOptions& options,
                             const vdtree::Similarity& placement) {
    return impl_->draw(cut, view, options, placement);
}

Result<Frame> Renderer::draw(const vdtree::Geomorph& geomorph, const vdtree::View& view, const DrawOptions& options,
                             const vdtree::Similarity& placement) {
    return impl_->draw(geomorph, view, options, placement);
}

Result<void> Renderer::draw_to_window(const vdtree::Cut& cut, const vdtree::View& view, const DrawOptions& options,
                                      const vdtree::Similarity& placement) {
    return impl_->draw_to_window(cut, view, options, placement);
}

Result<void> Renderer::draw_to_window(const vdtree::Geomorph& geomorph, const vdtree::View& view,
                                      const DrawOptions& options, const vdtree::Similarity& placement) {
    return impl_->draw_to_window(geomorph, view, options, placement);
}

} // namespace unseen::render
