#include <unseen/session_gpu/internal/level_pictures.h>

#include <algorithm>
#include <cmath>

#include <unseen/render/internal/frame.h>
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

namespace {

// Pixels a side of the sheet that pictures are drawn to, unless the window is larger: of dozens of small ones.
constexpr int sheet_side = 1024;

// Places for pictures on a sheet: in rows, from the left.
class SheetRows {
public:
    SheetRows(int width, int height) : width_(width), height_(height) {}

    // The top left; none: there is no place left.
    std::optional<glm::ivec2> place(int width, int height) {
        if (left_ + width > width_) left_ = 0, top_ = bottom_;
        if (left_ + width > width_ || top_ + height > height_) return {};
        const glm::ivec2 at(left_, top_);
        left_ += width;
        bottom_ = std::max(bottom_, top_ + height);
        return at;
    }
    int used() const { return bottom_; } // pixels from the top

private:
    int width_, height_;
    int left_ = 0, top_ = 0, bottom_ = 0; // of the row that is being filled
};

// The image in the rectangle of what it shows alone.
LevelImage trimmed(const LevelImage& image) {
    const auto width = static_cast<std::size_t>(image.box.width());
    LevelImage result;
    for (int y = 0; y < image.box.height(); ++y) {
        const float* const row = image.depth.data() + static_cast<std::size_t>(y) * width;
        const float* const end = row + width;
        const float* const first = std::find_if(row, end, [](float d) { return d > 0; });
        if (first == end) continue;
        const float* after = end;
        while (!(after[-1] > 0)) --after;
        const int left = image.box.left, top = image.box.top + y;
        result.box = united(result.box,
                            {left + static_cast<int>(first - row), top, left + static_cast<int>(after - row), top + 1});
    }
    for (int y = result.box.top; y < result.box.bottom; ++y) {
        const std::size_t row = static_cast<std::size_t>(y - image.box.top) * width;
        for (int x = result.box.left; x < result.box.right; ++x) {
            const std::size_t at = row + static_cast<std::size_t>(x - image.box.left);
            result.depth.push_back(image.depth[at]);
            result.values.push_back(image.values[at]);
        }
    }
    return result;
}

} // namespace

struct LevelPictures::Impl {
    // A picture on the sheet that has not come back yet.
    struct Placed {
        LevelImage* image; // its box is that of the tile
        glm::ivec2 at;
        bool is_trimmed; // to what it shows alone
    };

    Impl(const render::Context& context_, Session& session_)
        : context(context_), session(session_.share()), uploads(context_) {}

    Result<void> load(int level_count) {
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
        return backdrop.load(scene, uploads);
    }

    Result<void> need_sheet(const vdtree::View& view) {
        const int width = std::max(view.width, sheet_side), height = std::max(view.height, sheet_side);
        if (sheet && sheet->width() == width && sheet->height() == height) return {};
        sheet.reset();
        auto made = render::Target::create(context, width, height, {.label = "level pictures"});
        if (!made) return made.error();
        sheet = std::move(*made);
        return {};
    }

    Result<render::Item> item(std::size_t object, int level, const vdtree::View& view) const {
        return lit_item(session, object, levels[object]->cuts[static_cast<std::size_t>(level)], view);
    }

    // One for all pictures of the view, so that their depths compare.
    Result<double> near_plane(const std::vector<std::size_t>& objects, const std::vector<render::Item>& background,
                              const vdtree::View& view) const {
        std::vector<render::Item> all = background;
        for (const std::size_t object : objects)
            all.push_back({levels[object]->cuts.front(), session.scene().objects[object].placement});
        return render::near_plane(all, view);
    }

    Result<void> clear_sheet() {
        rows = SheetRows(sheet->width(), sheet->height());
        placed.clear();
        vdtree::View whole;
        whole.width = sheet->width(), whole.height = sheet->height();
        return render::draw({}, {.view = whole}, *sheet, {.colour = glm::vec4(session.background())});
    }

    // Draws a part of the view's window to a place on the sheet. The image gets its box now, and the rest when the sheet is
    // read, until which it must stay where it is.
    Result<void> draw(std::span<const render::Item> items, const vdtree::View& view, double near,
                      const render::PixelBox& part, LevelImage& image, bool is_trimmed = true) {
        image.box = {part.left, part.top, part.left + part.width, part.top + part.height};
        if (image.box.is_empty()) return {};
        auto at = rows.place(part.width, part.height);
        if (!at) {
            if (auto read = read_sheet(); !read) return read;
            if (auto cleared = clear_sheet(); !cleared) return cleared;
            at = rows.place(part.width, part.height); // no part is larger than the sheet
        }
        const auto start = vdtree::Clock::now();
        const render::Camera camera{.view = view, .near_plane = near, .tile = render::Tile{part, at->x, at->y}};
        if (auto drawn = render::draw(items, camera, *sheet, {.colour = {}, .depth = false}); !drawn) return drawn;
        times.draw_ms += vdtree::ms_since(start);
        ++times.drawings;
        placed.push_back({&image, *at, is_trimmed});
        return {};
    }

