// Maps of depth from the lights. Depth is reversed, as everywhere: 1 near the light, 0 at its farthest.

#include <algorithm>
#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>

#include <unseen/vdtree/internal/errors.h>

#include "query_pool.h"
#include "surface_pass.h"

namespace unseen::render {
namespace {

using Kind = vdtree::LightSource::Kind;

constexpr int least_size = 16;
constexpr unsigned maps_unit = 2; // as in surface.frag
// Texels at a map's border that looks from within reach over: a look takes two on each side.
constexpr int border_texels = 4;
// Spots wider than this, from their axis, have six maps like point lights: one would be too coarse in its middle.
constexpr double widest_spot = std::numbers::pi / 3; // radians
// What is nearer to a light with a place, in radii of the ball, casts no shadow.
constexpr double near_plane_share = 1e-4;
// Places are rounded to single floats: the ball is so much larger than what it is around.
constexpr double ball_margin = 1e-3;
// Lights are the same for two items where they differ by no more than rounding from frame to frame, in radii of the ball
// and in radians.
constexpr double same_light = 1e-5;
// Around what receives shadows: looks take two, and samples of pixels lie about the surface.
constexpr int texels_around = 8;
// Beyond a window's border, in halves of a map's side: what may cover a texel of it by the rounding of single floats.
constexpr double border_rounding = 1e-4;
constexpr std::uint64_t texel_bytes = 4;

bool is_wide(const CastingLight& light) {
    return light.kind == Kind::point || (light.kind == Kind::spot && light.outer_cosine < std::cos(widest_spot));
}

int layers_of(const CastingLight& light) { return is_wide(light) ? 6 : 1; }

// A frame that looks along -back. Depends on the direction alone.
glm::dmat3 looking_along(glm::dvec3 back) {
    const glm::dvec3 helper = std::abs(back.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0);
    const glm::dvec3 right = glm::normalize(glm::cross(helper, back));
    return {right, glm::cross(back, right), back};
}

double window_share(int size) { return static_cast<double>(size) / (size - 2 * border_texels); }

glm::dmat4 directional(const CastingLight& light, double radius, int size) {
    const glm::dmat4 turned(glm::transpose(looking_along(light.direction)));
    const double side = radius * window_share(size), depth = radius * (1 + ball_margin);
    glm::dmat4 clip(0);
    clip[0][0] = clip[1][1] = 1 / side;
    clip[2][2] = 1 / (2 * depth); // towards the light
    clip[3][2] = 0.5;
    clip[3][3] = 1;
    return clip * turned;
}

// `tangent`: of half the field.
glm::dmat4 perspective(glm::dvec3 from, glm::dvec3 back, double tangent, double near_plane) {
    const glm::dmat4 turned(glm::transpose(looking_along(back)));
    glm::dmat4 clip(0);
    clip[0][0] = clip[1][1] = 1 / tangent;
    clip[2][3] = -1;
    clip[3][2] = near_plane;
    return clip * turned * glm::translate(glm::dmat4(1), -from);
}

double tangent_of(const CastingLight& light, int size) {
    if (light.kind == Kind::directional) return 0;
    return window_share(size) * (is_wide(light) ? 1 : std::tan(std::acos(std::clamp(light.outer_cosine, 0.0, 1.0))));
}

glm::dmat4 ball_from_unit_of(const GpuCut& cut, const vdtree::Similarity& placement, const Ball& ball) {
    const GpuTree::Impl& tree = cut.tree().impl();
    glm::dmat4 ball_from_unit(glm::mat3_cast(placement.rotation) * (placement.scale * tree.frame.unit));
    ball_from_unit[3] = glm::dvec4(placement.to_world(tree.tree.origin() + tree.frame.centre) - ball.centre, 1);
    return ball_from_unit;
}

// Whether all of it lies beyond one side of a map's window, or behind the light.
bool is_outside(const Box& box, const glm::dmat4& clip_from_unit, const Shadows::Impl::Window& window) {
    const glm::dvec2 low = window.low - border_rounding, high = window.high + border_rounding;
    bool is_left = true, is_right = true, is_below = true, is_above = true, is_behind = true;
    for (const glm::dvec3& corner : box.corners()) {
        const glm::dvec4 clip = clip_from_unit * glm::dvec4(corner, 1);
        is_left &= clip.x < low.x * clip.w;
        is_right &= clip.x > high.x * clip.w;
        is_below &= clip.y < low.y * clip.w;
        is_above &= clip.y > high.y * clip.w;
        is_behind &= clip.w <= 0;
    }
    return is_left || is_right || is_below || is_above || is_behind;
}

bool is_same(const CastingLight& a, const CastingLight& b, const Ball& ball) {
    if (a.kind != b.kind || std::abs(a.outer_cosine - b.outer_cosine) > same_light) return false;
    if (a.kind != Kind::point && !(glm::length(a.direction - b.direction) <= same_light)) return false;
    const double scale = ball.radius + glm::length(a.position - ball.centre);
    return a.kind == Kind::directional || glm::length(a.position - b.position) <= same_light * scale;
}

} // namespace

std::vector<CastingLight> casting_lights(const Item& item) {
    std::vector<CastingLight> lights;
    if (!item.lighting) return lights;
    const vdtree::VertexTree& tree = item.cut.tree().tree();
    for (const vdtree::LightSource& light : item.lighting->lights)
        if (light.casts_shadow)
            lights.push_back({light.kind, glm::normalize(item.placement.rotation * light.direction),
                              item.placement.to_world(tree.origin() + light.position), light.outer_cosine});
    return lights;
}

Ball ball_around(std::span<const Item> items) {
    glm::dvec3 low(std::numeric_limits<double>::infinity()), high = -low;
    std::vector<glm::dvec3> corners;
    for (const Item& item : items) {
        const GpuTree::Impl& tree = item.cut.tree().impl();
        for (const glm::dvec3& at : item.cut.impl().box.corners()) {
            corners.push_back(item.placement.to_world(tree.tree.origin() + tree.frame.centre + tree.frame.unit * at));
            low = glm::min(low, corners.back()), high = glm::max(high, corners.back());
        }
    }
    Ball ball;
    if (corners.empty()) return ball;
    ball.centre = (low + high) * 0.5;
    for (const glm::dvec3& corner : corners) ball.radius = std::max(ball.radius, glm::length(corner - ball.centre));
    ball.radius *= 1 + ball_margin;
    return ball;
}

bool Shadows::Impl::Caster::is_same(const Caster& other) const {
    return &cut.impl() == &other.cut.impl() && changes == other.changes && glides == other.glides &&
           placement.scale == other.placement.scale && placement.rotation == other.placement.rotation &&
           placement.translation == other.placement.translation;
}

bool Shadows::Impl::Window::holds(const Window& other) const {
    return other.is_empty() ||
           (other.low.x >= low.x && other.low.y >= low.y && other.high.x <= high.x && other.high.y <= high.y);
}

Shadows::Impl::Window Shadows::Impl::window_of(const Layer& layer, const Receivers& receivers) const {
    const Window whole;
    if (!receivers) return whole;
    Window window{glm::dvec2(std::numeric_limits<double>::infinity()),
                  glm::dvec2(-std::numeric_limits<double>::infinity())};
    for (const Item& item : *receivers) {
        const Box& box = item.cut.impl().box;
        const glm::dmat4 clip_from_unit = layer.clip_from_ball * ball_from_unit_of(item.cut, item.placement, ball);
        if (is_outside(box, clip_from_unit, whole)) continue;
        for (const glm::dvec3& corner : box.corners()) {
            const glm::dvec4 clip = clip_from_unit * glm::dvec4(corner, 1);
            const glm::dvec2 at = glm::dvec2(clip) / clip.w;
            if (!(clip.w > 0 && std::isfinite(at.x) && std::isfinite(at.y))) return whole; // around the light
            window.low = glm::min(window.low, at), window.high = glm::max(window.high, at);
        }
    }
    const double around = 2.0 * texels_around / size;
    return {glm::max(window.low - around, whole.low), glm::min(window.high + around, whole.high)};
}

Result<void> Shadows::Impl::reserve(std::size_t wanted) {
    if (wanted <= map_count && wanted > 0) return {};
    maps = {};
    map_count = 0;
    if (wanted == 0) {
        framebuffer = {};
        return {};
    }
    GLint most_layers = 0;
    glGetIntegerv(GL_MAX_ARRAY_TEXTURE_LAYERS, &most_layers);
    if (wanted > static_cast<std::size_t>(most_layers))
        return unsupported("The lights that cast shadows need " + std::to_string(wanted) +
                           " maps, and this OpenGL holds at most " + std::to_string(most_layers) +
                           ": let fewer lights cast shadows.");
    maps = Texture2dArray::create("shadow maps");
    glTextureStorage3D(maps.id(), 1, GL_DEPTH_COMPONENT32F, size, size, static_cast<GLsizei>(wanted));
    if (glGetError() == GL_OUT_OF_MEMORY) {
        maps = {};
        return unsupported("The graphics memory does not hold the " + std::to_string(wanted) + " shadow maps of " +
                           std::to_string(size) + " texels a side: choose smaller ones, or fewer lights.");
    }
    const GLfloat nothing[] = {0, 0, 0, 0}; // infinitely far
    glTextureParameterfv(maps.id(), GL_TEXTURE_BORDER_COLOR, nothing);
    for (const GLenum wrap : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T})
        glTextureParameteri(maps.id(), wrap, GL_CLAMP_TO_BORDER);
    for (const GLenum filter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
        glTextureParameteri(maps.id(), filter, GL_NEAREST);
    framebuffer = FramebufferObject::create("shadow maps");
    glNamedFramebufferDrawBuffer(framebuffer.id(), GL_NONE);
    glNamedFramebufferReadBuffer(framebuffer.id(), GL_NONE);
    if (!begun) begun = Timestamp::create("shadow maps begun"), ended = Timestamp::create("shadow maps drawn");
    map_count = wanted;
    return {};
}

void Shadows::Impl::aim() {
    layers.clear();
    first_layers.clear();
    const double near_distance = near_plane_share * reach;
    for (const CastingLight& light : lights) {
        first_layers.push_back(static_cast<int>(layers.size()));
        const glm::dvec3 from = light.position - ball.centre;
        const double tangent = tangent_of(light, size);
        if (light.kind == Kind::directional) {
            layers.push_back({directional(light, reach, size)});
        } else if (!is_wide(light)) {
            layers.push_back({perspective(from, -light.direction, tangent, near_distance)});
        } else {
            for (int axis = 0; axis < 3; ++axis)
                for (const double side : {-1.0, 1.0}) {
                    glm::dvec3 back(0);
                    back[axis] = -side;
                    layers.push_back({perspective(from, back, tangent, near_distance)});
                }
        }
    }
}

void Shadows::Impl::draw_layer(const DepthPrograms& programs, std::size_t layer) {
    const Window& window = layers[layer].window;
    if (window.is_empty()) return;
    const glm::dvec2 first = glm::floor((window.low + 1.0) / 2.0 * static_cast<double>(size)),
                     end = glm::ceil((window.high + 1.0) / 2.0 * static_cast<double>(size));
    set_scissor({static_cast<int>(first.x), static_cast<int>(first.y), static_cast<int>(end.x - first.x),
                 static_cast<int>(end.y - first.y)});
    glNamedFramebufferTextureLayer(framebuffer.id(), GL_DEPTH_ATTACHMENT, maps.id(), 0, static_cast<GLint>(layer));
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, framebuffer.id());
    const GLfloat infinitely_far = 0;
    glClearNamedFramebufferfv(framebuffer.id(), GL_DEPTH, 0, &infinitely_far);
    const glm::dmat4 clip_from_ball =
        glm::translate(glm::dmat4(1), glm::dvec3(shift, 0)) * layers[layer].clip_from_ball;
    for (const Caster& caster : drawn) {
        GpuCut::Impl& cut = caster.cut.impl();
        GpuTree::Impl& tree = cut.tree.impl();
        if (cut.indices.count() == 0) continue;
        const glm::dmat4 clip_from_unit = clip_from_ball * ball_from_unit_of(caster.cut, caster.placement, ball);
        if (is_outside(cut.box, clip_from_unit, window)) continue; // of six maps around a light, most
        cut.uploaded_bytes += tree.put(cut.glides);
        const bool is_cut_out = tree.texture && tree.texture->has_cut_outs();
        const Program& program = is_cut_out ? *programs.cut_out : *programs.whole;
        program.set(0, glm::mat4(clip_from_unit));
        if (is_cut_out) tree.texture->bind(program, 0, 0.5f);
        draw_triangles(program, tree.arrays, cut.indices);
    }
}

