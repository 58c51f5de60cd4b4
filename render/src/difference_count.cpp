// The surface is drawn again where its depth is, and what looks like the picture is dropped. Nothing is written.
#include <unseen/render/internal/difference_count.h>

#include <deque>

#include <unseen/vdtree/internal/errors.h>

#include "gpu_plane.h"
#include "query_pool.h"
#include "surface_pass.h"

namespace unseen::render {
namespace {

constexpr GLuint picture_unit = 14, thresholds_unit = 15; // of compare.frag

} // namespace

struct DifferenceCounts::Impl {
    Impl(const Context& context_, Target depth_)
        : context(context_), depth(std::move(depth_)), queries(context_, GL_SAMPLES_PASSED) {}

    Result<std::uint64_t> begin(const Item& item, const LuminanceTexture& picture, unsigned thresholds) {
        if (auto ok = check_texture(picture); !ok) return ok.error();
        if (picture.width != depth.width() || picture.height != depth.height())
            return invalid_argument("The picture to compare with is of " + size_text(picture.width, picture.height) +
                                    " pixels, and the depth of " + size_text(depth.width(), depth.height()) + ".");
        if (auto ok = check_texture({.id = thresholds, .width = depth.width(), .height = depth.height()}); !ok)
            return ok.error();
        const auto pass = SurfacePass::prepare(std::span<const Item>(&item, 1), *camera, depth.impl(), 0,
                                               SurfacePass::Use::comparison);
        if (!pass) return pass.error();
        const GLuint query = queries.take();
        glBindTextureUnit(picture_unit, picture.id);
        glBindTextureUnit(thresholds_unit, thresholds);
        glBeginQuery(GL_SAMPLES_PASSED, query);
        pass->compare(depth.impl(), camera->point, glm::vec4(picture.channel, picture.scale, 0, 0));
        glEndQuery(GL_SAMPLES_PASSED);
        glBindTextureUnit(picture_unit, 0);
        glBindTextureUnit(thresholds_unit, 0);
        open.push_back({++last_name, query});
        return last_name;
    }

    struct Open {
        std::uint64_t name = 0;
        GLuint query = 0;
    };
    Context context;
    Target depth;
    QueryPool queries;
    std::optional<Camera> camera; // of the depth that was drawn
    std::deque<Open> open;
    std::uint64_t last_name = 0;
};

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

Result<std::uint64_t> DifferenceCounts::begin(const Item& item, const LuminanceTexture& picture, unsigned thresholds) {
    if (!impl_->camera) return invalid_argument("Pixels are counted where depth was drawn before: call draw_depth().");
    return in_context(impl_->context, "Counting differences", [&] { return impl_->begin(item, picture, thresholds); });
}

Result<std::vector<DifferenceCounts::Count>> DifferenceCounts::take() {
    return in_context(impl_->context, "Reading counts", [&] {
        std::vector<Count> counts;
        for (auto& open = impl_->open; !open.empty() && is_there(open.front().query); open.pop_front()) {
            counts.push_back({open.front().name, result_of(open.front().query)});
            impl_->queries.put_back(open.front().query);
        }
        return counts;
    });
}

} // namespace unseen::render
