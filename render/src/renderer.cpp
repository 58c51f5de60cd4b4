// Draws cuts: checks what is asked for, and makes cameras and samples of it for the triangle drawer.
#include <render/renderer.h>

#include <chrono>
#include <cmath>
#include <memory>
#include <string>

#include "camera.h"
#include "context_impl.h"
#include "gl.h"
#include "triangle_drawer.h"

namespace unseen::render {
namespace {

constexpr int most_samples = 256; // beyond, the sum's rounding in float would outgrow what a sample adds to the picture

Error invalid(std::string message) {
    return {ErrorCode::invalid_argument, std::move(message)};
}

bool is_finite(glm::dvec3 v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

bool is_finite(glm::dquat q) {
    return std::isfinite(q.w) && std::isfinite(q.x) && std::isfinite(q.y) && std::isfinite(q.z);
}

Result<void> check(const DrawOptions& options) {
    if (options.samples < 1 || options.samples > most_samples)
        return invalid("The samples a pixel must be from 1 to " + std::to_string(most_samples) + ", not " +
                       std::to_string(options.samples) + ".");
    if (!(options.background >= 0 && options.background <= 1))
        return invalid("The background must be a relative luminance from 0 to 1, not " +
                       std::to_string(options.background) + ".");
    return {};
}

Result<void> check(const vdtree::Similarity& placement) {
    if (!(placement.scale > 0) || !std::isfinite(placement.scale))
        return invalid("The placement's scale must be positive and finite, not " + std::to_string(placement.scale) +
                       ".");
    if (!is_finite(placement.rotation) || !is_finite(placement.translation))
        return invalid("The placement's rotation and translation must be finite.");
    return {};
}

bool is_finite(const glm::dmat4& matrix) {
    for (int column = 0; column < 4; ++column)
        for (int row = 0; row < 4; ++row)
            if (!std::isfinite(static_cast<float>(matrix[column][row])))
                return false;
    return true;
}

// The faces of a closed surface that point inward are never seen from outside.
Cull cull_for(vdtree::Closedness closedness, bool eye_inside) {
    if (eye_inside || closedness == vdtree::Closedness::open)
        return Cull::nothing;
    return closedness == vdtree::Closedness::closed_outward ? Cull::back : Cull::front;
}

double milliseconds_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

VertexArrays arrays_of(const vdtree::VertexTree& tree, const UnitFrame& frame) {
    return {tree.positions(), tree.luminance(), tree.colours(), frame, tree.uvs(), tree.texture()};
}

Frame frame_of(std::span<const glm::vec4> pixels, int width, int height) {
    Frame frame;
    frame.width = width;
    frame.height = height;
    frame.luminance.resize(pixels.size());
    frame.colour.resize(3 * pixels.size());
    for (std::size_t i = 0; i < pixels.size(); ++i) {
        frame.luminance[i] = pixels[i].a;
        frame.colour[3 * i] = pixels[i].r;
        frame.colour[3 * i + 1] = pixels[i].g;
        frame.colour[3 * i + 2] = pixels[i].b;
    }
    return frame;
}

// In the unit frame.
LightUniforms uniforms_of(const vdtree::Lighting& lighting, glm::dvec3 eye, const UnitFrame& frame) {
    using Kind = vdtree::LightSource::Kind;
    const auto in_frame = [&](glm::dvec3 p) { return (p - frame.centre) / frame.unit; };
    LightUniforms uniforms;
    uniforms.material = glm::dvec4(lighting.ambient, lighting.specular * (lighting.shininess + 8) / 8, lighting.shininess,
                                   static_cast<double>(lighting.lights.size()));
    uniforms.eye = glm::dvec4(in_frame(eye), 0);
    for (const vdtree::LightSource& light : lighting.lights) {
        const double distance = light.kind == Kind::directional ? 1 : light.distance / frame.unit;
        uniforms.lights.push_back(glm::dvec4(light.direction, light.intensity * distance * distance));
        uniforms.lights.push_back(glm::dvec4(in_frame(light.position), static_cast<int>(light.kind)));
        uniforms.lights.push_back(glm::dvec4(light.outer_cosine, light.inner_cosine, 0, 0));
    }
    return uniforms;
}

std::vector<LitVertex> lit_vertices_of(const vdtree::VertexTree& tree) {
    std::vector<LitVertex> vertices;
    vertices.reserve(tree.node_count());
    for (vdtree::NodeId node = 0; node < tree.node_count(); ++node)
        vertices.push_back({tree.normals()[node], vdtree::albedo_of(tree, node)});
    return vertices;
}

} // namespace

struct Renderer::Impl {
    Impl(std::shared_ptr<Context::Impl> context_, TriangleDrawer drawer_) : context(std::move(context_)), drawer(std::move(drawer_)) {}
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;
    ~Impl() { static_cast<void>(context->platform->make_current()); } // for the drawer's objects, which go next

