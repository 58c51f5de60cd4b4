// Layers are slices of array textures, so that one pass reads any number of them.
#include <unseen/render/internal/layers.h>

#include <algorithm>
#include <cmath>

#include <unseen/vdtree/internal/errors.h>

#include "shaders.h"
#include "surface_pass.h"

namespace unseen::render {
namespace {

// Largest ratio of the farthest to the nearest centre's distance: nearer planes would divide what touches the eye.
constexpr double largest_ratio = 1e3;

constexpr int counts_location = 0; // of combine.frag

Result<void> check_layers(int layers) {
    if (layers >= 1 && layers <= most_layers) return {};
    return invalid_argument("A picture is split into 1 to " + std::to_string(most_layers) + " layers, not " +
                            std::to_string(layers) + ".");
}

} // namespace

Result<LayerSplit> split_into_layers(std::span<const glm::dvec3> centres, const vdtree::View& view, int layers) {
    if (auto valid = check_layers(layers); !valid) return valid.error();
    if (auto valid = vdtree::validate_perspective(view, "A split into layers"); !valid) return valid.error();
    const glm::dvec3 back = vdtree::camera_frame(view).back;
    std::vector<double> depths;
    double nearest = 0, farthest = 0;
    for (std::size_t i = 0; i < centres.size(); ++i) {
        const double depth = glm::dot(view.eye - centres[i], back);
        if (!std::isfinite(depth))
            return invalid_argument("Object " + std::to_string(i) +
                                    " cannot be put into a layer: its centre is not finite.");
        depths.push_back(depth);
        if (!(depth > 0)) continue;
        nearest = nearest > 0 ? std::min(nearest, depth) : depth;
        farthest = std::max(farthest, depth);
    }
    LayerSplit split;
    split.layer_of.assign(centres.size(), 0);
    if (!(farthest > nearest)) return split;
    nearest = std::max(nearest, farthest / largest_ratio);
    const double factor = std::log(farthest / nearest) / layers;
    std::vector<int> occupied(static_cast<std::size_t>(layers), 0);
    for (std::size_t i = 0; i < depths.size(); ++i) {
        const double steps = depths[i] > nearest ? std::log(depths[i] / nearest) / factor : 0;
        split.layer_of[i] = std::min(static_cast<int>(steps), layers - 1);
        occupied[static_cast<std::size_t>(split.layer_of[i])] = 1;
    }
    std::vector<int> number(occupied.size(), 0);
    for (std::size_t i = 0; i < occupied.size(); ++i) {
        number[i] = split.count;
        if (occupied[i] == 0) continue;
        if (split.count > 0) split.borders.push_back(nearest * std::exp(factor * static_cast<double>(i)));
        ++split.count;
    }
    for (int& layer : split.layer_of) layer = number[static_cast<std::size_t>(layer)];
    if (split.count > 1) return split;
    split.count = 0;
    split.borders.clear();
    return split;
}

struct LayerPasses::Impl {
    Impl(const Context& context_, Target composite_, Target combination_, int most_)
        : context(context_), most(most_), composite(std::move(composite_)), combination(std::move(combination_)),
          guard(context_) {}

    struct Slice {
        FramebufferObject framebuffer; // outlives the target
        Target target;
    };