Result<Shadows::Impl::DepthPrograms> Shadows::Impl::programs() const {
    DepthPrograms made;
    for (const bool cut_out : {false, true}) {
        if (cut_out && std::ranges::none_of(drawn, [](const Caster& caster) {
                const auto& texture = caster.cut.tree().impl().texture;
                return texture && texture->has_cut_outs();
            }))
            break;
        const auto program = context.impl().programs.surface({.output = Output::depth, .cut_out = cut_out});
        if (!program) return program.error();
        (cut_out ? made.cut_out : made.whole) = *program;
    }
    return made;
}

void Shadows::Impl::draw(const DepthPrograms& programs) {
    glQueryCounter(begun.id(), GL_TIMESTAMP);
    glViewport(0, 0, size, size);
    glDepthRange(0, 1);
    glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
    glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
    glDepthMask(GL_TRUE);
    disable({GL_SCISSOR_TEST, GL_STENCIL_TEST, GL_RASTERIZER_DISCARD, GL_DEPTH_CLAMP, GL_POLYGON_OFFSET_FILL,
             GL_PRIMITIVE_RESTART, GL_CULL_FACE, GL_BLEND});
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_GREATER); // depth is reversed
    for (std::size_t layer = 0; layer < layers.size(); ++layer) draw_layer(programs, layer);
    glDisable(GL_SCISSOR_TEST);
    glQueryCounter(ended.id(), GL_TIMESTAMP);
}

