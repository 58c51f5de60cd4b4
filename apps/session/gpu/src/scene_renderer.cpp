#include <session_gpu/scene_renderer.h>

#include <algorithm>
#include <chrono>
#include <unordered_map>

namespace unseen::app {

std::vector<session::DrawnCut> session::drawn_cuts(std::span<const vdtree::Cut> cuts) {
    std::vector<session::DrawnCut> drawn;
    for (const vdtree::Cut& cut : cuts) drawn.push_back({&cut});
    return drawn;
}

std::vector<session::DrawnCut> session::drawn_cuts(const session::Follower& follower, std::size_t objects) {
    std::vector<session::DrawnCut> drawn;
    for (std::size_t i = 0; i < objects; ++i) drawn.push_back({&follower.cut(i), follower.geomorph(i)});
    return drawn;
}

struct session::SceneRenderer::Impl {
    const render::Context& context;
    const session::Session& session;
    std::vector<render::GpuCut> objects, backdrop;
    std::optional<render::SampleSum> sum;   // made for the first frame off screen, and for each of another size
    std::optional<render::Shadows> shadows; // made when a light first casts some

    Result<void> load();
    Result<std::vector<render::Item>> items(std::span<const session::DrawnCut> cuts, const vdtree::View& view,
                                            const render::DrawOptions& options);
    Result<render::Shadows*> cast(std::span<const render::Item> items);
};

Result<void> session::SceneRenderer::Impl::load() {
    std::unordered_map<const vdtree::VertexTree::Data*, render::GpuTree> trees;
    const auto tree_of = [&](const session::Object& object) -> Result<render::GpuTree> {
        const auto known = trees.find(&object.tree.data());
        if (known != trees.end()) return known->second;
        auto made = render::GpuTree::create(context, object.tree);
        if (made) trees.emplace(&object.tree.data(), *made);
        return made;
    };
    for (const session::Object& object : session.scene().objects) {
        const auto tree = tree_of(object);
        if (!tree) return tree.error();
        objects.emplace_back(*tree);
    }
    std::unordered_map<const vdtree::VertexTree::Data*, render::GpuCut> whole; // parts with one tree share it
    for (const session::Object& part : session.scene().backdrop) {
        const auto known = whole.find(&part.tree.data());
        if (known != whole.end()) {
            backdrop.push_back(known->second);
            continue;
        }
        const auto tree = tree_of(part);
        if (!tree) return tree.error();
        vdtree::Cut all(part.tree);
        all.unfold_all();
        render::GpuCut cut(*tree);
        if (const auto followed = cut.follow(all); !followed) return followed;
        whole.emplace(&part.tree.data(), cut);
        backdrop.push_back(std::move(cut));
    }
    return {};
}

Result<std::vector<render::Item>> session::SceneRenderer::Impl::items(std::span<const session::DrawnCut> cuts,
                                                                      const vdtree::View& view,
                                                                      const render::DrawOptions& options) {
    std::vector<render::Item> items;
    items.reserve(objects.size() + backdrop.size());
    const session::Scene& scene = session.scene();
    for (std::size_t i = 0; i < objects.size(); ++i) {
        const auto followed = cuts[i].geomorph ? objects[i].follow(*cuts[i].geomorph) : objects[i].follow(*cuts[i].cut);
        if (!followed) return followed.error();
        if (cuts[i].cut->triangle_count() == 0 && cuts[i].geomorph == nullptr && objects.size() > 1) continue;
        auto lighting = session.lighting(view, i);
        if (!lighting) return lighting.error();
        items.push_back(
            {objects[i], scene.objects[i].placement, options.shading, options.wireframe, std::move(*lighting)});
    }
    for (std::size_t i = 0; i < backdrop.size(); ++i) {
        auto lighting = session.backdrop_lighting(view, i);
        if (!lighting) return lighting.error();
        items.push_back(
            {backdrop[i], scene.backdrop[i].placement, options.shading, options.wireframe, std::move(*lighting)});
    }
    return items;
}

// Null where no light casts any. The maps reach over all that there may be, whatever the cuts leave of it.
Result<render::Shadows*> session::SceneRenderer::Impl::cast(std::span<const render::Item> items) {
    const bool any = std::any_of(items.begin(), items.end(), [](const render::Item& item) {
        return item.lighting && vdtree::shadow_lights(*item.lighting) > 0;
    });
    if (!any) {
        shadows.reset();
        return static_cast<render::Shadows*>(nullptr);
    }
    if (!shadows) {
        const session::Scene& scene = session.scene();
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

Result<session::SceneRenderer> session::SceneRenderer::create(const render::Context& context,
                                                              const session::Session& session) {
    auto impl = std::make_unique<Impl>(Impl{context, session, {}, {}, {}, {}});
    if (const auto loaded = impl->load(); !loaded) return loaded.error();
    return session::SceneRenderer(std::move(impl));
}

Result<render::Frame> session::SceneRenderer::draw(std::span<const session::DrawnCut> cuts, const vdtree::View& view,
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
    const auto start = std::chrono::steady_clock::now();
    const auto shadows = impl_->cast(*items);
    if (!shadows) return shadows.error();
    if (auto drawn = sum->draw(*items, view, {options.samples, options.seed, options.background, *shadows}); !drawn)
        return drawn.error();
    const auto pixels = sum->mean();
    if (!pixels) return pixels.error();
    render::Frame frame;
    frame.draw_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
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

Result<void> session::SceneRenderer::draw_to_window(std::span<const session::DrawnCut> cuts, const vdtree::View& view,
                                                    const render::DrawOptions& options) {
    if (auto valid = vdtree::validate(view); !valid) return valid;
    auto window = render::Target::foreign(impl_->context, view.width, view.height);
    if (!window) return window.error();
    const auto items = impl_->items(cuts, view, options);
    if (!items) return items.error();
    const auto shadows = impl_->cast(*items);
    if (!shadows) return shadows.error();
    return render::draw(*items, {.view = view, .shadows = *shadows}, *window,
                        {.colour = glm::vec4(options.background)});
}

std::uint64_t session::SceneRenderer::uploaded_bytes() const noexcept {
    std::uint64_t bytes = 0;
    for (const render::GpuCut& cut : impl_->objects) bytes += cut.uploaded_bytes();
    return bytes;
}

std::optional<render::ShadowFacts> session::SceneRenderer::shadows() const {
    if (!impl_->shadows) return std::nullopt;
    return impl_->shadows->facts();
}

session::SceneRenderer::SceneRenderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
session::SceneRenderer::SceneRenderer(session::SceneRenderer&&) noexcept = default;
session::SceneRenderer& session::SceneRenderer::operator=(session::SceneRenderer&&) noexcept = default;
session::SceneRenderer::~session::SceneRenderer() = default;

} // namespace unseen::app