    // One framebuffer a slice: the slices are made at once, for textures do not grow.
    Result<void> need_slices(int count) {
        if (slices.size() >= static_cast<std::size_t>(count)) return {};
        slices.clear();
        const int width = composite.width(), height = composite.height();
        colours = Texture2dArray::create("layers");
        depths = Texture2dArray::create("depths of layers");
        glTextureStorage3D(colours.id(), 1, GL_RGBA32F, width, height, count);
        glTextureStorage3D(depths.id(), 1, GL_DEPTH_COMPONENT32F, width, height, count);
        for (int i = 0; i < count; ++i) {
            FramebufferObject framebuffer = FramebufferObject::create(i == 0 ? "background" : "layer");
            const GLuint id = framebuffer.id();
            glNamedFramebufferTextureLayer(id, GL_COLOR_ATTACHMENT0, colours.id(), 0, i);
            glNamedFramebufferTextureLayer(id, GL_DEPTH_ATTACHMENT, depths.id(), 0, i);
            if (glCheckNamedFramebufferStatus(id, GL_DRAW_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
                slices.clear();
                return unsupported(
                    "A picture of " + std::to_string(width) + "x" + std::to_string(height) +
                    " pixels cannot be split into " + std::to_string(count - 1) +
                    " layers: the graphics memory does not suffice; choose fewer layers, or a smaller size.");
            }
            auto target = Target::foreign(context, width, height, {id, false, true});
            if (!target) {
                slices.clear();
                return target.error();
            }
            slices.push_back({std::move(framebuffer), std::move(*target)});
        }
        return {};
    }

    Result<void> draw_slice(std::size_t slice, std::span<const Item> items, const glm::vec4& cleared) {
        Target& target = slices[slice].target;
        ++done.surface_passes;
        return render::draw(items, camera, target, {.colour = cleared});
    }

    // Which share of its light comes to each of the layer's surfaces, and where these are.
    Result<void> draw_mask(int left_out, const Shadows& cast_by_others) {
        if (!mask) {
            auto made = Target::create(context, composite.width(), composite.height(), {.label = "mask of shadows"});
            if (!made) return made.error();
            mask = std::move(*made);
        }
        std::vector<Item> items;
        for (std::size_t i = 0; i < objects.size(); ++i)
            if (layer_of[i] == left_out) items.push_back(objects[i]);
        Camera own = camera;
        own.shadows = &cast_by_others;
        own.shadow_mask.reset();
        const auto pass = SurfacePass::prepare(items, own, mask->impl(), 0, SurfacePass::Use::share_of_light);
        if (!pass) return pass.error();
        pass->draw(mask->impl(), own.point, {.colour = glm::vec4(1)});
        ++done.surface_passes;
        ++done.mask_passes;
        return {};
    }

    Result<void> put_together(int left_out, const Target& to, const Target* masked_by = nullptr) {
        Programs& programs = context.impl().programs;
        const auto found = masked_by ? programs.full_screen("combine masked", shaders::combine_frag, {"MASKED"})
                                     : programs.full_screen("combine", shaders::combine_frag);
        if (!found) return found.error();
        const Program& program = **found;
        set_fixed_state(to.impl());
        disable({GL_DEPTH_TEST, GL_CULL_FACE, GL_BLEND});
        to.impl().bind(0);
        glBindTextureUnit(0, colours.id());
        glBindTextureUnit(1, depths.id());
        if (masked_by) {
            glBindTextureUnit(2, masked_by->colour_texture());
            glBindTextureUnit(3, masked_by->depth_texture());
        }
        program.set(counts_location, glm::ivec2(layer_count, left_out));
        programs.draw_full_screen(program);
        for (GLuint unit = 0; unit < 4; ++unit) glBindTextureUnit(unit, 0);
        ++done.full_screen_passes;
        return {};
    }

    Context context; // first, and so gone last
    int most;        // layers
    Target composite, combination;
    Texture2dArray colours, depths;
    std::optional<Target> mask; // made when a combination first has one
    std::vector<Slice> slices;  // the background, then layers

    // From the last draw.
    Camera camera;
    std::vector<Item> objects; // for masks
    std::vector<int> layer_of; // by object
    std::vector<Item> behind;  // the background, for combinations of scenes without layers
    glm::vec4 clear = glm::vec4(0);
    int layer_count = 0, combinations = 0;
    bool has_background = false; // in its slice
    bool is_masked = false;      // the last combination
    LayerCounts done;
    ContextGuard guard;
};

Result<LayerPasses> LayerPasses::create(const Context& context, int width, int height, int most) {
    if (auto valid = check_layers(most); !valid) return valid.error();
    auto composite = Target::create(context, width, height, {.label = "composite"});
    if (!composite) return composite.error();
    auto combination = Target::create(context, width, height, {.depth = false, .label = "combination"});
    if (!combination) return combination.error();
    return LayerPasses(std::make_unique<Impl>(context, std::move(*composite), std::move(*combination), most));
}

Result<void> LayerPasses::draw(std::span<const Item> objects, std::span<const Item> background, const Camera& camera,
                               const LayerSplit& split, const glm::vec4& clear) {
    Impl& own = *impl_;
    own.done = {};
    own.layer_count = own.combinations = 0;
    own.has_background = own.is_masked = false;
    if (split.layer_of.size() != objects.size())
        return invalid_argument("The layers are of " + std::to_string(split.layer_of.size()) + " objects, not of " +
                                std::to_string(objects.size()) + ".");
    if (split.count > own.most)
        return invalid_argument("The objects are in " + std::to_string(split.count) + " layers, and there are only " +
                                std::to_string(own.most) + ".");
    const auto is_none = [&](int layer) { return layer < 0 || layer >= std::max(split.count, 1); };
    if (std::ranges::any_of(split.layer_of, is_none)) return invalid_argument("An object is in a layer that is none.");
    std::vector<Item> all(objects.begin(), objects.end());
    all.insert(all.end(), background.begin(), background.end());
    own.camera = camera;
    if (!camera.near_plane) {
        const auto near = render::near_plane(all, camera.view);
        if (!near) return near.error();
        own.camera.near_plane = *near;
    }
    own.behind.assign(background.begin(), background.end());
    own.objects.assign(objects.begin(), objects.end());
    own.layer_of = split.layer_of;
    own.clear = clear;
    return in_context(own.context, "Drawing layers", [&]() -> Result<void> {
        if (split.count == 0) {
            ++own.done.surface_passes;
            if (auto drawn = render::draw(all, own.camera, own.composite, {.colour = clear}); !drawn) return drawn;
            own.combinations = objects.empty() ? 0 : 1;
            return {};
        }
        if (auto made = own.need_slices(own.most + 1); !made) return made;
        if (auto drawn = own.draw_slice(0, background, clear); !drawn) return drawn;
        own.has_background = true;
        std::vector<Item> items;
        for (int layer = 0; layer < split.count; ++layer) {
            items.clear();
            for (std::size_t i = 0; i < objects.size(); ++i)
                if (split.layer_of[i] == layer) items.push_back(objects[i]);
            if (auto drawn = own.draw_slice(static_cast<std::size_t>(layer) + 1, items, glm::vec4(0)); !drawn)
                return drawn;
        }
        own.layer_count = own.combinations = split.count;
        return own.put_together(-1, own.composite);
    });
}

Result<void> LayerPasses::combine(int left_out, const Shadows* cast_by_others) {
    Impl& own = *impl_;
    if (left_out < 0 || left_out >= own.combinations)
        return invalid_argument("There is no layer " + std::to_string(left_out) + " to leave out, only " +
                                std::to_string(own.combinations) + ".");
    return in_context(own.context, "Combining layers", [&]() -> Result<void> {
        if (!own.has_background) { // the scene was drawn at once
            if (auto made = own.need_slices(1); !made) return made;
            if (auto drawn = own.draw_slice(0, own.behind, own.clear); !drawn) return drawn;
            own.has_background = true;
        }
        own.is_masked = false;
        if (cast_by_others) {
            if (auto drawn = own.draw_mask(left_out, *cast_by_others); !drawn) return drawn;
            own.is_masked = true;
        }
        return own.put_together(own.layer_count == 0 ? -1 : left_out, own.combination,
                                own.is_masked ? &*own.mask : nullptr);
    });
}

int LayerPasses::combination_count() const noexcept { return impl_->combinations; }
const Target& LayerPasses::composite() const noexcept { return impl_->composite; }
const Target& LayerPasses::combination() const noexcept { return impl_->combination; }
double LayerPasses::near_plane() const noexcept { return impl_->camera.near_plane.value_or(1); }

const Target* LayerPasses::mask() const noexcept { return impl_->is_masked ? &*impl_->mask : nullptr; }

LayerCounts LayerPasses::counts() const noexcept {
    LayerCounts counts = impl_->done;
    const auto pixels = [](const Target& t) {
        return static_cast<std::uint64_t>(t.width()) * static_cast<std::uint64_t>(t.height());
    };
    constexpr std::uint64_t colour = 16; // bytes a pixel
    counts.textures = 3;
    counts.texture_bytes = pixels(impl_->composite) * (colour + 4) + pixels(impl_->combination) * colour;
    if (!impl_->slices.empty()) {
        counts.textures += 2;
        counts.texture_bytes += impl_->slices.size() * pixels(impl_->composite) * (colour + 4);
    }
    if (impl_->mask) {
        counts.textures += 2;
        counts.texture_bytes += pixels(*impl_->mask) * (colour + 4);
    }
    return counts;
}

} // namespace unseen::render
