// Each draw of depth is reduced to cells, of which the extremes of all draws are kept.
#include <initializer_list>
#include <unseen/render/depth_cells.h>

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include <unseen/render/sample_sum.h>
#include <unseen/vdtree/internal/errors.h>

#include "gl.h"
#include "sample_count.h"
#include "shaders.h"
#include "surface_pass.h"

namespace unseen::render {
namespace {

constexpr int largest_cell_px = 64;
constexpr int box_location = 0, cell_location = 1;
constexpr GLuint64 wait_ns = 1'000'000'000; // a turn of waiting for the GPU; it repeats
constexpr std::size_t values_a_cell = 4;

struct DeleteSync {
    void operator()(GLsync sync) const { glDeleteSync(sync); }
};
using Fence = std::unique_ptr<std::remove_pointer_t<GLsync>, DeleteSync>;

} // namespace

struct DepthCellReader::Impl {
    Impl(const Context& context_, int width_, int height_, Target cells_, int cell_px_)
        : context(context_), width(width_), height(height_), cells(std::move(cells_)), cell_px(cell_px_) {}
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;
    ~Impl() { static_cast<void>(context.make_current()); } // for the objects, which go next

    Result<void> prepare();
    void clear();
    void reduce(const DrawnDepth& depth);
    void read();
    Result<std::optional<vdtree::DepthCells>> take(bool waits);
    GLsizeiptr bytes() const {
        return static_cast<GLsizeiptr>(sizeof(float) * values_a_cell) * cells.width() * cells.height();
    }

    Context context;             // first, and so gone last
    int width, height;           // pixels
    std::optional<Target> depth; // made for the first picture that is drawn here
    Target cells;
    int cell_px;
    const Program* program = nullptr;
    VertexArray no_arrays; // for the full-screen triangle, which comes from nowhere
    Buffer staging;
    Fence under_way; // signalled once the staging buffer is filled
};

Result<void> DepthCellReader::Impl::prepare() {
    const ShaderSource sources[] = {{ShaderSource::Stage::vertex, shaders::full_screen_vert},
                                    {ShaderSource::Stage::fragment, shaders::depth_cells_frag}};
    const auto made = context.impl().programs.named("depth cells", sources);
    if (!made) return made.error();
    program = *made;
    no_arrays = VertexArray::create("full screen");
    staging = Buffer::create("depth cells");
    glNamedBufferStorage(staging.id(), bytes(), nullptr, GL_MAP_READ_BIT);
    return {};
}

void DepthCellReader::Impl::clear() {
    constexpr float more = std::numeric_limits<float>::max();
    const glm::vec4 nothing(more);
    set_fixed_state(cells.impl());
    glClearNamedFramebufferfv(cells.id(), GL_COLOR, 0, &nothing.x);
}

void DepthCellReader::Impl::reduce(const DrawnDepth& drawn) {
    set_fixed_state(cells.impl());
    glDisable(GL_DEPTH_TEST);
    glDisable(GL_CULL_FACE);
    glEnable(GL_BLEND);
    glBlendEquation(GL_MIN);
    cells.impl().bind(0);
    glBindTextureUnit(0, drawn.texture);
    program->set(box_location, glm::vec4(drawn.left, drawn.top, drawn.right, drawn.bottom));
    program->set(cell_location, glm::vec4(cell_px, 1 / drawn.near_plane, drawn.width, drawn.height));
    program->use();
    glBindVertexArray(no_arrays.id());
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glBindVertexArray(0);
    glBindTextureUnit(0, 0);
    glBlendEquation(GL_FUNC_ADD);
    glDisable(GL_BLEND);
}

void DepthCellReader::Impl::read() {
    glPixelStorei(GL_PACK_ALIGNMENT, 4);
    for (const GLenum zero : std::initializer_list<GLenum>{GL_PACK_ROW_LENGTH, GL_PACK_SKIP_ROWS, GL_PACK_SKIP_PIXELS})
        glPixelStorei(zero, 0);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, cells.id());
    glReadBuffer(GL_COLOR_ATTACHMENT0);
    glBindBuffer(GL_PIXEL_PACK_BUFFER, staging.id());
    glReadPixels(0, 0, cells.width(), cells.height(), GL_RGBA, GL_FLOAT, nullptr);
    glBindBuffer(GL_PIXEL_PACK_BUFFER, 0);
    under_way.reset(glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0));
    glFlush();
}

