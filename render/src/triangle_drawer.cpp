// Uploads vertices, draws samples and adds them up.
#include "triangle_drawer.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>

#include "gl.h"
#include "shaders.h"

namespace unseen::render {
namespace {

// Rec. 709 luminance of linear RGB, as everywhere in Unseen.
constexpr glm::dvec3 rec709(0.2126, 0.7152, 0.0722);

constexpr std::size_t upload_batch = 1u << 16;              // vertices; bounds the memory that uploading takes
constexpr std::uint64_t most_indices_a_call = 3ull << 28;    // a multiple of 3 that fits GLsizei

constexpr float brightest_light = 1e6f;                      // times white: far beyond what shows any texel

enum UniformLocation {
    clip_from_unit_location = 0,
    lowest_shade_location = 1,
    highest_shade_location = 2,
    material_location = 4,
    eye_location = 5,
    lights_location = 6,
    lod_bias_location = 60,
    uv_bounds_location = 61,
    background_location = 0,
};

// The colour scaled to the luminance; grey where it has none.
glm::vec3 shaded_colour(glm::vec4 colour, float luminance) {
    const glm::dvec3 rgb(colour);
    const double own = glm::dot(rgb, rec709);
    if (!(own > 0) || !std::isfinite(own))
        return glm::vec3(luminance);
    const glm::dvec3 scaled = rgb * (static_cast<double>(luminance) / own);
    return glm::vec3(scaled);
}

// `colour`: null where there are none.
Vertex vertex_of(const UnitFrame& frame, glm::vec3 position, float luminance, const glm::vec4* colour) {
    const glm::vec3 rgb = colour ? shaded_colour(*colour, luminance) : glm::vec3(luminance);
    const glm::dvec3 in_frame = (glm::dvec3(position) - frame.centre) / frame.unit;
    return {glm::vec3(in_frame), glm::vec4(rgb, luminance)};
}

Vertex vertex_at(const VertexArrays& arrays, std::size_t i) {
    return vertex_of(arrays.frame, arrays.positions[i], arrays.luminance[i], arrays.colours.empty() ? nullptr : &arrays.colours[i]);
}

void describe_vertices(GLuint arrays, GLuint vertices) {
    glVertexArrayVertexBuffer(arrays, 0, vertices, 0, sizeof(Vertex));
    glEnableVertexArrayAttrib(arrays, 0);
    glVertexArrayAttribFormat(arrays, 0, 3, GL_FLOAT, GL_FALSE, offsetof(Vertex, position));
    glVertexArrayAttribBinding(arrays, 0, 0);
    glEnableVertexArrayAttrib(arrays, 1);
    glVertexArrayAttribFormat(arrays, 1, 4, GL_FLOAT, GL_FALSE, offsetof(Vertex, shade));
    glVertexArrayAttribBinding(arrays, 1, 0);
}

void describe_lit_vertices(GLuint arrays, GLuint vertices) {
    glVertexArrayVertexBuffer(arrays, 1, vertices, 0, sizeof(LitVertex));
    glEnableVertexArrayAttrib(arrays, 2);
    glVertexArrayAttribIFormat(arrays, 2, 2, GL_SHORT, offsetof(LitVertex, normal));
    glVertexArrayAttribBinding(arrays, 2, 1);
    glEnableVertexArrayAttrib(arrays, 3);
    glVertexArrayAttribFormat(arrays, 3, 1, GL_FLOAT, GL_FALSE, offsetof(LitVertex, albedo));
    glVertexArrayAttribBinding(arrays, 3, 1);
}

// Everything that drawing depends on is set each time: a window's other users may have changed it.
void set_fixed_state(int width, int height) {
    glViewport(0, 0, width, height);
    glDepthRange(0, 1);
    glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
    glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    glDepthMask(GL_TRUE);
    for (GLenum off : {GL_SCISSOR_TEST, GL_STENCIL_TEST, GL_DITHER, GL_RASTERIZER_DISCARD, GL_COLOR_LOGIC_OP,
                       GL_DEPTH_CLAMP, GL_POLYGON_OFFSET_FILL, GL_SAMPLE_ALPHA_TO_COVERAGE, GL_SAMPLE_MASK,
                       GL_PRIMITIVE_RESTART, GL_FRAMEBUFFER_SRGB})
        glDisable(off);
}

void set_surface_state(Cull cull) {
    glDisable(GL_BLEND);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_GREATER); // depth is reversed
    glFrontFace(GL_CCW);
    if (cull == Cull::nothing) {
        glDisable(GL_CULL_FACE);
    } else {
        glEnable(GL_CULL_FACE);
        glCullFace(cull == Cull::back ? GL_BACK : GL_FRONT);
    }
}

void set_sum_state() {
    glDisable(GL_DEPTH_TEST);
    glDisable(GL_CULL_FACE);
    glEnable(GL_BLEND);
    glBlendEquation(GL_FUNC_ADD);
    glBlendFunc(GL_ONE, GL_ONE);
}

void clear(GLuint framebuffer, glm::vec4 colour, bool depth) {
    glClearNamedFramebufferfv(framebuffer, GL_COLOR, 0, &colour.x);
    const GLfloat infinitely_far = 0;
    if (depth)
        glClearNamedFramebufferfv(framebuffer, GL_DEPTH, 0, &infinitely_far);
}

// Pixels from the top left.
struct PixelBox {
    int left, top, width, height;
};

// Which pixels of images by these matrices can show anything of a box: all of them where a part of it may lie behind the eye.
PixelBox pixels_of(const Box& box, std::span<const glm::mat4> clip_from_unit, int width, int height) {
    constexpr double margin = 2; // pixels, for the rounding of single floats and of the rasteriser
    glm::dvec2 low(std::numeric_limits<double>::infinity()), high = -low;
    for (const glm::mat4& matrix : clip_from_unit) {
        for (int corner = 0; corner < 8; ++corner) {
            const glm::dvec3 at(corner & 1 ? box.high.x : box.low.x, corner & 2 ? box.high.y : box.low.y, corner & 4 ? box.high.z : box.low.z);
            const glm::dvec4 clip = glm::dmat4(matrix) * glm::dvec4(at, 1);
            const glm::dvec2 pixel((clip.x / clip.w + 1) / 2 * width, (1 - clip.y / clip.w) / 2 * height);
            if (!(clip.w > 0 && std::isfinite(pixel.x) && std::isfinite(pixel.y)))
                return {0, 0, width, height};
            low = glm::min(low, pixel);
            high = glm::max(high, pixel);
        }
    }
    const auto within = [](double at, int most) { return static_cast<int>(std::clamp(at, 0.0, static_cast<double>(most))); };
    const int left = within(std::floor(low.x - margin), width), top = within(std::floor(low.y - margin), height);
    return {left, top, within(std::ceil(high.x + margin), width) - left, within(std::ceil(high.y + margin), height) - top};
}

float srgb_encoded(float linear) {
    const float c = std::clamp(linear, 0.0f, 1.0f);
    return c <= 0.0031308f ? 12.92f * c : 1.055f * std::pow(c, 1 / 2.4f) - 0.055f;
}

Result<void> check_window() {
    const GLenum status = glCheckNamedFramebufferStatus(0, GL_DRAW_FRAMEBUFFER);
    if (status == GL_FRAMEBUFFER_UNDEFINED)
        return Error{ErrorCode::unsupported, "There is no window to draw to: the OpenGL context is headless."};
    if (status != GL_FRAMEBUFFER_COMPLETE)
        return Error{ErrorCode::unsupported, "The window's framebuffer cannot be drawn to."};
    return {};
}

bool window_encodes_srgb() {
    GLint encoding = GL_LINEAR;
    glGetNamedFramebufferAttachmentParameteriv(0, GL_BACK_LEFT, GL_FRAMEBUFFER_ATTACHMENT_COLOR_ENCODING, &encoding);
    return encoding == GL_SRGB;
}

// GL keeps the pixels in the order of its own rows; with the origin at the upper left that is from the top.
void read_pixels(const Framebuffer& from, std::span<glm::vec4> pixels) {
    glPixelStorei(GL_PACK_ALIGNMENT, 4);
    glPixelStorei(GL_PACK_ROW_LENGTH, 0);
    glPixelStorei(GL_PACK_SKIP_ROWS, 0);
    glPixelStorei(GL_PACK_SKIP_PIXELS, 0);
    glBindBuffer(GL_PIXEL_PACK_BUFFER, 0);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, from.id());
    glReadBuffer(GL_COLOR_ATTACHMENT0);
    glReadPixels(0, 0, from.width(), from.height(), GL_RGBA, GL_FLOAT, pixels.data());
}

} // namespace

