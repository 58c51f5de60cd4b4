#include <unseen/session_gpu/scene_renderer.h>

#include <algorithm>

#include <unseen/render/internal/frame.h>

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

namespace {

render::Frame side_by_side(const render::Frame& left, const render::Frame& right) {
    render::Frame both;
    both.width = 2 * left.width, both.height = left.height;
    both.draw_ms = left.draw_ms + right.draw_ms;
    const auto join = [&](std::vector<float> render::Frame::*values) {
        const std::size_t row = (left.*values).size() / static_cast<std::size_t>(left.height);
        for (std::size_t begin = 0; begin < (left.*values).size(); begin += row)
            for (const render::Frame* eye : {&left, &right}) {
                const auto first = (eye->*values).begin() + static_cast<std::ptrdiff_t>(begin);
                (both.*values).insert((both.*values).end(), first, first + static_cast<std::ptrdiff_t>(row));
            }
    };
    join(&render::Frame::luminance);
    join(&render::Frame::colour);
    return both;
}

} // namespace

struct SceneRenderer::Impl {
    render::Context context;
    Session session;
    std::vector<render::GpuCut> objects;
    UploadedBackdrop backdrop;
    std::optional<render::SampleSum> sum;   // made for the first frame off screen, and for each of another size
    std::optional<render::Shadows> shadows; // made when a light first casts some

    Result<void> load() {
        SharedUploads uploads(context);
        for (const Object& object : session.scene().objects) {
            const auto tree = uploads.tree(object.tree);
            if (!tree) return tree.error();
            objects.emplace_back(*tree);
        }
        return backdrop.load(session.scene(), uploads);
    }

    Result<SceneItems> items(std::span<const DrawnCut> cuts, const vdtree::View& view,
                             const render::DrawOptions& options) {
        SceneItems all;
        for (std::size_t i = 0; i < objects.size(); ++i) {
            const auto followed =
                cuts[i].geomorph ? objects[i].follow(*cuts[i].geomorph) : objects[i].follow(*cuts[i].cut);
            if (!followed) return followed.error();
            if (cuts[i].cut->triangle_count() == 0 && cuts[i].geomorph == nullptr && objects.size() > 1) continue;
            auto item = lit_item(session, i, objects[i], view, options);
            if (!item) return item.error();
            all.items.push_back(std::move(*item));
            all.objects.push_back(i);
        }
        const auto behind = backdrop.items(session, view, options);
        if (!behind) return behind.error();
        all.items.insert(all.items.end(), behind->begin(), behind->end());
        const auto casting = cast(all.items);
        if (!casting) return casting.error();
        all.shadows = *casting;
        return all;
    }

    // Null where no light casts any. The maps reach over all that there may be, whatever the cuts leave of it.
    Result<render::Shadows*> cast(std::span<const render::Item> items) {
        if (std::ranges::none_of(items, is_in_casting_light)) {
            shadows.reset();
            return static_cast<render::Shadows*>(nullptr);
        }
        if (!shadows) {
            const Scene& scene = session.scene();
            std::vector<render::Item> all;
            for (std::size_t i = 0; i < objects.size(); ++i) all.push_back({objects[i], scene.objects[i].placement});
            all.insert(all.end(), items.end() - static_cast<std::ptrdiff_t>(scene.backdrop.size()), items.end());
            auto made = render::Shadows::create(context, render::ball_around(all));
            if (!made) return made.error();
            shadows = std::move(*made);
        }
        if (const auto updated = shadows->update(items); !updated) return updated.error();
        return &*shadows;
    }
};

Result<SceneRenderer> SceneRenderer::create(const render::Context& context, const Session& session) {
    auto impl = std::make_unique<Impl>(Impl{context, session.share(), {}, {}, {}, {}});
    if (const auto loaded = impl->load(); !loaded) return loaded.error();
    return SceneRenderer(std::move(impl));
}

Result<render::Frame> SceneRenderer::draw(std::span<const DrawnCut> cuts, const vdtree::View& view,
                                          const render::DrawOptions& options) {
    if (auto valid = vdtree::validate(view); !valid) return valid.error();
    const auto items = impl_->items(cuts, view, options);
    if (!items) return items.error();
    const auto drawn = [&](const vdtree::View& eye) {
        return render::draw_frame(impl_->sum, impl_->context, items->items, eye,
                                  {options.samples, options.seed, options.background, items->shadows});
    };
    const auto [left, right] = vdtree::eyes_of(view);
    auto frame = drawn(left);
    if (!frame || view.eye_distance == 0) return frame;
    const auto other = drawn(right);
    return other ? side_by_side(*frame, *other) : other;
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

std::string SceneRenderer::why_whole() const {
    for (const render::GpuCut& cut : impl_->objects)
        if (!cut.why_whole().empty()) return cut.why_whole();
    return {};
}

std::optional<render::ShadowFacts> SceneRenderer::shadows() const {
    if (!impl_->shadows) return std::nullopt;
    return impl_->shadows->facts();
}

perception::Image code_image(const render::Frame& frame, const perception::Display& display) {
    perception::Image image{frame.width, frame.height, 3, {}};
    image.values.reserve(frame.colour.size());
    for (const float linear : frame.colour) {
        const double code = perception::encode(display, static_cast<double>(linear));
        image.values.push_back(static_cast<float>(std::clamp(code, 0.0, 1.0)));
    }
    return image;
}

namespace {

perception::Image on_display(int width, int height, int channels, std::span<const float> relative,
                             const perception::Display& display) {
    perception::Image image{width, height, channels, {}};
    image.values.reserve(relative.size());
    for (const float value : relative) // no display shows more than its peak
        image.values.push_back(static_cast<float>(
            perception::to_luminance(display, std::clamp(static_cast<double>(value), 0.0, 1.0)).value()));
    return image;
}

} // namespace

perception::Image luminance_image(const render::Frame& frame, const perception::Display& display) {
    return on_display(frame.width, frame.height, 1, frame.luminance, display);
}

perception::Image light_image(const render::Frame& frame, const perception::Display& display) {
    const std::vector<float>& rgb = frame.colour;
    bool is_grey = true;
    for (std::size_t i = 0; i < rgb.size(); i += 3) is_grey &= rgb[i] == rgb[i + 1] && rgb[i] == rgb[i + 2];
    return is_grey ? luminance_image(frame, display) : on_display(frame.width, frame.height, 3, rgb, display);
}

} // namespace unseen::session