Result<void> Shadows::Impl::shift_texels(glm::dvec2 by) {
    const glm::dvec2 wanted = (by - 0.5) * (2.0 / size);
    if (lights.empty() || wanted == shift) return {};
    const auto made = programs();
    if (!made) return made.error();
    shift = wanted;
    draw(*made);
    return {};
}

Result<void> Shadows::Impl::update(std::span<const Item> casters, const Receivers& receivers) {
    std::vector<Caster> now;
    now.reserve(casters.size());
    std::optional<std::vector<CastingLight>> found; // of the first item that is lit
    const Ball around = bounds ? *bounds : ball_around(casters);
    if (!(around.radius >= 0 && std::isfinite(around.radius)))
        return invalid_argument("Shadows need a scene of a finite size.");
    for (const Item& item : casters) {
        if (&item.cut.tree().context().impl() != &context.impl())
            return invalid_argument("The cut belongs to another OpenGL context than the shadows.");
        const GpuCut::Impl& cut = item.cut.impl();
        now.push_back({item.cut, cut.indices.changes(), cut.glides.version, item.placement});
        if (!item.lighting) continue;
        if (auto valid = vdtree::validate(*item.lighting); !valid) return valid;
        std::vector<CastingLight> own = casting_lights(item);
        if (!found) {
            found = std::move(own);
            continue;
        }
        if (!std::equal(own.begin(), own.end(), found->begin(), found->end(),
                        [&](const CastingLight& a, const CastingLight& b) { return is_same(a, b, around); }))
            return invalid_argument(
                "Lights that cast shadows must be at the same places for all objects: give lights in orbit a centre.");
    }
    std::vector<CastingLight> lit = found.value_or(std::vector<CastingLight>());
    const bool is_known = lit == lights && around.centre == ball.centre && around.radius == ball.radius &&
                          std::equal(now.begin(), now.end(), drawn.begin(), drawn.end(),
                                     [](const Caster& a, const Caster& b) { return a.is_same(b); });
    const auto is_drawn = [&](const Layer& layer) { return layer.window.holds(window_of(layer, receivers)); };
    if (is_known && std::all_of(layers.begin(), layers.end(), is_drawn)) return shift_texels(glm::dvec2(0.5));
    lights.clear(); // until it is done
    drawn.clear();
    int wanted = 0;
    for (const CastingLight& light : lit) wanted += layers_of(light);
    if (auto reserved = reserve(static_cast<std::size_t>(wanted)); !reserved) return reserved;
    lights = std::move(lit);
    ball = around;
    reach = ball.radius > 0 ? ball.radius : 1; // all in one point
    aim();
    for (Layer& layer : layers) layer.window = window_of(layer, receivers);
    if (lights.empty()) return {};
    drawn = std::move(now);
    const auto made = programs();
    if (!made) return lights.clear(), drawn.clear(), made.error();
    shift = glm::dvec2(0);
    draw(*made);
    ++redraws;
    return {};
}