Result<TriangleDrawer> TriangleDrawer::create(const VertexArrays& vertices) {
    auto indices = GpuIndices::create();
    if (!indices)
        return indices.error();
    TriangleDrawer drawer(std::move(*indices));
    drawer.vertices_ = Buffer::create("vertices");
    drawer.surface_arrays_ = VertexArray::create("surface");
    drawer.no_arrays_ = VertexArray::create("full screen");
    if (auto uploaded = drawer.upload(vertices); !uploaded)
        return uploaded.error();
    describe_vertices(drawer.surface_arrays_.id(), drawer.vertices_.id());
    if (!vertices.texture.empty()) {
        auto texture = SurfaceTexture::create(vertices.texture, vertices.uvs);
        if (!texture)
            return texture.error();
        drawer.texture_ = std::move(*texture);
        drawer.texture_->describe(drawer.surface_arrays_.id());
    }

    const ShaderSource sources[] = {{ShaderSource::Stage::vertex, shaders::full_screen_vert},
                                    {ShaderSource::Stage::fragment, shaders::accumulate_frag}};
    auto accumulate = Program::build("accumulate", sources);
    if (!accumulate)
        return accumulate.error();
    drawer.accumulate_ = std::move(*accumulate);
    return drawer;
}

Result<void> TriangleDrawer::upload(const VertexArrays& vertices) {
    const std::size_t count = vertices.positions.size();
    vertex_count_ = count;
    glNamedBufferStorage(vertices_.id(), static_cast<GLsizeiptr>(std::max<std::size_t>(count, 1) * sizeof(Vertex)),
                         nullptr, GL_DYNAMIC_STORAGE_BIT);
    if (glGetError() == GL_OUT_OF_MEMORY)
        return Error{ErrorCode::unsupported, "The graphics memory does not hold the tree's " + std::to_string(count) +
                                                 " vertices (" + std::to_string(count * sizeof(Vertex) >> 20) +
                                                 " MiB)."};
    std::vector<Vertex> batch;
    batch.reserve(std::min(count, upload_batch));
    for (std::size_t first = 0; first < count; first += batch.size()) {
        batch.clear();
        for (std::size_t i = first; i < std::min(count, first + upload_batch); ++i)
            batch.push_back(vertex_at(vertices, i));
        for (const Vertex& vertex : batch) {
            box_.include(vertex.position);
            lowest_shade_ = glm::min(lowest_shade_, vertex.shade);
            highest_shade_ = glm::max(highest_shade_, vertex.shade);
            if (vertex.shade.a > 0) highest_hue_ = glm::max(highest_hue_, vertex.shade / vertex.shade.a);
        }
        glNamedBufferSubData(vertices_.id(), static_cast<GLintptr>(first * sizeof(Vertex)),
                             static_cast<GLsizeiptr>(batch.size() * sizeof(Vertex)), batch.data());
    }
    return {};
}

