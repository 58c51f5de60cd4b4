#include "gpu_indices.h"

#include <algorithm>

#include "shaders.h"

namespace unseen::render {
namespace {

constexpr std::uint64_t index_bytes = sizeof(std::uint32_t), triangle_bytes = sizeof(vdtree::Triangle);
// Of change_cut.comp and index_cut.comp.
constexpr GLuint changes_binding = 0, corners_binding = 1, wedges_binding = 2, indices_binding = 3;
constexpr int count_location = 0;
struct Change {
    std::uint32_t values[4];
};
constexpr std::uint32_t is_run = 0xffffffffu;
constexpr vdtree::Index leaves_a_change = 64; // a thread writes at most as many

// Smaller cuts take less time as a whole than two passes do.
constexpr vdtree::Index least_followed = 4096; // triangles
// Where a larger share of the nodes changes, everything is listed and uploaded anew anyway.
constexpr std::uint64_t triangles_per_change = 20;

// False where the memory does not suffice.
bool store(const Buffer& buffer, std::uint64_t bytes, const void* data) {
    glNamedBufferData(buffer.id(), static_cast<GLsizeiptr>(bytes), data, GL_STREAM_DRAW);
    return glGetError() != GL_OUT_OF_MEMORY;
}

void bind(GLuint at, const Buffer& buffer) { glBindBufferBase(GL_SHADER_STORAGE_BUFFER, at, buffer.id()); }
void unbind(std::initializer_list<GLuint> all) {
    for (const GLuint at : all) glBindBufferBase(GL_SHADER_STORAGE_BUFFER, at, 0);
}

// A thread for each of `count`, or each in turn for several of them.
void compute(const Program& program, std::uint64_t count, std::uint64_t group_size) {
    constexpr std::uint64_t most_groups = 65535; // GL promises as many
    program.set(count_location, static_cast<unsigned>(count));
    program.use();
    glDispatchCompute(static_cast<GLuint>(std::min((count + group_size - 1) / group_size, most_groups)), 1, 1);
}

Error no_room(std::string_view what) {
    return {ErrorCode::unsupported, "The graphics driver gives " + std::string(what)};
}

} // namespace

void draw_triangles(const Program& program, const VertexArray& arrays, const GpuIndices& indices) {
    constexpr std::uint64_t most_indices_a_call = 3ull << 28; // a multiple of 3 that fits GLsizei
    program.use();
    glVertexArrayElementBuffer(arrays.id(), indices.buffer());
    glBindVertexArray(arrays.id());
    for (std::uint64_t first = 0; first < indices.count(); first += most_indices_a_call)
        glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(std::min(most_indices_a_call, indices.count() - first)),
                       GL_UNSIGNED_INT,
                       reinterpret_cast<const void*>(static_cast<std::uintptr_t>(first * index_bytes)));
    glBindVertexArray(0);
}

Result<void> GpuIndices::update(const vdtree::Cut& cut) {
    uploaded_bytes_ = 0;
    if (cut.revision() == revision_) return {};
    ++changes_;
    const bool follows = is_worth_following(cut);
    revision_ = 0; // until it is done
    if (follows) {
        if (const auto followed = follow(cut); !followed) {
            form_.reset();
            why_whole_ = followed.error().message;
        }
    }
    if (!follows || !form_)
        if (auto uploaded = upload_all(cut.indices()); !uploaded) return uploaded;
    revision_ = cut.revision();
    return {};
}

bool GpuIndices::is_worth_following(const vdtree::Cut& cut) const {
    return makes_ && cut.changes_from() == revision_ && why_whole_.empty() && cut.triangle_count() >= least_followed &&
           cut.changes().size() * triangles_per_change < cut.triangle_count();
}

// A half more than is asked for, so that cuts that grow need not move each time.
Result<void> GpuIndices::reserve(std::uint64_t count) {
    count_ = 0;
    if (count <= capacity_) return {};
    capacity_ = count + count / 2;
    buffer_ = Buffer::create("triangles");
    glNamedBufferStorage(buffer_.id(), static_cast<GLsizeiptr>(capacity_ * index_bytes), nullptr,
                         GL_DYNAMIC_STORAGE_BIT);
    if (glGetError() != GL_OUT_OF_MEMORY) return {};
    capacity_ = 0;
    buffer_ = {};
    return Error{ErrorCode::unsupported,
                 "The graphics memory does not hold the cut's " + std::to_string(count / 3) + " triangles; fold more."};
}

