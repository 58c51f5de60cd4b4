#include "surface_pass.h"

#include <algorithm>
#include <cmath>

#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/light_bounds.h>

namespace unseen::render {
namespace {

constexpr float brightest_light = 1e6f; // times white: far beyond what shows any texel

enum UniformLocation {
    clip_from_unit_location = 0,
    lowest_shade_location = 1,
    highest_shade_location = 2,
    material_location = 4,
    eye_location = 5,
    lights_location = 6,
    whitest_shade_location = 62,
    layers_location = 64,
    shadow_lights_location = 96,
    shadow_kinds_location = 100,
    world_from_unit_location = 104,
    compared_location = 110,
    stipple_location = 111,
    baked_light_location = 112,
    baked_fill_location = 113,
};

bool is_finite(glm::dvec3 v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

bool is_finite(glm::dquat q) { return std::isfinite(q.w) && is_finite(glm::dvec3(q.x, q.y, q.z)); }

bool fits_float(const glm::dmat4& matrix) {
    for (int column = 0; column < 4; ++column)
        for (int row = 0; row < 4; ++row)
            if (!std::isfinite(static_cast<float>(matrix[column][row]))) return false;
    return true;
}

Result<void> check(const vdtree::Similarity& placement) {
    if (!(placement.scale > 0) || !std::isfinite(placement.scale))
        return invalid_argument("The placement's scale must be positive and finite, not " +
                                std::to_string(placement.scale) + ".");
    if (!is_finite(placement.rotation) || !is_finite(placement.translation))
        return invalid_argument("The placement's rotation and translation must be finite.");
    return {};
}

Result<void> check(const Item& item, const Context& context) {
    if (auto valid = check(item.placement); !valid) return valid;
    if (&item.cut.tree().context().impl() != &context.impl())
        return invalid_argument("The cut belongs to another OpenGL context than the target.");
    if (!item.lighting) return {};
    if (auto valid = vdtree::validate(*item.lighting); !valid) return valid;
    if (!item.cut.impl().glides.moves.empty())
        return invalid_argument(
            "Vertices that glide cannot be lit: draw the cut instead of the geomorph, or without lights.");
    return {};
}

Result<void> check_tile(const Camera& camera, const Target::Impl& target) {
    const vdtree::View& view = camera.view;
    const Tile& tile = *camera.tile;
    if (target.is_foreign || camera.shadow_mask)
        return invalid_argument("A tile is drawn to the library's own targets, without a mask of shadows.");
    if (auto valid = check_part(tile.part, view.width, view.height, "the view's window"); !valid) return valid;
    return check_part({tile.left, tile.top, tile.part.width, tile.part.height}, target.width, target.height,
                      "the target");
}

// In the unit frame.
LightUniforms uniforms_of(const vdtree::Lighting& lighting, glm::dvec3 eye, const UnitFrame& frame) {
    using Kind = vdtree::LightSource::Kind;
    const auto in_frame = [&](glm::dvec3 p) { return (p - frame.centre) / frame.unit; };
    LightUniforms uniforms;
    uniforms.material = glm::dvec4(lighting.ambient, lighting.specular * (lighting.shininess + 8) / 8,
                                   lighting.shininess, static_cast<double>(lighting.lights.size()));
    uniforms.eye = glm::dvec4(in_frame(eye), 0);
    int casting = 0;
    for (const vdtree::LightSource& light : lighting.lights) {
        const double distance = light.kind == Kind::directional ? 1 : light.distance / frame.unit;
        uniforms.lights.push_back(glm::dvec4(light.direction, light.intensity * distance * distance));
        uniforms.lights.push_back(glm::dvec4(in_frame(light.position), static_cast<int>(light.kind)));
        casting += light.casts_shadow;
        uniforms.lights.push_back(
            glm::dvec4(light.outer_cosine, light.inner_cosine, light.casts_shadow ? casting : 0, 0));
    }
    return uniforms;
}

float srgb_encoded(float linear) { return linear_to_srgb(std::clamp(linear, 0.0f, 1.0f)); }

glm::vec4 shown(glm::vec4 colour, Output output) {
    if (output == Output::linear) return colour;
    if (output == Output::encoded) colour = {srgb_encoded(colour.r), srgb_encoded(colour.g), srgb_encoded(colour.b), 1};
    return {glm::vec3(colour), 1};
}

void clear_target(const Target::Impl& target, const Clear& clear, int attachment, bool has_mask) {
    const Output output = target.output(attachment);
    if (clear.colour && output != Output::depth) {
        const glm::vec4 colour = shown(*clear.colour, output);
        glClearNamedFramebufferfv(target.id, GL_COLOR, 0, &colour.x);
    }
    const glm::vec4 unhidden(1);
    if (clear.colour && has_mask) glClearNamedFramebufferfv(target.id, GL_COLOR, 1, &unhidden.x);
    const GLfloat infinitely_far = 0;
    if (clear.depth && target.has_depth) glClearNamedFramebufferfv(target.id, GL_DEPTH, 0, &infinitely_far);
}

} // namespace

void set_fixed_state(const Target::Impl& target) {
    glViewport(0, 0, target.width, target.height);
    glDepthRange(0, 1);
    // Rows from the top, as they are read back, or as a window has them.
    glClipControl(target.top_row_first ? GL_UPPER_LEFT : GL_LOWER_LEFT, GL_ZERO_TO_ONE);
    glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
    glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    glDepthMask(GL_TRUE);
    disable({GL_SCISSOR_TEST, GL_STENCIL_TEST, GL_DITHER, GL_RASTERIZER_DISCARD, GL_COLOR_LOGIC_OP, GL_DEPTH_CLAMP,
             GL_POLYGON_OFFSET_FILL, GL_SAMPLE_ALPHA_TO_COVERAGE, GL_SAMPLE_MASK, GL_PRIMITIVE_RESTART,
             GL_FRAMEBUFFER_SRGB});
    glEnable(GL_MULTISAMPLE);
}

void set_scissor(const PixelBox& box) {
    glScissor(box.left, box.top, box.width, box.height);
    glEnable(GL_SCISSOR_TEST);
}

Result<std::vector<Projection>> projections_of(std::span<const Item> items, const vdtree::View& view,
                                               std::optional<double> near_plane) {
    std::vector<Projection> projections;
    for (const Item& item : items) {
        const GpuTree::Impl& tree = item.cut.tree().impl();
        projections.push_back(projection_of(view, item.placement, tree.tree.origin(), tree.frame));
        if (!fits_float(projections.back().clip_from_unit))
            return invalid_argument("The model cannot be drawn from so far away for its size; move the eye nearer.");
    }
    if (projections.empty()) return projections;
    const double nearest = std::ranges::min_element(projections, {}, &Projection::near_plane)->near_plane;
    if (view.orthographic_height) {
        const double farthest = std::ranges::max_element(projections, {}, &Projection::far_plane)->far_plane;
        for (Projection& projection : projections) projection.set_depth_range(nearest, farthest);
        return projections;
    }
    for (Projection& projection : projections) projection.set_near_plane(near_plane.value_or(nearest));
    return projections;
}

// The faces of a closed surface that point inward are never seen from outside.
SurfacePass::Cull SurfacePass::cull_for(vdtree::Closedness closedness, bool eye_inside) {
    if (eye_inside || closedness == vdtree::Closedness::open) return Cull::nothing;
    return closedness == vdtree::Closedness::closed_outward ? Cull::back : Cull::front;
}

namespace {

Result<void> check_draw(std::span<const Item> items, const Camera& camera, const Target::Impl& target, int attachment) {
    const vdtree::View& view = camera.view;
    if (auto valid = vdtree::validate_one_eye(view, "A picture"); !valid) return valid;
    if (camera.near_plane)
        if (auto valid = vdtree::validate_perspective(view, "A near plane of one's own"); !valid) return valid;
    if (camera.tile) {
        if (auto valid = check_tile(camera, target); !valid) return valid;
    } else if (view.width != target.width || view.height != target.height)
        return invalid_argument("The view is of " + std::to_string(view.width) + "x" + std::to_string(view.height) +
                                " pixels, and the target has " + std::to_string(target.width) + "x" +
                                std::to_string(target.height) + ".");
    if (!std::isfinite(camera.point.x) || !std::isfinite(camera.point.y))
        return invalid_argument("The camera's point of each pixel must be finite.");
    if (camera.near_plane && !(*camera.near_plane > 0 && std::isfinite(*camera.near_plane)))
        return invalid_argument("The near plane's distance must be positive and finite, not " +
                                std::to_string(*camera.near_plane) + ".");
    if (!target.outputs.empty())
        if (auto valid = target.check_attachment(attachment); !valid) return valid;
    if (camera.shadow_mask) {
        if (auto valid = target.check_attachment(*camera.shadow_mask); !valid) return valid;
        if (*camera.shadow_mask == attachment || target.output(*camera.shadow_mask) != Output::linear ||
            target.is_foreign)
            return invalid_argument("The mask of shadows needs an attachment of its own, of shares or in floats, of a "
                                    "target that is the library's own.");
    }
    for (const Item& item : items)
        if (auto valid = check(item, target.context); !valid) return valid;
    if (camera.shadows)
        for (const Item& item : items)
            if (auto valid = camera.shadows->impl().check(item); !valid) return valid;
    return {};
}

} // namespace

Result<SurfacePass> SurfacePass::prepare(std::span<const Item> items, const Camera& camera, const Target::Impl& target,
                                         int attachment, Use use) {
    if (auto valid = check_draw(items, camera, target, attachment); !valid) return valid.error();
    const vdtree::View& view = camera.view;
    auto projections = projections_of(items, view, camera.near_plane);
    if (!projections) return projections.error();

    const bool compares = use == Use::comparison;
    const Output output = compares ? Output::linear : target.output(attachment);
    SurfacePass pass(camera, attachment, output);
    pass.use_ = use;
    for (std::size_t i = 0; i < items.size(); ++i) {
        const Item& item = items[i];
        GpuTree::Impl& tree = item.cut.tree().impl();
        const bool is_stippled = !compares && item.stipple != glm::vec2(0, 1);
        const int casting =
            camera.shadows && item.lighting ? static_cast<int>(vdtree::shadow_lights(*item.lighting)) : 0;
        const bool is_cut_out = tree.texture && tree.texture->has_cut_outs();
        const bool is_flat = item.shading == Shading::flat;
        // The vertices' own light is in the colours of what is pre-lit, and flat triangles show what triangles are.
        const bool has_relief = tree.texture && tree.texture->has_relief() && !is_flat && output != Output::depth &&
                                (item.lighting || !tree.tree.is_prelit());
        const auto program =
            target.context.impl().programs.surface({.lit = item.lighting.has_value(),
                                                    .textured = tree.texture.has_value(),
                                                    .flat = is_flat,
                                                    .wireframe = item.wireframe,
                                                    .output = output,
                                                    .compares = compares,
                                                    .stippled = is_stippled,
                                                    .casting = casting,
                                                    .mask = camera.shadow_mask.has_value(),
                                                    .cut_out = is_cut_out,
                                                    .blends = is_cut_out && tree.texture->blends(),
                                                    .emission = tree.texture && tree.texture->has_emission(),
                                                    .relief = has_relief,
                                                    .share = use == Use::share_of_light});
        if (!program) return program.error();
        const Projection& projection = (*projections)[i];
        PreparedItem prepared{item.cut, projection, *program,
                              cull_for(tree.tree.closedness(), projection.eye_inside || is_cut_out)};
        if (is_stippled && output != Output::depth) prepared.stipple = item.stipple;
        prepared.has_relief = has_relief;
        prepared.is_lit = item.lighting && output != Output::depth;
        if (prepared.is_lit || has_relief)
            if (auto made = tree.need_lit_vertices(); !made) return made.error();
        if (prepared.is_lit) {
            prepared.lights =
                uniforms_of(*item.lighting, vdtree::eye_in_tree(tree.tree, view, item.placement), tree.frame);
            if (casting > 0) prepared.shadows = camera.shadows->impl().uniforms_of(item);
        }
        pass.items_.push_back(std::move(prepared));
    }
    return pass;
}

void ShownPixels::add(const Projection& projection, const Box& box, glm::dvec2 point) {
    const glm::dmat4 clip_from_unit(jittered(projection, view_, point));
    for (const glm::dvec3& at : box.corners()) {
        const glm::dvec4 clip = clip_from_unit * glm::dvec4(at, 1);
        const glm::dvec2 pixel((clip.x / clip.w + 1) / 2 * view_.width, (1 - clip.y / clip.w) / 2 * view_.height);
        if (!(clip.w > 0 && std::isfinite(pixel.x) && std::isfinite(pixel.y))) {
            is_behind_ = true;
            return;
        }
        low_ = glm::min(low_, pixel);
        high_ = glm::max(high_, pixel);
    }
}

PixelBox ShownPixels::box() const {
    constexpr double margin = 2; // pixels, for the rounding of single floats and of the rasteriser
    const int width = view_.width, height = view_.height;
    if (is_behind_) return {0, 0, width, height};
    const auto within = [](double at, int most) {
        return static_cast<int>(std::clamp(at, 0.0, static_cast<double>(most)));
    };
    const int left = within(std::floor(low_.x - margin), width), top = within(std::floor(low_.y - margin), height);
    return {left, top, std::max(0, within(std::ceil(high_.x + margin), width) - left),
            std::max(0, within(std::ceil(high_.y + margin), height) - top)};
}

PixelBox SurfacePass::pixels_of(std::span<const glm::dvec2> points) const {
    ShownPixels shown(view_);
    for (const PreparedItem& item : items_)
        for (const glm::dvec2 point : points) shown.add(item.projection, item.cut.impl().box, point);
    return shown.box();
}

void SurfacePass::draw(const Target::Impl& target, glm::dvec2 point, const Clear& clear, std::size_t sample_count,
                       const PixelBox* only, float least_share) const {
    set_fixed_state(target);
    if (tile_) {
        glViewport(tile_->left - tile_->part.left, tile_->top - tile_->part.top, view_.width, view_.height);
        set_scissor({tile_->left, tile_->top, tile_->part.width, tile_->part.height});
    } else if (only) {
        set_scissor(*only);
    }
    if (output_ == Output::display) glEnable(GL_FRAMEBUFFER_SRGB);
    target.bind(attachment_, mask_);
    clear_target(target, clear, attachment_, mask_.has_value());
    const float lod_bias = -0.5f * std::log2(static_cast<float>(sample_count));
    for (const PreparedItem& item : items_) draw_item(item, point, lod_bias, least_share);
}

void SurfacePass::compare(const Target::Impl& target, glm::dvec2 point, const glm::vec4& compared) const {
    set_fixed_state(target);
    target.bind(attachment_);
    for (const PreparedItem& item : items_) {
        item.program->set(compared_location, compared);
        draw_item(item, point, 0);
    }
}

void SurfacePass::draw_item(const PreparedItem& item, glm::dvec2 point, float lod_bias, float least_share) const {
    GpuCut::Impl& cut = item.cut.impl();
    GpuTree::Impl& tree = cut.tree.impl();
    if (cut.indices.count() == 0) return;
    cut.uploaded_bytes += tree.put(cut.glides);

    glDisable(GL_BLEND);
    glEnable(GL_DEPTH_TEST);
    // Depth is reversed. What compares is at the depth that was drawn before, of which it is a part.
    glDepthFunc(use_ == Use::comparison ? GL_GEQUAL : GL_GREATER);
    glFrontFace(GL_CCW);
    glEnable(GL_CULL_FACE);
    glCullFace(item.cull == Cull::front ? GL_FRONT : GL_BACK);

    item.program->set(clip_from_unit_location, jittered(item.projection, view_, point));
    if (output_ != Output::depth) set_colours(item);
    if (tree.texture && (output_ != Output::depth || tree.texture->has_cut_outs()))
        tree.texture->bind(*item.program, lod_bias, least_share);
    draw_triangles(*item.program, tree.arrays, cut.indices);
    if (item.cull != Cull::nothing) return;
    // Both sides of a leaf fold onto each other. Where they lie in one place, the one that faces the eye is seen, not the
    // one that is drawn first: faces that turn away lie behind by more than rounding makes of depths.
    constexpr float rounding = 16; // least differences of depths
    glCullFace(GL_FRONT);
    glEnable(GL_POLYGON_OFFSET_FILL);
    glPolygonOffset(0, -rounding); // depth is reversed
    draw_triangles(*item.program, tree.arrays, cut.indices);
    glDisable(GL_POLYGON_OFFSET_FILL);
}

void SurfacePass::set_colours(const PreparedItem& item) const {
    const GpuTree::Impl& tree = item.cut.tree().impl();
    const Program& program = *item.program;
    program.set(lowest_shade_location, item.is_lit ? glm::vec4(0) : tree.lowest_shade);
    // A texture that is lit is cut off at white behind it.
    const bool is_shadowed = !item.shadows.layers.empty();
    const glm::vec4 highest_lit = tree.texture || is_shadowed ? glm::vec4(brightest_light) : tree.highest_hue;
    program.set(highest_shade_location, item.is_lit ? highest_lit : tree.highest_shade);
    if (item.has_relief && !item.is_lit) {
        const vdtree::Light& light = tree.tree.light();
        program.set(baked_light_location, glm::vec4(light.direction, light.ambient));
        program.set(baked_fill_location, light.fill);
    }
    if (item.stipple) glProgramUniform2f(program.id(), stipple_location, item.stipple->x, item.stipple->y);
    if (item.is_lit) {
        program.set(material_location, item.lights.material);
        program.set(eye_location, item.lights.eye);
        if (!item.lights.lights.empty()) program.set(lights_location, item.lights.lights);
    }
    if (is_shadowed) {
        if (!tree.texture) program.set(whitest_shade_location, tree.highest_hue);
        std::vector<glm::mat4> layers = item.shadows.layers;
        for (glm::mat4& layer : layers)
            for (int column = 0; column < 4; ++column) {
                layer[column].x += static_cast<float>(shadows_->shift.x) * layer[column].w;
                layer[column].y += static_cast<float>(shadows_->shift.y) * layer[column].w;
            }
        program.set(layers_location, layers);
        program.set(shadow_lights_location, item.shadows.lights);
        program.set(shadow_kinds_location, item.shadows.kinds);
        program.set(world_from_unit_location, item.shadows.world_from_unit);
        shadows_->bind();
    }
}

// ---- for callers

Result<void> draw(std::span<const Item> items, const Camera& camera, Target& target, const Clear& clear,
                  int attachment) {
    const Target::Impl& to = target.impl();
    return in_context(to.context, "Drawing", [&]() -> Result<void> {
        const auto pass = SurfacePass::prepare(items, camera, to, attachment);
        if (!pass) return pass.error();
        pass->draw(to, camera.point, clear);
        return {};
    });
}

Result<PixelBox> pixels_of(std::span<const Item> items, const vdtree::View& view) {
    if (auto valid = vdtree::validate(view); !valid) return valid.error();
    const auto projections = projections_of(items, view, {});
    if (!projections) return projections.error();
    ShownPixels shown(view);
    for (std::size_t i = 0; i < items.size(); ++i)
        shown.add((*projections)[i], items[i].cut.impl().box, glm::dvec2(0.5));
    return shown.box();
}

Result<double> near_plane(std::span<const Item> items, const vdtree::View& view) {
    if (auto valid = vdtree::validate_perspective(view, "A near plane"); !valid) return valid.error();
    const auto projections = projections_of(items, view, {});
    if (!projections) return projections.error();
    return projections->empty() ? 1.0 : projections->front().near_plane;
}

} // namespace unseen::render