Result<void> TriangleDrawer::set_triangles(const IndexState& state) {
    auto updated = indices_.update(state);
    glVertexArrayElementBuffer(surface_arrays_.id(), indices_.buffer());
    return updated;
}

Result<void> TriangleDrawer::set_moved(const VertexArrays& vertices, std::span<const vdtree::MovedVertex> moved) {
    moves_.clear();
    if (moved.empty() && moved_.empty())
        return {};
    if (!mover_) {
        auto made = VertexMover::create();
        if (!made)
            return made.error();
        mover_ = std::move(*made);
    }
    std::vector<std::uint32_t> now;
    now.reserve(moved.size());
    for (const vdtree::MovedVertex& vertex : moved) {
        now.push_back(vertex.node);
        const glm::vec4* const colour = vertices.colours.empty() ? nullptr : &vertex.colour;
        moves_.push_back({vertex.node, vertex_of(vertices.frame, vertex.position, vertex.luminance, colour)});
        box_.include(moves_.back().to.position);
    }
    std::sort(now.begin(), now.end());
    for (auto next = now.begin(); const std::uint32_t vertex : moved_) { // those that are not moved any more
        next = std::lower_bound(next, now.end(), vertex);
        if (next == now.end() || *next != vertex)
            moves_.push_back({vertex, vertex_at(vertices, vertex)});
    }
    moved_.swap(now);
    mover_->move(vertices_.id(), vertex_count_, moves_);
    return {};
}

