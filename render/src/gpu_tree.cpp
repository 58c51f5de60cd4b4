// Brings vertices to the GPU, and keeps the triangles of cuts there current.
#include "gpu_tree_impl.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/internal/light_bounds.h>

#include "shaders.h"

namespace unseen::render {
namespace {

constexpr std::size_t upload_batch = 1u << 16; // vertices; bounds the memory that uploading takes

// The colour scaled to the luminance; grey where it has none.
glm::vec3 shaded_colour(glm::vec4 colour, float luminance) {
    const glm::dvec3 rgb(colour);
    const double own = rec709_luminance(rgb);
    if (!(own > 0) || !std::isfinite(own)) return glm::vec3(luminance);
    const glm::dvec3 scaled = rgb * (static_cast<double>(luminance) / own);
    return glm::vec3(scaled);
}

// `colour`: null where there are none.
Vertex vertex_of(const UnitFrame& frame, glm::vec3 position, float luminance, const glm::vec4* colour) {
    const glm::vec3 rgb = colour ? shaded_colour(*colour, luminance) : glm::vec3(luminance);
    const glm::dvec3 in_frame = (glm::dvec3(position) - frame.centre) / frame.unit;
    return {glm::vec3(in_frame), glm::vec4(rgb, luminance)};
}

void describe(GLuint arrays, GLuint buffer, GLuint vertices, GLsizei size) {
    glVertexArrayVertexBuffer(arrays, buffer, vertices, 0, size);
    for (const GLuint attribute : {2 * buffer, 2 * buffer + 1}) {
        glEnableVertexArrayAttrib(arrays, attribute);
        glVertexArrayAttribBinding(arrays, attribute, buffer);
    }
}

void describe_vertices(GLuint arrays, GLuint vertices) {
    describe(arrays, 0, vertices, sizeof(Vertex));
    glVertexArrayAttribFormat(arrays, 0, 3, GL_FLOAT, GL_FALSE, offsetof(Vertex, position));
    glVertexArrayAttribFormat(arrays, 1, 4, GL_FLOAT, GL_FALSE, offsetof(Vertex, shade));
}

void describe_lit_vertices(GLuint arrays, GLuint vertices) {
    describe(arrays, 1, vertices, sizeof(LitVertex));
    glVertexArrayAttribIFormat(arrays, 2, 2, GL_SHORT, offsetof(LitVertex, normal));
    glVertexArrayAttribFormat(arrays, 3, 1, GL_FLOAT, GL_FALSE, offsetof(LitVertex, albedo));
}

Error too_large(const std::string& what) {
    return {ErrorCode::unsupported, "The graphics memory does not hold " + what};
}

// Shaders see a buffer through windows, which begin where a binding may begin. How many vertices one of them holds.
std::uint64_t vertices_in_a_window() {
    GLint64 most_bytes = 0;
    GLint alignment = 1;
    glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &most_bytes);
    glGetIntegerv(GL_SHADER_STORAGE_BUFFER_OFFSET_ALIGNMENT, &alignment);
    const auto step = std::lcm(static_cast<std::uint64_t>(std::max(alignment, 1)), sizeof(Vertex));
    return static_cast<std::uint64_t>(most_bytes) / step * step / sizeof(Vertex);
}

} // namespace

Result<VertexMover> VertexMover::create(Programs& programs) {
    const ShaderSource source[] = {{ShaderSource::Stage::compute, shaders::move_comp}};
    const auto program = programs.named("move vertices", source);
    if (!program) return program.error();
    VertexMover mover(*program);
    mover.moves_ = Buffer::create("moved vertices");
    mover.window_vertices_ = vertices_in_a_window();
    if (mover.window_vertices_ == 0)
        return Error{ErrorCode::unsupported,
                     "The graphics driver gives shaders no buffer for moved vertices; draw without geomorphs."};
    return mover;
}

