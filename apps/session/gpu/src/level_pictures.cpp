#include <unseen/session_gpu/level_pictures.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <unseen/render/draw.h>
#include <unseen/render/gpu_tree.h>
#include <unseen/render/sample_sum.h>
#include <unseen/render/target.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/stopwatch.h>

#include "shared_uploads.h"

namespace unseen::session {
Result<LevelChain> selection_chain(Session& session, std::size_t object, int levels) {
    if (levels < 2 || levels > most_levels)
        return invalid_argument("An object to select levels for has 2 to " + std::to_string(most_levels) + " of them.");
    const auto recipe = session.recipe(session.default_view(), {.keeps_shadows = false}, object);
    if (!recipe) return recipe.error();
    return LevelChain::by_triangles(
        session.tree(object), *recipe->criterion,
        {.levels = levels, .most_share = 0.5, .least_share = std::exp2(1 - levels), .least_triangles = 20});
}

struct LevelPictures::Impl {
    struct Drawn {
        std::vector<glm::vec4> pixels;
        std::vector<float> depth;
    };

    Impl(const render::Context& context_, Session& session_)
        : context(context_), session(session_), uploads(context_) {}

    Result<void> load(int level_count);
    Result<void> need_target(const vdtree::View& view);
    Result<render::Item> item(std::size_t object, int level, const vdtree::View& view) const;
    Result<std::vector<render::Item>> backdrop_items(const vdtree::View& view) const;
    Result<double> near_plane(const std::vector<std::size_t>& objects, const std::vector<render::Item>& background,
                              const vdtree::View& view) const;
    Result<Drawn> draw(const std::vector<render::Item>& items, const vdtree::View& view, double near);
    float value_of(float luminance, SelectionQuality quality) const;

    render::Context context;
    Session& session;
    SharedUploads uploads;
    std::vector<const UploadedLevels*> levels; // by object
    std::vector<WorldSphere> spheres;          // by object
    std::vector<std::vector<std::uint32_t>> triangles;
    std::vector<render::GpuCut> backdrop;
    std::optional<render::Target> target;
    std::optional<render::SampleSum> sum; // of frames, for each of another size
    LevelPictureTimes times;
};

Result<void> LevelPictures::Impl::load(int level_count) {
    if (auto ready = session.prepare(session.default_view(), {}); !ready) return ready.error();
    const Scene& scene = session.scene();
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
        const auto own = uploads.levels(session.tree(i), [&] { return selection_chain(session, i, level_count); });
        if (!own) return own.error();
        const LevelChain& chain = (*own)->chain;
        levels.push_back(*own);
        spheres.push_back(world_sphere(scene.objects[i]));
        auto& counts = triangles.emplace_back();
        for (int level = 0; level < chain.size(); ++level) counts.push_back(chain.triangles(level));
    }
    for (const Object& part : scene.backdrop) {
        auto whole = uploads.whole(part.tree);
        if (!whole) return whole.error();
        backdrop.push_back(std::move(*whole));
    }
    return {};
}

Result<void> LevelPictures::Impl::need_target(const vdtree::View& view) {
    if (target && target->width() == view.width && target->height() == view.height) return {};
    target.reset();
    auto made = render::Target::create(context, view.width, view.height, {.label = "level picture"});
    if (!made) return made.error();
    target = std::move(*made);
    return {};
}

Result<render::Item> LevelPictures::Impl::item(std::size_t object, int level, const vdtree::View& view) const {
    auto lighting = session.lighting(view, object);
    if (!lighting) return lighting.error();
    render::Item made{levels[object]->cuts[static_cast<std::size_t>(level)], session.scene().objects[object].placement};
    made.lighting = std::move(*lighting);
    return made;
}

Result<std::vector<render::Item>> LevelPictures::Impl::backdrop_items(const vdtree::View& view) const {
    std::vector<render::Item> items;
    for (std::size_t i = 0; i < backdrop.size(); ++i) {
        auto lighting = session.backdrop_lighting(view, i);
        if (!lighting) return lighting.error();
        render::Item& made = items.emplace_back(render::Item{backdrop[i], session.scene().backdrop[i].placement});
        made.lighting = std::move(*lighting);
    }
    return items;
}

// One for all pictures of the view, so that their depths compare.
Result<double> LevelPictures::Impl::near_plane(const std::vector<std::size_t>& objects,
                                               const std::vector<render::Item>& background,
                                               const vdtree::View& view) const {
    std::vector<render::Item> all = background;
    for (const std::size_t object : objects)
        all.push_back({levels[object]->cuts.front(), session.scene().objects[object].placement});
    return render::near_plane(all, view);
}

Result<LevelPictures::Impl::Drawn> LevelPictures::Impl::draw(const std::vector<render::Item>& items,
                                                             const vdtree::View& view, double near) {
    const auto start = vdtree::Clock::now();
    if (auto drawn = render::draw(items, {.view = view, .near_plane = near}, *target,
                                  {.colour = glm::vec4(session.background())});
        !drawn)
        return drawn.error();
    times.draw_ms += vdtree::ms_since(start);
    ++times.drawings;
    const auto read_start = vdtree::Clock::now();
    auto pixels = render::read_pixels(*target);
    if (!pixels) return pixels.error();
    auto depth = render::read_depth(*target);
    if (!depth) return depth.error();
    times.read_ms += vdtree::ms_since(read_start);
    return Drawn{std::move(*pixels), std::move(*depth)};
}

float LevelPictures::Impl::value_of(float luminance, SelectionQuality quality) const {
    const perception::Display& display = session.observer().display;
    const auto relative = static_cast<double>(luminance);
    if (quality != SelectionQuality::ssim)
        return static_cast<float>(perception::to_luminance(display, relative).value());
    return static_cast<float>(std::round(255 * std::clamp(perception::encode(display, relative), 0.0, 1.0)));
}