Result<void> Shadows::Impl::check(const Item& item) const {
    if (&context.impl() != &item.cut.tree().context().impl())
        return invalid_argument("The shadows belong to another OpenGL context than the cut.");
    const std::vector<CastingLight> own = casting_lights(item);
    if (own.empty() || std::equal(own.begin(), own.end(), lights.begin(), lights.end(),
                                  [&](const CastingLight& a, const CastingLight& b) { return is_same(a, b, ball); }))
        return {};
    return invalid_argument("The shadows are of other lights than the item's: update them before drawing.");
}

ShadowUniforms Shadows::Impl::uniforms_of(const Item& item) const {
    const GpuTree::Impl& tree = item.cut.tree().impl();
    const double unit = item.placement.scale * tree.frame.unit;
    const glm::dvec3 middle = item.placement.to_world(tree.tree.origin() + tree.frame.centre);
    const glm::dmat4 ball_from_unit = ball_from_unit_of(item.cut, item.placement, ball);
    ShadowUniforms uniforms;
    uniforms.world_from_unit = glm::mat4(glm::dmat4(glm::mat3_cast(item.placement.rotation)));
    const glm::dmat3 unit_from_world = glm::transpose(glm::mat3_cast(item.placement.rotation));
    for (std::size_t i = 0; i < lights.size(); ++i) {
        const CastingLight& light = lights[i];
        const bool has_place = light.kind != Kind::directional;
        for (int layer = first_layers[i]; layer < first_layers[i] + layers_of(light); ++layer)
            uniforms.layers.emplace_back(layers[static_cast<std::size_t>(layer)].clip_from_ball * ball_from_unit);
        uniforms.lights.emplace_back(unit_from_world * (light.position - middle) / unit, first_layers[i]);
        uniforms.kinds.emplace_back(is_wide(light), has_place,
                                    has_place ? tangent_of(light, size) : window_share(size) / (2 * (1 + ball_margin)),
                                    0);
    }
    return uniforms;
}