    std::shared_ptr<Context::Impl> context; // first, and so gone last
    TriangleDrawer drawer;
    UnitFrame frame;
    std::optional<vdtree::VertexTree> tree; // kept, so that no other one comes to its data's address, by which it is known
    glm::dvec3 origin = glm::dvec3(0);
    vdtree::Closedness closedness = vdtree::Closedness::open;
    std::vector<glm::mat4> matrices; // of the samples

    Result<Camera> prepare(const vdtree::Cut& cut, Moved moved, const vdtree::View& view, const DrawOptions& options,
                           const vdtree::Similarity& placement);
    SurfaceStyle style(const DrawOptions& options, const Camera& camera) const;
    Result<void> gl_result(const char* what);
};

// Checks everything that can be wrong, brings the cut's triangles to the GPU and aims the camera.
Result<Camera> Renderer::Impl::prepare(const vdtree::Cut& cut, Moved moved, const vdtree::View& view, const DrawOptions& options,
                                       const vdtree::Similarity& placement) {
    if (auto valid = vdtree::validate(view); !valid)
        return valid.error();
    if (auto valid = check(options); !valid)
        return valid.error();
    if (auto valid = check(placement); !valid)
        return valid.error();
    if (options.lighting) {
        if (auto valid = vdtree::validate(*options.lighting); !valid)
            return valid.error();
        if (!moved.empty())
            return invalid("Vertices that glide cannot be lit: draw the cut instead of the geomorph, or without lights.");
    }
    if (!cut.tree().texture().empty() && !moved.empty())
        return invalid("Textures do not glide: draw the cut instead of the geomorph, or the tree without its texture.");
    if (std::addressof(cut.tree().data()) != std::addressof(tree->data()))
        return invalid("The cut belongs to another tree than the renderer's; make a renderer for that tree.");
    const Camera camera = camera_for(view, placement, origin, frame);
    if (!is_finite(camera.clip_from_unit))
        return invalid("The model cannot be drawn from so far away for its size; move the eye nearer.");
    if (auto current = context->platform->make_current(); !current)
        return current.error();
    context->errors.begin();
    const auto indices = cut.indices(); // first: the rest is about what it returned
    const auto set = drawer.set_triangles(
        {indices, cut.index_version(), cut.index_writes_from(), cut.index_writes()});
    auto put = set ? drawer.set_moved(arrays_of(cut.tree(), frame), moved) : set;
    if (put && options.lighting)
        put = drawer.set_lights(uniforms_of(*options.lighting, vdtree::eye_in_tree(cut.tree(), view, placement), frame),
                                [&] { return lit_vertices_of(cut.tree()); });
    if (!put) {
        static_cast<void>(context->errors.take_new()); // the drawer's error says it better
        return put.error();
    }
    return camera;
}

SurfaceStyle Renderer::Impl::style(const DrawOptions& options, const Camera& camera) const {
    return {options.shading, options.wireframe, cull_for(closedness, camera.eye_inside), options.background,
            options.lighting.has_value()};
}

Result<void> Renderer::Impl::gl_result(const char* what) {
    const std::string errors = context->errors.take_new();
    if (errors.empty())
        return {};
    return Error{ErrorCode::unsupported, std::string(what) + " failed in OpenGL: " + errors + "."};
}

Renderer::Renderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;
Renderer::~Renderer() = default;

Result<Renderer> Renderer::create(Context& context, const vdtree::VertexTree& tree) {
    if (auto current = context.make_current(); !current)
        return current.error();
    context.impl_->errors.begin();
    const UnitFrame frame = unit_frame(tree.bounds()[tree.root()].ring);
    auto drawer = TriangleDrawer::create(arrays_of(tree, frame));
    if (!drawer) {
        static_cast<void>(context.impl_->errors.take_new()); // the drawer's error says it better
        return drawer.error();
    }
    auto impl = std::make_unique<Impl>(context.impl_, std::move(*drawer));
    impl->frame = frame;
    impl->tree = tree.share();
    impl->origin = tree.origin();
    impl->closedness = tree.closedness();
    if (auto made = impl->gl_result("Bringing the tree to the GPU"); !made)
        return made.error();
    return Renderer(std::move(impl));
}

std::uint64_t Renderer::uploaded_bytes() const noexcept { return impl_->drawer.uploaded_bytes(); }

Result<Frame> Renderer::draw(const vdtree::Cut& cut, const vdtree::View& view, const DrawOptions& options,
                             const vdtree::Similarity& placement) {
    return draw(cut, {}, view, options, placement);
}

Result<Frame> Renderer::draw(const vdtree::Geomorph& geomorph, const vdtree::View& view, const DrawOptions& options,
                             const vdtree::Similarity& placement) {
    return draw(geomorph.drawn(), geomorph.moved(), view, options, placement);
}

Result<Frame> Renderer::draw(const vdtree::Cut& cut, Moved moved, const vdtree::View& view, const DrawOptions& options,
                             const vdtree::Similarity& placement) {
    const auto camera = impl_->prepare(cut, moved, view, options, placement);
    if (!camera)
        return camera.error();
    impl_->matrices.clear();
    for (glm::dvec2 sample : n_rooks(options.samples, options.seed))
        impl_->matrices.push_back(jittered(*camera, view, sample));

    glFinish(); // what came before is not this frame's time
    const auto start = std::chrono::steady_clock::now();
    const auto pixels = impl_->drawer.draw(view.width, view.height, impl_->matrices, impl_->style(options, *camera));
    glFinish();
    const double draw_ms = milliseconds_since(start);

    const auto gl = impl_->gl_result("Drawing");
    if (!pixels)
        return pixels.error();
    if (!gl)
        return gl.error();
    Frame frame = frame_of(*pixels, view.width, view.height);
    frame.draw_ms = draw_ms;
    return frame;
}

Result<void> Renderer::draw_to_window(const vdtree::Cut& cut, const vdtree::View& view, const DrawOptions& options,
                                      const vdtree::Similarity& placement) {
    return draw_to_window(cut, {}, view, options, placement);
}

Result<void> Renderer::draw_to_window(const vdtree::Geomorph& geomorph, const vdtree::View& view, const DrawOptions& options,
                                      const vdtree::Similarity& placement) {
    return draw_to_window(geomorph.drawn(), geomorph.moved(), view, options, placement);
}

Result<void> Renderer::draw_to_window(const vdtree::Cut& cut, Moved moved, const vdtree::View& view, const DrawOptions& options,
                                      const vdtree::Similarity& placement) {
    const auto camera = impl_->prepare(cut, moved, view, options, placement);
    if (!camera)
        return camera.error();
    const glm::dvec2 pixel_centre(0.5);
    const auto drawn = impl_->drawer.draw_to_window(view.width, view.height, jittered(*camera, view, pixel_centre),
                                                    impl_->style(options, *camera));
    const auto gl = impl_->gl_result("Drawing to the window");
    return drawn ? gl : drawn;
}

} // namespace unseen::render