Result<LayeredPicture> LevelPictures::draw(const vdtree::View& view, SelectionQuality quality) {
    if (auto valid = vdtree::validate_perspective(view, "A search for levels"); !valid) return valid.error();
    Impl& own = *impl_;
    if (auto made = own.need_target(view); !made) return made.error();
    std::vector<std::size_t> objects;
    for (std::size_t i = 0; i < own.spheres.size(); ++i)
        if (is_in_sight(own.spheres[i], view)) objects.push_back(i);
    const auto background = own.backdrop_items(view);
    if (!background) return background.error();
    const auto near = own.near_plane(objects, *background, view);
    if (!near) return near.error();
    LayeredPicture picture;
    picture.width = view.width, picture.height = view.height;
    auto behind = own.draw(*background, view, *near);
    if (!behind) return behind.error();
    picture.background_depth = std::move(behind->depth);
    float last = -1, last_value = 0; // most of it is one value
    for (const glm::vec4& pixel : behind->pixels) {
        if (pixel.a != last) last = pixel.a, last_value = own.value_of(last, quality);
        picture.background.push_back(last_value);
    }
    for (const std::size_t object : objects) {
        ObjectImages images;
        images.object = object;
        images.triangles = own.triangles[object];
        bool is_there = false;
        for (int level = 0; level < own.levels[object]->chain.size(); ++level) {
            const auto item = own.item(object, level, view);
            if (!item) return item.error();
            const auto drawn = own.draw({*item}, view, *near);
            if (!drawn) return drawn.error();
            own.times.triangles += images.triangles[static_cast<std::size_t>(level)];
            LevelImage& image = images.levels.emplace_back();
            for (int y = 0; y < view.height; ++y) {
                const float* const row =
                    drawn->depth.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(view.width);
                const float* const end = row + view.width;
                const float* const first = std::find_if(row, end, [](float d) { return d > 0; });
                if (first == end) continue;
                const float* after = end;
                while (!(after[-1] > 0)) --after;
                image.box = united(image.box, {static_cast<int>(first - row), y, static_cast<int>(after - row), y + 1});
            }
            for (int y = image.box.top; y < image.box.bottom; ++y)
                for (int x = image.box.left; x < image.box.right; ++x) {
                    const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(view.width) +
                                           static_cast<std::size_t>(x);
                    const bool covers = drawn->depth[at] > 0;
                    image.depth.push_back(drawn->depth[at]);
                    image.values.push_back(covers ? own.value_of(drawn->pixels[at].a, quality) : 0);
                }
            is_there = is_there || !image.box.is_empty();
        }
        if (is_there) picture.objects.push_back(std::move(images));
    }
    return picture;
}

Result<render::Frame> LevelPictures::draw_frame(const vdtree::View& view, std::span<const int> levels, int samples) {
    if (auto valid = vdtree::validate_perspective(view, "A search for levels"); !valid) return valid.error();
    Impl& own = *impl_;
    if (levels.size() != own.levels.size())
        return invalid_argument("There are " + std::to_string(own.levels.size()) + " objects, and levels for " +
                                std::to_string(levels.size()) + ".");
    std::vector<render::Item> items;
    for (std::size_t i = 0; i < levels.size(); ++i) {
        if (levels[i] < 0) continue;
        if (levels[i] >= own.levels[i]->chain.size())
            return invalid_argument("Object " + std::to_string(i) + " has no level " + std::to_string(levels[i]) + ".");
        auto item = own.item(i, levels[i], view);
        if (!item) return item.error();
        items.push_back(std::move(*item));
    }
    const auto background = own.backdrop_items(view);
    if (!background) return background.error();
    items.insert(items.end(), background->begin(), background->end());
    auto& sum = own.sum;
    if (!sum || sum->width() != view.width || sum->height() != view.height) {
        sum.reset(); // the old one first, so that both sizes need not fit at a time
        auto made = render::SampleSum::create(own.context, view.width, view.height);
        if (!made) return made.error();
        sum = std::move(*made);
    }
    const auto start = vdtree::Clock::now();
    if (auto drawn = sum->draw(items, view, {.samples = samples, .background = own.session.background()}); !drawn)
        return drawn.error();
    const auto pixels = sum->mean();
    if (!pixels) return pixels.error();
    render::Frame frame;
    frame.draw_ms = vdtree::ms_since(start);
    frame.width = view.width, frame.height = view.height;
    for (const glm::vec4& pixel : *pixels) {
        frame.luminance.push_back(pixel.a);
        frame.colour.insert(frame.colour.end(), {pixel.r, pixel.g, pixel.b});
    }
    return frame;
}

float LevelPictures::value_of(float luminance, SelectionQuality quality) const {
    return impl_->value_of(luminance, quality);
}

const std::vector<std::vector<std::uint32_t>>& LevelPictures::triangles() const noexcept { return impl_->triangles; }
const LevelChain& LevelPictures::chain(std::size_t object) const noexcept { return impl_->levels[object]->chain; }
const LevelPictureTimes& LevelPictures::times() const noexcept { return impl_->times; }

Result<LevelPictures> LevelPictures::create(const render::Context& context, Session& session, int levels) {
    auto impl = std::make_unique<Impl>(context, session);
    if (auto loaded = impl->load(levels); !loaded) return loaded.error();
    return LevelPictures(std::move(impl));
}

LevelPictures::LevelPictures(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
LevelPictures::LevelPictures(LevelPictures&&) noexcept = default;
LevelPictures& LevelPictures::operator=(LevelPictures&&) noexcept = default;
LevelPictures::~LevelPictures() = default;

} // namespace unseen::session
