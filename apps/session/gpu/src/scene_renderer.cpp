#include <unseen/session_gpu/scene_renderer.h>

#include <algorithm>

#include <unseen/render/sample_sum.h>
#include <unseen/vdtree/internal/light_bounds.h>
#include <unseen/vdtree/internal/stopwatch.h>

#include "shared_uploads.h"

namespace unseen::session {

std::vector<DrawnCut> drawn_cuts(std::span<const vdtree::Cut> cuts) {
    std::vector<DrawnCut> drawn;
    for (const vdtree::Cut& cut : cuts) drawn.push_back({&cut});
    return drawn;
}

std::vector<DrawnCut> drawn_cuts(const Follower& follower, std::size_t objects) {
    std::vector<DrawnCut> drawn;
    for (std::size_t i = 0; i < objects; ++i) drawn.push_back({&follower.cut(i), follower.geomorph(i)});
    return drawn;
}

std::vector<vdtree::Cut> whole_cuts(const Session& session) {
    std::vector<vdtree::Cut> whole;
    for (std::size_t i = 0; i < session.scene().objects.size(); ++i) whole.emplace_back(session.tree(i)).unfold_all();
    return whole;
}

struct SceneRenderer::Impl {
    render::Context context;
    Session session;
    std::vector<render::GpuCut> objects, backdrop;
    std::optional<render::SampleSum> sum;   // made for the first frame off screen, and for each of another size
    std::optional<render::Shadows> shadows; // made when a light first casts some