Result<void> GpuIndices::upload_all(std::span<const std::uint32_t> indices) {
    if (auto reserved = reserve(indices.size()); !reserved) return reserved;
    count_ = indices.size();
    if (indices.empty()) return {};
    glInvalidateBufferData(buffer_.id()); // so that the driver need not wait for the last frame
    glNamedBufferSubData(buffer_.id(), 0, static_cast<GLsizeiptr>(indices.size_bytes()), indices.data());
    uploaded_bytes_ = indices.size_bytes();
    return {};
}

Result<void> GpuIndices::follow(const vdtree::Cut& cut) {
    if (!form_)
        if (auto made = make_form(cut.tree()); !made) return made;
    Form& form = *form_;
    const bool is_known = form.triangles.update(cut);
    const std::uint64_t count = form.triangles.leaves_at_corners().size();
    if (auto reserved = reserve(3 * count); !reserved) return reserved;
    GLint64 most_bytes = 0;
    glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &most_bytes);
    if (static_cast<std::uint64_t>(most_bytes) <
        std::max(capacity_, std::uint64_t{cut.tree().leaf_count()}) * index_bytes)
        return no_room("shaders " + std::to_string(most_bytes / 1'000'000) +
                       " MB of a buffer, which is less than the index buffer or the tree's leaves take.");
    if (!is_known || count > form.capacity) {
        if (auto uploaded = upload_form(); !uploaded) return uploaded;
    } else {
        upload_changes();
    }
    count_ = 3 * count;
    if (count > 0) make_indices();
    return {};
}

void GpuIndices::make_indices() {
    constexpr std::uint64_t group_size = 256; // of index_cut.comp
    bind(corners_binding, form_->corners);
    bind(wedges_binding, form_->wedges);
    bind(indices_binding, buffer_);
    compute(*form_->index, count_, group_size);
    unbind({corners_binding, wedges_binding, indices_binding});
    // For the draw, for uploads of the whole, and for the passes of the next update.
    glMemoryBarrier(GL_ELEMENT_ARRAY_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT | GL_SHADER_STORAGE_BARRIER_BIT);
}

Result<void> GpuIndices::make_form(const vdtree::VertexTree& tree) {
    Form& form = form_.emplace(tree);
    const auto program = [&](std::string_view label, std::string_view text) -> Result<const Program*> {
        const ShaderSource source[] = {{ShaderSource::Stage::compute, text}};
        return programs_->named(label, source);
    };
    const auto take_up = program("change cut", shaders::change_cut_comp);
    if (!take_up) return take_up.error();
    const auto index = program("index cut", shaders::index_cut_comp);
    if (!index) return index.error();
    form.take_up = *take_up;
    form.index = *index;
    form.changes = Buffer::create("changes of a cut");
    form.corners = Buffer::create("leaves of triangles");
    form.wedges = Buffer::create("wedges of leaves");
    return {};
}

Result<void> GpuIndices::upload_form() {
    Form& form = *form_;
    const auto corners = form.triangles.leaves_at_corners();
    const auto wedges = form.triangles.wedges_of_leaves();
    form.capacity = corners.size() + corners.size() / 2;
    if (!store(form.corners, form.capacity * triangle_bytes, nullptr) ||
        !store(form.wedges, wedges.size_bytes(), wedges.data()))
        return no_room("no memory for what a cut's index buffer is made from there.");
    glNamedBufferSubData(form.corners.id(), 0, static_cast<GLsizeiptr>(corners.size_bytes()), corners.data());
    uploaded_bytes_ = corners.size_bytes() + wedges.size_bytes();
    return {};
}

void GpuIndices::upload_changes() {
    Form& form = *form_;
    std::vector<Change> changes;
    const auto corners = form.triangles.leaves_at_corners();
    for (const vdtree::Index slot : form.triangles.changed_slots())
        changes.push_back({{slot, corners[slot][0], corners[slot][1], corners[slot][2]}});
    for (const vdtree::LeafRun& run : form.triangles.changed_runs())
        for (vdtree::Index done = 0; done < run.count; done += leaves_a_change)
            changes.push_back({{run.first + done, std::min(run.count - done, leaves_a_change), run.wedge, is_run}});
    if (changes.empty()) return;
    uploaded_bytes_ = changes.size() * sizeof(Change);
    // A new store each time, so that the driver need not wait for the last frame.
    glNamedBufferData(form.changes.id(), static_cast<GLsizeiptr>(uploaded_bytes_), changes.data(), GL_STREAM_DRAW);
    constexpr std::uint64_t group_size = 64; // of change_cut.comp
    bind(changes_binding, form.changes);
    bind(corners_binding, form.corners);
    bind(wedges_binding, form.wedges);
    compute(*form.take_up, changes.size(), group_size);
    unbind({changes_binding, corners_binding, wedges_binding});
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
}

} // namespace unseen::render
