// The surface is drawn again where its depth is, and what looks like the picture is dropped. Nothing is written.
#include <unseen/render/internal/difference_count.h>

#include <deque>
#include <string>

#include <unseen/vdtree/internal/errors.h>

#include "gl.h"
#include "luminance_texture.h"
#include "surface_pass.h"

namespace unseen::render {
namespace {

constexpr GLuint picture_unit = 14, thresholds_unit = 15; // of compare.frag

} // namespace

struct DifferenceCounts::Impl {
    Impl(const Context& context_, Target depth_) : context(context_), depth(std::move(depth_)) {}
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;
    ~Impl() {
        if (!context.make_current()) return; // for the objects, which go next
        for (const Open& count : open) free.push_back(count.query);
        glDeleteQueries(static_cast<GLsizei>(free.size()), free.data());
    }

    Result<void> begin(const Item& item, const LuminanceTexture& picture, const ThresholdTexture& thresholds);

    struct Open {
        std::uint64_t name = 0;
        GLuint query = 0;
    };
    Context context; // first, and so gone last
    Target depth;
    std::optional<Camera> camera; // of the depth that was drawn
    std::deque<Open> open;
    std::vector<GLuint> free;
    std::uint64_t last_name = 0;
};

Result<void> DifferenceCounts::Impl::begin(const Item& item, const LuminanceTexture& picture,
                                           const ThresholdTexture& thresholds) {
    if (auto ok = check_texture(picture); !ok) return ok;
    if (picture.width != depth.width() || picture.height != depth.height())
        return invalid_argument("The picture to compare with is of " + size_text(picture.width, picture.height) +
                                " pixels, and the depth of " + size_text(depth.width(), depth.height()) + ".");
    if (thresholds.block < 1) return invalid_argument("A threshold is of a block of at least 1x1 pixels.");
    const auto blocks = [&](int pixels) { return (pixels + thresholds.block - 1) / thresholds.block; };
    if (auto ok =
            check_texture({.id = thresholds.id, .width = blocks(depth.width()), .height = blocks(depth.height())});
        !ok)
        return ok;
    const auto pass =
        SurfacePass::prepare(std::span<const Item>(&item, 1), *camera, depth.impl(), 0, SurfacePass::Use::comparison);
    if (!pass) return pass.error();
    GLuint query = 0;
    if (free.empty()) {
        glCreateQueries(GL_SAMPLES_PASSED, 1, &query);
    } else {
        query = free.back();
        free.pop_back();
    }
    glBindTextureUnit(picture_unit, picture.id);
    glBindTextureUnit(thresholds_unit, thresholds.id);
    glBeginQuery(GL_SAMPLES_PASSED, query);
    pass->compare(depth.impl(), camera->point, glm::vec4(picture.channel, picture.scale, thresholds.block, 0));
    glEndQuery(GL_SAMPLES_PASSED);
    glBindTextureUnit(picture_unit, 0);
    glBindTextureUnit(thresholds_unit, 0);
    open.push_back({++last_name, query});
    return {};
}

DifferenceCounts::DifferenceCounts(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
DifferenceCounts::DifferenceCounts(DifferenceCounts&&) noexcept = default;
DifferenceCounts& DifferenceCounts::operator=(DifferenceCounts&&) noexcept = default;
DifferenceCounts::~DifferenceCounts() = default;

Result<DifferenceCounts> DifferenceCounts::create(const Context& context, int width, int height) {
    auto depth = Target::create(context, width, height, {.colours = {}, .label = "depth to compare at"});
    if (!depth) return depth.error();
    return DifferenceCounts(std::make_unique<Impl>(context, std::move(*depth)));
}

Result<void> DifferenceCounts::draw_depth(std::span<const Item> items, const Camera& camera) {
    impl_->camera.reset();
    Camera own = camera;
    if (!own.near_plane) {
        const auto near = near_plane(items, own.view);
        if (!near) return near.error();
        own.near_plane = *near;
    }
    if (auto drawn = draw(items, own, impl_->depth, {.colour = std::nullopt}); !drawn) return drawn;
    impl_->camera = own;
    return {};
}

Result<std::uint64_t> DifferenceCounts::begin(const Item& item, const LuminanceTexture& picture,
                                              const ThresholdTexture& thresholds) {
    if (!impl_->camera) return invalid_argument("Pixels are counted where depth was drawn before: call draw_depth().");
    auto done =
        in_context(impl_->context, "Counting differences", [&] { return impl_->begin(item, picture, thresholds); });
    if (!done) return done.error();
    return impl_->last_name;
}

Result<std::vector<DifferenceCounts::Count>> DifferenceCounts::take() {
    std::vector<Count> counts;
    auto done = in_context(impl_->context, "Reading counts", [&]() -> Result<void> {
        while (!impl_->open.empty()) {
            const Impl::Open& first = impl_->open.front();
            GLuint is_there = GL_FALSE;
            glGetQueryObjectuiv(first.query, GL_QUERY_RESULT_AVAILABLE, &is_there);
            if (is_there == GL_FALSE) break;
            GLuint64 pixels = 0;
            glGetQueryObjectui64v(first.query, GL_QUERY_RESULT, &pixels);
            counts.push_back({first.name, pixels});
            impl_->free.push_back(first.query);
            impl_->open.pop_front();
        }
        return {};
    });
    if (!done) return done.error();
    return counts;
}

int DifferenceCounts::open_counts() const noexcept { return static_cast<int>(impl_->open.size()); }

} // namespace unseen::render