Result<std::optional<vdtree::DepthCells>> DepthCellReader::Impl::take(bool waits) {
    if (!under_way) return std::optional<vdtree::DepthCells>();
    GLenum state = glClientWaitSync(under_way.get(), GL_SYNC_FLUSH_COMMANDS_BIT, 0);
    while (waits && state == GL_TIMEOUT_EXPIRED)
        state = glClientWaitSync(under_way.get(), GL_SYNC_FLUSH_COMMANDS_BIT, wait_ns);
    if (state == GL_TIMEOUT_EXPIRED) return std::optional<vdtree::DepthCells>();
    under_way.reset();
    const auto* const values = static_cast<const float*>(
        state == GL_WAIT_FAILED ? nullptr : glMapNamedBufferRange(staging.id(), 0, bytes(), GL_MAP_READ_BIT));
    if (!values) return unsupported("The depth cells could not be read back.");
    vdtree::DepthCells found{cell_px, cells.width(), cells.height(), {}, {}, {}};
    const auto count = static_cast<std::size_t>(cells.width()) * static_cast<std::size_t>(cells.height());
    for (std::vector<float>* list : {&found.least, &found.most, &found.jump}) list->resize(count);
    for (std::size_t i = 0; i < count; ++i) {
        const float* const cell = values + values_a_cell * i;
        found.least[i] = cell[0];
        found.most[i] = std::max(-cell[1], 0.0f); // no negative zero
        found.jump[i] = std::max(-cell[2], 0.0f);
    }
    glUnmapNamedBuffer(staging.id());
    return std::optional(std::move(found));
}

Result<DepthCellReader> DepthCellReader::create(const Context& context, int width, int height, int cell_px) {
    if (cell_px < 1 || cell_px > largest_cell_px)
        return invalid_argument("Depth cells are of 1 to " + std::to_string(largest_cell_px) + " pixels a side, not " +
                                std::to_string(cell_px) + ".");
    if (width < 1 || height < 1) return invalid_argument("Depth cells need a window of a pixel or more.");
    auto cells = Target::create(context, (width + cell_px - 1) / cell_px, (height + cell_px - 1) / cell_px,
                                {.depth = false, .label = "depth cells"});
    if (!cells) return cells.error();
    auto impl = std::make_unique<Impl>(context, width, height, std::move(*cells), cell_px);
    if (auto made = in_context(context, "Making depth cells", [&] { return impl->prepare(); }); !made)
        return made.error();
    return DepthCellReader(std::move(impl));
}

DepthCellReader::DepthCellReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
DepthCellReader::DepthCellReader(DepthCellReader&&) noexcept = default;
DepthCellReader& DepthCellReader::operator=(DepthCellReader&&) noexcept = default;
DepthCellReader::~DepthCellReader() = default;

Result<void> DepthCellReader::begin(std::span<const Item> items, const vdtree::View& view, int samples,
                                    std::uint32_t seed) {
    Impl& impl = *impl_;
    if (const auto valid = check_samples(samples); !valid) return valid;
    if (view.width != impl.width || view.height != impl.height)
        return invalid_argument("The depth cells are of another window than the view.");
    const auto nearest = near_plane(items, view);
    if (!nearest) return nearest.error();
    impl.under_way.reset();
    if (!impl.depth) {
        auto made = Target::create(impl.context, impl.width, impl.height, {.colours = {}, .label = "depth for cells"});
        if (!made) return made.error();
        impl.depth = std::move(*made);
    }
    const DrawnDepth drawn{
        impl.depth->depth_texture(), impl.width, impl.height, 0, 0, impl.width, impl.height, *nearest};
    bool is_first = true;
    for (const glm::dvec2 point : n_rooks(samples, seed)) {
        if (auto done = draw(items, {view, point, *nearest}, *impl.depth, {.colour = std::nullopt}); !done) return done;
        auto reduced = in_context(impl.context, "Reducing depth to cells", [&]() -> Result<void> {
            if (is_first) impl.clear();
            impl.reduce(drawn);
            return {};
        });
        if (!reduced) return reduced;
        is_first = false;
    }
    return in_context(impl.context, "Reading depth cells", [&]() -> Result<void> {
        impl.read();
        return {};
    });
}

Result<void> DepthCellReader::begin(const DrawnDepth& depth) {
    Impl& impl = *impl_;
    if (depth.width != impl.width || depth.height != impl.height)
        return invalid_argument("The depth cells are of another window than the depth that was drawn.");
    if (depth.texture == 0 || !(depth.near_plane > 0)) return invalid_argument("No depth was drawn.");
    impl.under_way.reset();
    return in_context(impl.context, "Reducing depth to cells", [&]() -> Result<void> {
        impl.clear();
        impl.reduce(depth);
        impl.read();
        return {};
    });
}

bool DepthCellReader::is_under_way() const noexcept { return impl_->under_way != nullptr; }

Result<std::optional<vdtree::DepthCells>> DepthCellReader::take(bool waits) {
    std::optional<vdtree::DepthCells> found;
    auto done = in_context(impl_->context, "Reading depth cells", [&]() -> Result<void> {
        auto taken = impl_->take(waits);
        if (!taken) return taken.error();
        found = std::move(*taken);
        return {};
    });
    if (!done) return done.error();
    return found;
}

std::uint64_t DepthCellReader::byte_size() const noexcept {
    constexpr std::uint64_t depth_bytes = 4;
    const std::uint64_t pixels =
        impl_->depth ? static_cast<std::uint64_t>(impl_->width) * static_cast<std::uint64_t>(impl_->height) : 0;
    return depth_bytes * pixels + 2 * static_cast<std::uint64_t>(impl_->bytes());
}

} // namespace unseen::render