    Result<void> load();
    Result<SceneItems> items(std::span<const DrawnCut> cuts, const vdtree::View& view,
                             const render::DrawOptions& options);
    Result<render::Shadows*> cast(std::span<const render::Item> items);
};

Result<void> SceneRenderer::Impl::load() {
    SharedUploads uploads(context);
    for (const Object& object : session.scene().objects) {
        const auto tree = uploads.tree(object.tree);
        if (!tree) return tree.error();
        objects.emplace_back(*tree);
    }
    for (const Object& part : session.scene().backdrop) {
        auto whole = uploads.whole(part.tree);
        if (!whole) return whole.error();
        backdrop.push_back(std::move(*whole));
    }
    return {};
}

Result<SceneItems> SceneRenderer::Impl::items(std::span<const DrawnCut> cuts, const vdtree::View& view,
                                              const render::DrawOptions& options) {
    SceneItems all;
    all.items.reserve(objects.size() + backdrop.size());
    const Scene& scene = session.scene();
    for (std::size_t i = 0; i < objects.size(); ++i) {
        const auto followed = cuts[i].geomorph ? objects[i].follow(*cuts[i].geomorph) : objects[i].follow(*cuts[i].cut);
        if (!followed) return followed.error();
        if (cuts[i].cut->triangle_count() == 0 && cuts[i].geomorph == nullptr && objects.size() > 1) continue;
        auto lighting = session.lighting(view, i);
        if (!lighting) return lighting.error();
        all.items.push_back(
            {objects[i], scene.objects[i].placement, options.shading, options.wireframe, std::move(*lighting)});
        all.objects.push_back(i);
    }
    for (std::size_t i = 0; i < backdrop.size(); ++i) {
        auto lighting = session.backdrop_lighting(view, i);
        if (!lighting) return lighting.error();
        all.items.push_back(
            {backdrop[i], scene.backdrop[i].placement, options.shading, options.wireframe, std::move(*lighting)});
    }
    const auto casting = cast(all.items);
    if (!casting) return casting.error();
    all.shadows = *casting;
    return all;
}

// Null where no light casts any. The maps reach over all that there may be, whatever the cuts leave of it.
Result<render::Shadows*> SceneRenderer::Impl::cast(std::span<const render::Item> items) {
    const bool any = std::any_of(items.begin(), items.end(), [](const render::Item& item) {
        return item.lighting && vdtree::shadow_lights(*item.lighting) > 0;
    });
    if (!any) {
        shadows.reset();
        return static_cast<render::Shadows*>(nullptr);
    }
    if (!shadows) {
        const Scene& scene = session.scene();
        std::vector<render::Item> all;
        for (std::size_t i = 0; i < objects.size(); ++i) all.push_back({objects[i], scene.objects[i].placement});
        for (std::size_t i = 0; i < backdrop.size(); ++i) all.push_back({backdrop[i], scene.backdrop[i].placement});
        auto made = render::Shadows::create(context, {.bounds = render::ball_around(all)});
        if (!made) return made.error();
        shadows = std::move(*made);
    }
    if (const auto updated = shadows->update(items); !updated) return updated.error();
    return &*shadows;
}

Result<SceneRenderer> SceneRenderer::create(const render::Context& context, const Session& session) {
    auto impl = std::make_unique<Impl>(Impl{context, session.share(), {}, {}, {}, {}});
    if (const auto loaded = impl->load(); !loaded) return loaded.error();
    return SceneRenderer(std::move(impl));
}

Result<render::Frame> SceneRenderer::draw(std::span<const DrawnCut> cuts, const vdtree::View& view,
                                          const render::DrawOptions& options) {
    if (auto valid = vdtree::validate(view); !valid) return valid.error();
    auto& sum = impl_->sum;
    if (!sum || sum->width() != view.width || sum->height() != view.height) {
        sum.reset(); // the old one first, so that both sizes need not fit at a time
        auto made = render::SampleSum::create(impl_->context, view.width, view.height);
        if (!made) return made.error();
        sum = std::move(*made);
    }
    const auto items = impl_->items(cuts, view, options);
    if (!items) return items.error();
    if (auto done = impl_->context.finish(); !done) return done.error(); // what came before is not this frame's time
    const auto start = vdtree::Clock::now();
    if (auto drawn = sum->draw(items->items, view, {options.samples, options.seed, options.background, items->shadows});
        !drawn)
        return drawn.error();
    const auto pixels = sum->mean();
    if (!pixels) return pixels.error();
    render::Frame frame;
    frame.draw_ms = vdtree::ms_since(start);
    frame.width = view.width;
    frame.height = view.height;
    frame.luminance.reserve(pixels->size());
    frame.colour.reserve(3 * pixels->size());
    for (const glm::vec4& pixel : *pixels) {
        frame.luminance.push_back(pixel.a);
        frame.colour.insert(frame.colour.end(), {pixel.r, pixel.g, pixel.b});
    }
    return frame;
}

Result<void> SceneRenderer::draw_to_window(std::span<const DrawnCut> cuts, const vdtree::View& view,
                                           const render::DrawOptions& options) {
    if (auto valid = vdtree::validate(view); !valid) return valid;
    auto window = render::Target::foreign(impl_->context, view.width, view.height);
    if (!window) return window.error();
    const auto items = impl_->items(cuts, view, options);
    if (!items) return items.error();
    return render::draw(items->items, {.view = view, .shadows = items->shadows}, *window,
                        {.colour = glm::vec4(options.background)});
}

Result<SceneItems> SceneRenderer::items(std::span<const DrawnCut> cuts, const vdtree::View& view,
                                        const render::DrawOptions& options) {
    return impl_->items(cuts, view, options);
}

std::uint64_t SceneRenderer::uploaded_bytes() const noexcept {
    std::uint64_t bytes = 0;
    for (const render::GpuCut& cut : impl_->objects) bytes += cut.uploaded_bytes();
    return bytes;
}

std::optional<render::ShadowFacts> SceneRenderer::shadows() const {
    if (!impl_->shadows) return std::nullopt;
    return impl_->shadows->facts();
}

SceneRenderer::SceneRenderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SceneRenderer::SceneRenderer(SceneRenderer&&) noexcept = default;
SceneRenderer& SceneRenderer::operator=(SceneRenderer&&) noexcept = default;
SceneRenderer::~SceneRenderer() = default;

perception::Image code_image(const render::Frame& frame, const perception::Display& display) {
    perception::Image image{frame.width, frame.height, 3, {}};
    image.values.reserve(frame.colour.size());
    for (const float linear : frame.colour) {
        const double code = perception::encode(display, static_cast<double>(linear));
        image.values.push_back(static_cast<float>(std::clamp(code, 0.0, 1.0)));
    }
    return image;
}

perception::Image luminance_image(const render::Frame& frame, const perception::Display& display) {
    perception::Image image{frame.width, frame.height, 1, {}};
    image.values.reserve(frame.luminance.size());
    for (const float relative : frame.luminance)
        image.values.push_back(
            static_cast<float>(perception::to_luminance(display, static_cast<double>(relative)).value()));
    return image;
}

} // namespace unseen::session