Result<void> TriangleDrawer::set_lights(LightUniforms lights, const FunctionRef<std::vector<LitVertex>()>& vertices) {
    lights_ = std::move(lights);
    if (lit_vertices_)
        return {};
    const std::vector<LitVertex> made = vertices();
    Buffer buffer = Buffer::create("vertices under lights");
    glNamedBufferStorage(buffer.id(), static_cast<GLsizeiptr>(std::max<std::size_t>(made.size(), 1) * sizeof(LitVertex)), made.data(), 0);
    if (glGetError() == GL_OUT_OF_MEMORY)
        return Error{ErrorCode::unsupported, "The graphics memory does not hold the normals of the tree's " + std::to_string(made.size()) +
                                                 " vertices, which lights need."};
    lit_vertices_ = std::move(buffer);
    describe_lit_vertices(surface_arrays_.id(), lit_vertices_->id());
    return {};
}

Result<std::span<const glm::vec4>> TriangleDrawer::draw(int width, int height,
                                                        std::span<const glm::mat4> clip_from_unit,
                                                        const SurfaceStyle& style) {
    if (auto fitted = fit_targets(width, height); !fitted)
        return fitted.error();
    const auto program = program_for(style, Target::image);
    if (!program)
        return program.error();

    set_fixed_state(width, height);
    glClipControl(GL_UPPER_LEFT, GL_ZERO_TO_ONE); // rows from the top, as they are read back
    clear(sum_.id(), glm::vec4(0), false);
    // Where nothing can be, the sum stays 0: the background.
    const PixelBox used = pixels_of(box_, clip_from_unit, width, height);
    glScissor(used.left, used.top, used.width, used.height);
    glEnable(GL_SCISSOR_TEST);
    // Each of n samples stands for an n-th of a pixel.
    const float lod_bias = -0.5f * std::log2(static_cast<float>(std::max<std::size_t>(clip_from_unit.size(), 1)));
    for (const glm::mat4& matrix : clip_from_unit) {
        glBindFramebuffer(GL_DRAW_FRAMEBUFFER, sample_.id());
        clear(sample_.id(), glm::vec4(style.background), true);
        draw_surface(**program, matrix, style, lod_bias);
        glBindFramebuffer(GL_DRAW_FRAMEBUFFER, sum_.id());
        add_sample_to_sum(style.background);
    }
    glDisable(GL_SCISSOR_TEST);
    read_pixels(sum_, pixels_);

    const double share = 1.0 / static_cast<double>(std::max<std::size_t>(clip_from_unit.size(), 1));
    for (glm::vec4& pixel : pixels_)
        pixel = glm::vec4(glm::dvec4(pixel) * share + glm::dvec4(style.background));
    return std::span<const glm::vec4>(pixels_);
}

Result<void> TriangleDrawer::draw_to_window(int width, int height, const glm::mat4& clip_from_unit,
                                            const SurfaceStyle& style) {
    if (auto window = check_window(); !window)
        return window;
    const bool encodes = window_encodes_srgb();
    const auto program = program_for(style, encodes ? Target::window : Target::window_to_encode);
    if (!program)
        return program.error();

    set_fixed_state(width, height);
    glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
    glEnable(GL_MULTISAMPLE);
    if (encodes)
        glEnable(GL_FRAMEBUFFER_SRGB);
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, 0);
    const float background = encodes ? style.background : srgb_encoded(style.background);
    clear(0, glm::vec4(glm::vec3(background), 1), true);
    draw_surface(**program, clip_from_unit, style, 0);
    return {};
}