void Shadows::Impl::bind() const {
    glBindTextureUnit(maps_unit, maps.id());
    glBindSampler(maps_unit, 0);
}

Result<Shadows> Shadows::create(const Context& context, const std::optional<Ball>& bounds, int size) {
    auto impl = std::make_unique<Impl>(context, bounds, size);
    auto made = in_context(context, "Making shadows", [&]() -> Result<void> {
        const int most = largest_target_side();
        if (size < least_size || size > most)
            return unsupported("Shadow maps of " + std::to_string(size) +
                               " texels a side cannot be drawn: this OpenGL draws from " + std::to_string(least_size) +
                               " to " + std::to_string(most) + ".");
        if (bounds && !(bounds->radius >= 0 && std::isfinite(bounds->radius)))
            return invalid_argument("The ball that shadows reach over must have a finite radius, 0 or more.");
        return {};
    });
    if (!made) return made.error();
    return Shadows(std::move(impl));
}

Result<void> Shadows::update(std::span<const Item> casters, const std::optional<std::span<const Item>>& receivers) {
    return in_context(impl_->context, "Drawing shadow maps", [&] { return impl_->update(casters, receivers); });
}

ShadowFacts Shadows::counts() const noexcept {
    ShadowFacts facts;
    facts.lights = static_cast<int>(impl_->lights.size());
    facts.maps = static_cast<int>(impl_->layers.size());
    facts.size = impl_->size;
    const auto side = static_cast<std::uint64_t>(impl_->size);
    facts.bytes = texel_bytes * side * side * impl_->map_count;
    facts.redraws = impl_->redraws;
    return facts;
}

ShadowFacts Shadows::facts() const {
    ShadowFacts facts = counts();
    if (impl_->redraws == 0 || !impl_->context.make_current()) return facts;
    facts.draw_ms = static_cast<double>(result_of(impl_->ended.id()) - result_of(impl_->begun.id())) * 1e-6; // of ns
    return facts;
}

} // namespace unseen::render