void VertexMover::move(unsigned vertices, std::uint64_t count, std::span<const VertexMove> moves) {
    // Of move.comp.
    constexpr GLuint moves_binding = 0, window_binding = 1;
    constexpr int move_count_location = 0, window_first_location = 1, window_size_location = 2;
    constexpr std::size_t group_size = 64;
    // As many as one pass takes: GL promises 65535 groups, and 2^24 bytes of a shader's block.
    constexpr std::size_t most_moves = std::size_t{1} << 19;
    program_->use();
    for (; !moves.empty(); moves = moves.subspan(std::min(moves.size(), most_moves))) {
        const auto part = moves.first(std::min(moves.size(), most_moves));
        // A new store each time, so that the driver need not wait for the last frame.
        glNamedBufferData(moves_.id(), static_cast<GLsizeiptr>(part.size_bytes()), part.data(), GL_STREAM_DRAW);
        glBindBufferBase(GL_SHADER_STORAGE_BUFFER, moves_binding, moves_.id());
        program_->set(move_count_location, static_cast<unsigned>(part.size()));
        for (std::uint64_t first = 0; first < count; first += window_vertices_) { // nearly always one window
            const std::uint64_t in_window = std::min(window_vertices_, count - first);
            program_->set(window_first_location, static_cast<unsigned>(first));
            program_->set(window_size_location, static_cast<unsigned>(in_window));
            glBindBufferRange(GL_SHADER_STORAGE_BUFFER, window_binding, vertices,
                              static_cast<GLintptr>(first * sizeof(Vertex)),
                              static_cast<GLsizeiptr>(in_window * sizeof(Vertex)));
            glDispatchCompute(static_cast<GLuint>((part.size() + group_size - 1) / group_size), 1, 1);
        }
    }
    for (const GLuint at : {moves_binding, window_binding}) glBindBufferBase(GL_SHADER_STORAGE_BUFFER, at, 0);
    glMemoryBarrier(GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT | GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
}

GpuTree::Impl::Impl(const Context& context_, const vdtree::VertexTree& tree_)
    : context(context_), tree(tree_.share()), frame(unit_frame(tree.bounds()[tree.root()].ring)), guard(context_) {}

Vertex GpuTree::Impl::vertex(std::size_t i) const {
    return vertex_of(frame, tree.positions()[i], tree.luminance()[i],
                     tree.colours().empty() ? nullptr : &tree.colours()[i]);
}

Result<void> GpuTree::Impl::upload() {
    const std::size_t count = tree.positions().size();
    vertices = Buffer::create("vertices");
    glNamedBufferStorage(vertices.id(), static_cast<GLsizeiptr>(std::max<std::size_t>(count, 1) * sizeof(Vertex)),
                         nullptr, GL_DYNAMIC_STORAGE_BIT);
    if (glGetError() == GL_OUT_OF_MEMORY)
        return too_large("the tree's " + std::to_string(count) + " vertices (" +
                         std::to_string(count * sizeof(Vertex) >> 20) + " MiB).");
    std::vector<Vertex> batch;
    batch.reserve(std::min(count, upload_batch));
    for (std::size_t first = 0; first < count; first += batch.size()) {
        batch.clear();
        for (std::size_t i = first; i < std::min(count, first + upload_batch); ++i) batch.push_back(vertex(i));
        for (const Vertex& vertex : batch) {
            box.include(vertex.position);
            lowest_shade = glm::min(lowest_shade, vertex.shade);
            highest_shade = glm::max(highest_shade, vertex.shade);
            if (vertex.shade.a > 0) highest_hue = glm::max(highest_hue, vertex.shade / vertex.shade.a);
        }
        glNamedBufferSubData(vertices.id(), static_cast<GLintptr>(first * sizeof(Vertex)),
                             static_cast<GLsizeiptr>(batch.size() * sizeof(Vertex)), batch.data());
    }
    arrays = VertexArray::create("surface");
    describe_vertices(arrays.id(), vertices.id());
    if (tree.texture().empty()) return {};
    auto made = SurfaceTexture::create(tree.texture(), tree.uvs());
    if (!made) return made.error();
    texture = std::move(*made);
    texture->describe(arrays.id());
    return {};
}

Result<void> GpuTree::Impl::need_mover() {
    if (mover) return {};
    auto made = VertexMover::create(context.impl().programs);
    if (!made) return made.error();
    mover = std::move(*made);
    return {};
}

Result<void> GpuTree::Impl::need_lit_vertices() {
    if (lit_vertices) return {};
    std::vector<LitVertex> made;
    made.reserve(tree.wedge_count());
    for (vdtree::WedgeId wedge = 0; wedge < tree.wedge_count(); ++wedge)
        made.push_back({tree.normals()[wedge], vdtree::albedo_of(tree, wedge)});
    Buffer buffer = Buffer::create("vertices under lights");
    glNamedBufferStorage(buffer.id(),
                         static_cast<GLsizeiptr>(std::max<std::size_t>(made.size(), 1) * sizeof(LitVertex)),
                         made.data(), 0);
    if (glGetError() == GL_OUT_OF_MEMORY)
        return too_large("the normals of the tree's " + std::to_string(made.size()) +
                         " vertices, which lights and normal maps need.");
    lit_vertices = std::move(buffer);
    describe_lit_vertices(arrays.id(), lit_vertices->id());
    return {};
}

std::uint64_t GpuTree::Impl::put(const Glides& glides) {
    if (glides.version == shown_version) return 0;
    std::vector<VertexMove> moves = glides.moves;
    std::vector<std::uint32_t> now;
    now.reserve(moves.size());
    for (const VertexMove& move : moves) now.push_back(move.vertex);
    std::sort(now.begin(), now.end());
    for (auto next = now.begin(); const std::uint32_t back : moved) { // those that are not moved any more
        next = std::lower_bound(next, now.end(), back);
        if (next == now.end() || *next != back) moves.push_back({back, vertex(back)});
    }
    moved.swap(now);
    shown_version = glides.version;
    mover->move(vertices.id(), tree.positions().size(), moves);
    return moves.size() * sizeof(VertexMove);
}

Result<GpuTree> GpuTree::create(const Context& context, const vdtree::VertexTree& tree) {
    auto impl = std::make_shared<Impl>(context, tree);
    if (auto made = in_context(context, "Bringing the tree to the GPU", [&] { return impl->upload(); }); !made)
        return made.error();
    return GpuTree(std::move(impl));
}

const vdtree::VertexTree& GpuTree::tree() const noexcept { return impl_->tree; }
const Context& GpuTree::context() const noexcept { return impl_->context; }

Result<void> GpuCut::Impl::follow(const vdtree::Cut& cut, std::span<const vdtree::MovedVertex> moved) {
    GpuTree::Impl& of = tree.impl();
    if (std::addressof(cut.tree().data()) != std::addressof(of.tree.data()))
        return Error{ErrorCode::invalid_argument,
                     "The cut belongs to another tree than the one on the GPU; bring that tree there."};
    if (!of.tree.texture().empty() && !moved.empty())
        return Error{ErrorCode::invalid_argument,
                     "Textures do not glide: draw the cut instead of the geomorph, or the tree without its texture."};
    if (!moved.empty())
        if (auto made = of.need_mover(); !made) return made;

    auto updated = indices.update(cut);
    uploaded_bytes = indices.uploaded_bytes();
    glides.moves.clear();
    glides.version = moved.empty() ? 0 : ++of.last_version;
    for (const vdtree::MovedVertex& vertex : moved) {
        const glm::vec4* const colour = of.tree.colours().empty() ? nullptr : &vertex.colour;
        glides.moves.push_back({vertex.wedge, vertex_of(of.frame, vertex.position, vertex.luminance, colour)});
        box.include(glides.moves.back().to.position);
    }
    return updated;
}

GpuCut::GpuCut(const GpuTree& tree) : impl_(std::make_shared<Impl>(tree)) {}

Result<void> GpuCut::follow(const vdtree::Cut& cut) {
    return in_context(tree().context(), "Bringing the cut to the GPU", [&] { return impl_->follow(cut, {}); });
}

Result<void> GpuCut::follow(const vdtree::Geomorph& geomorph) {
    return in_context(tree().context(), "Bringing the geomorph to the GPU",
                      [&] { return impl_->follow(geomorph.drawn(), geomorph.moved()); });
}

const GpuTree& GpuCut::tree() const noexcept { return impl_->tree; }
std::uint64_t GpuCut::uploaded_bytes() const noexcept { return impl_->uploaded_bytes; }
const std::string& GpuCut::why_whole() const noexcept { return impl_->indices.why_whole(); }

} // namespace unseen::render