Result<void> TriangleDrawer::fit_targets(int width, int height) {
    if (sum_.width() == width && sum_.height() == height)
        return {};
    sample_ = {};
    sum_ = {}; // the old ones first, so that both sizes need not fit at a time
    auto sample = Framebuffer::create(width, height, {.depth = true, .label = "sample"});
    if (!sample)
        return sample.error();
    auto sum = Framebuffer::create(width, height, {.depth = false, .label = "sum of samples"});
    if (!sum)
        return sum.error();
    pixels_.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), glm::vec4(0));
    sample_ = std::move(*sample);
    sum_ = std::move(*sum);
    return {};
}

Result<const Program*> TriangleDrawer::program_for(const SurfaceStyle& style, Target target) {
    const bool flat = style.shading == Shading::flat;
    auto& program = programs_[static_cast<std::size_t>(target) * 8 + (style.is_lit ? 4u : 0u) + (flat ? 2u : 0u) + (style.wireframe ? 1u : 0u)];
    if (program)
        return &*program;

    std::vector<std::string_view> defines;
    if (flat)
        defines.push_back("FLAT");
    if (style.wireframe)
        defines.push_back("WIREFRAME");
    if (style.is_lit)
        defines.push_back("LIT");
    if (texture_)
        defines.push_back("TEXTURED");
    if (target != Target::image)
        defines.push_back("WINDOW");
    if (target == Target::window_to_encode)
        defines.push_back("ENCODE_SRGB");

    std::vector<ShaderSource> sources = {{ShaderSource::Stage::vertex, shaders::surface_vert},
                                         {ShaderSource::Stage::fragment, shaders::surface_frag}};
    if (flat || style.wireframe)
        sources.push_back({ShaderSource::Stage::geometry, shaders::surface_geom});
    auto built = Program::build("surface", sources, defines);
    if (!built)
        return built.error();
    program = std::move(*built);
    return &*program;
}

void TriangleDrawer::draw_surface(const Program& program, const glm::mat4& clip_from_unit,
                                  const SurfaceStyle& style, float lod_bias) const {
    if (indices_.count() == 0)
        return;
    set_surface_state(style.cull);
    program.set(clip_from_unit_location, clip_from_unit);
    program.set(lowest_shade_location, style.is_lit ? glm::vec4(0) : lowest_shade_);
    // A texture that is lit is cut off at white behind it.
    const glm::vec4 highest_lit = texture_ ? glm::vec4(brightest_light) : highest_hue_;
    program.set(highest_shade_location, style.is_lit ? highest_lit : highest_shade_);
    if (style.is_lit) {
        program.set(material_location, lights_.material);
        program.set(eye_location, lights_.eye);
        if (!lights_.lights.empty())
            program.set(lights_location, lights_.lights);
    }
    if (texture_) {
        program.set(lod_bias_location, lod_bias);
        program.set(uv_bounds_location, texture_->uv_bounds());
        texture_->bind();
    }
    program.use();
    glBindVertexArray(surface_arrays_.id());
    for (std::uint64_t first = 0; first < indices_.count(); first += most_indices_a_call) {
        const std::uint64_t count = std::min(most_indices_a_call, indices_.count() - first);
        glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(count), GL_UNSIGNED_INT,
                       reinterpret_cast<const void*>(static_cast<std::uintptr_t>(first * sizeof(std::uint32_t))));
    }
    glBindVertexArray(0);
}

void TriangleDrawer::add_sample_to_sum(float background) const {
    set_sum_state();
    glBindTextureUnit(0, sample_.colour_texture());
    accumulate_->set(background_location, background);
    accumulate_->use();
    glBindVertexArray(no_arrays_.id());
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glBindVertexArray(0);
}

} // namespace unseen::render