    // The images get luminance for values.
    Result<void> read_sheet() {
        if (placed.empty()) return {};
        const auto start = vdtree::Clock::now();
        const render::PixelBox used{0, 0, sheet->width(), rows.used()};
        const auto pixels = render::read_pixels(*sheet, 0, used);
        if (!pixels) return pixels.error();
        const auto depth = render::read_depth(*sheet, used);
        if (!depth) return depth.error();
        for (const auto& [image, at, is_trimmed] : placed) {
            for (int y = 0; y < image->box.height(); ++y) {
                const auto row = (static_cast<std::size_t>(at.y) + static_cast<std::size_t>(y)) *
                                     static_cast<std::size_t>(used.width) +
                                 static_cast<std::size_t>(at.x);
                for (std::size_t i = row; i < row + static_cast<std::size_t>(image->box.width()); ++i) {
                    image->values.push_back((*pixels)[i].a);
                    image->depth.push_back((*depth)[i]);
                }
            }
            if (is_trimmed) *image = trimmed(*image);
        }
        placed.clear();
        times.read_ms += vdtree::ms_since(start);
        return {};
    }

    float value_of(float luminance, SelectionQuality quality) const {
        const perception::Display& display = session.observer().display;
        const auto relative = static_cast<double>(luminance);
        if (quality != SelectionQuality::ssim)
            return static_cast<float>(perception::to_luminance(display, relative).value());
        return static_cast<float>(std::round(255 * std::clamp(perception::encode(display, relative), 0.0, 1.0)));
    }

    render::Context context;
    Session session;
    SharedUploads uploads;
    std::vector<const UploadedLevels*> levels; // by object
    std::vector<WorldSphere> spheres;          // by object
    std::vector<std::vector<std::uint32_t>> triangles;
    UploadedBackdrop backdrop;
    std::optional<render::Target> sheet;
    SheetRows rows{0, 0};
    std::vector<Placed> placed;
    std::optional<render::SampleSum> sum; // of frames, for each of another size
    Times times;
};

Result<LayeredPicture> LevelPictures::draw(const vdtree::View& view, SelectionQuality quality) {
    if (auto valid = vdtree::validate_perspective(view, "A search for levels"); !valid) return valid.error();
    Impl& own = *impl_;
    if (auto made = own.need_sheet(view); !made) return made.error();
    std::vector<std::size_t> objects;
    for (std::size_t i = 0; i < own.spheres.size(); ++i)
        if (is_in_sight(own.spheres[i], view)) objects.push_back(i);
    const auto background = own.backdrop.items(own.session, view);
    if (!background) return background.error();
    const auto near = own.near_plane(objects, *background, view);
    if (!near) return near.error();
    LayeredPicture picture;
    picture.width = view.width, picture.height = view.height;
    if (auto cleared = own.clear_sheet(); !cleared) return cleared.error();
    LevelImage behind;
    if (auto drawn = own.draw(*background, view, *near, {0, 0, view.width, view.height}, behind, false); !drawn)
        return drawn.error();
    picture.objects.reserve(objects.size());
    for (const std::size_t object : objects) {
        const auto& cuts = own.levels[object]->cuts;
        ObjectImages& images = picture.objects.emplace_back();
        images.object = object;
        images.triangles = own.triangles[object];
        images.levels.resize(cuts.size());
        for (std::size_t level = 0; level < cuts.size(); ++level) {
            const auto item = own.item(object, static_cast<int>(level), view);
            if (!item) return item.error();
            const auto part = render::pixels_of({&*item, 1}, view);
            if (!part) return part.error();
            if (auto drawn = own.draw({&*item, 1}, view, *near, *part, images.levels[level]); !drawn)
                return drawn.error();
            if (!images.levels[level].box.is_empty()) own.times.triangles += images.triangles[level];
        }
    }
    if (auto read = own.read_sheet(); !read) return read.error();

    picture.background_depth = std::move(behind.depth);
    float last = -1, last_value = 0; // most of it is one value
    for (const float luminance : behind.values) {
        if (luminance != last) last = luminance, last_value = own.value_of(last, quality);
        picture.background.push_back(last_value);
    }
    for (ObjectImages& images : picture.objects)
        for (LevelImage& image : images.levels)
            for (std::size_t i = 0; i < image.values.size(); ++i)
                image.values[i] = image.depth[i] > 0 ? own.value_of(image.values[i], quality) : 0;
    std::erase_if(picture.objects, [](const ObjectImages& images) {
        return std::ranges::all_of(images.levels, [](const LevelImage& image) { return image.box.is_empty(); });
    });
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
    const auto background = own.backdrop.items(own.session, view);
    if (!background) return background.error();
    items.insert(items.end(), background->begin(), background->end());
    return render::draw_frame(own.sum, own.context, items, view,
                              {.samples = samples, .background = own.session.background()});
}

float LevelPictures::value_of(float luminance, SelectionQuality quality) const {
    return impl_->value_of(luminance, quality);
}

const std::vector<std::vector<std::uint32_t>>& LevelPictures::triangles() const noexcept { return impl_->triangles; }
const LevelChain& LevelPictures::chain(std::size_t object) const noexcept { return impl_->levels[object]->chain; }
const LevelPictures::Times& LevelPictures::times() const noexcept { return impl_->times; }

Result<LevelPictures> LevelPictures::create(const render::Context& context, Session& session, int levels) {
    auto impl = std::make_unique<Impl>(context, session);
    if (auto loaded = impl->load(levels); !loaded) return loaded.error();
    return LevelPictures(std::move(impl));
}

} // namespace unseen::session
