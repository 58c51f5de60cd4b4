#include "gpu_indices.h"

#include <algorithm>
#include <numeric>

#include "shaders.h"

namespace unseen::render {
namespace {

constexpr std::uint64_t index_bytes = sizeof(std::uint32_t);
constexpr GLuint64 wait_ns = 1'000'000'000; // a turn of waiting for the GPU; it repeats
constexpr GLuint writes_binding = 0, window_binding = 1;
constexpr int write_count_location = 0, window_first_location = 1, window_size_location = 2;

void wait_for(GLsync fence) {
    GLenum state = GL_TIMEOUT_EXPIRED;
    while (state == GL_TIMEOUT_EXPIRED) state = glClientWaitSync(fence, GL_SYNC_FLUSH_COMMANDS_BIT, wait_ns);
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

std::uint64_t elements_in_a_window(std::uint64_t element_bytes) {
    GLint64 most_bytes = 0;
    GLint alignment = 1;
    glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &most_bytes);
    glGetIntegerv(GL_SHADER_STORAGE_BUFFER_OFFSET_ALIGNMENT, &alignment);
    const auto step = std::lcm(static_cast<std::uint64_t>(std::max(alignment, 1)), element_bytes);
    return static_cast<std::uint64_t>(most_bytes) / step * step / element_bytes;
}

void run_on_windows(const Program& program, std::size_t count, unsigned buffer, std::uint64_t size,
                    std::uint64_t element_bytes, std::uint64_t window) {
    constexpr unsigned group_size = 64; // of patch.comp and move.comp
    program.set(write_count_location, static_cast<unsigned>(count));
    program.use();
    for (std::uint64_t first = 0; first < size; first += window) {
        const std::uint64_t in_window = std::min(window, size - first);
        program.set(window_first_location, static_cast<unsigned>(first));
        program.set(window_size_location, static_cast<unsigned>(in_window));
        glBindBufferRange(GL_SHADER_STORAGE_BUFFER, window_binding, buffer,
                          static_cast<GLintptr>(first * element_bytes),
                          static_cast<GLsizeiptr>(in_window * element_bytes));
        glDispatchCompute(static_cast<GLuint>((count + group_size - 1) / group_size), 1, 1);
    }
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, window_binding, 0);
}

Result<void> GpuIndices::prepare_patching() {
    if (patch_) return {};
    const ShaderSource source[] = {{ShaderSource::Stage::compute, shaders::patch_comp}};
    const auto patch = programs_->named("patch indices", source);
    if (!patch) return patch.error();
    patch_ = *patch;
    window_indices_ = elements_in_a_window(index_bytes);
    constexpr GLbitfield access = GL_MAP_WRITE_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    constexpr auto bytes = static_cast<GLsizeiptr>(part_count * part_writes * sizeof(Write));
    staging_ = Buffer::create("changes of triangles");
    glNamedBufferStorage(staging_.id(), bytes, nullptr, access);
    mapped_ = static_cast<Write*>(glMapNamedBufferRange(staging_.id(), 0, bytes, access));
    return {};
}

Result<void> GpuIndices::update(const vdtree::Cut& cut) {
    const auto indices = cut.indices(); // first: the rest is about what it returned
    const std::uint64_t version = cut.index_version();
    uploaded_bytes_ = 0;
    if (version != 0 && version == version_) return {};
    ++changes_;
    const bool follows = can_follow(cut);
    version_ = 0; // until it is done
    if (follows)
        if (auto prepared = prepare_patching(); !prepared) return count_ = 0, prepared;
    if (follows && mapped_ && window_indices_ > 0) {
        if (auto reserved = reserve(indices.size(), true); !reserved) return reserved;
        patch(*cut.index_writes(), indices);
    } else if (auto uploaded = upload_all(indices); !uploaded) {
        return uploaded;
    }
    count_ = indices.size();
    version_ = version;
    return {};
}

// The changes lead here, and are less than the whole.
bool GpuIndices::can_follow(const vdtree::Cut& cut) const {
    const auto writes = cut.index_writes();
    return version_ != 0 && writes && cut.index_writes_from() == version_ &&
           writes->size() * sizeof(Write) < cut.indices().size_bytes();
}

// A half more than is asked for, so that cuts that grow need not move each time.
Result<void> GpuIndices::reserve(std::uint64_t count, bool keep) {
    if (count <= capacity_) return {};
    const std::uint64_t wanted = count + count / 2;
    Buffer larger = Buffer::create("triangles");
    glNamedBufferStorage(larger.id(), static_cast<GLsizeiptr>(wanted * index_bytes), nullptr, GL_DYNAMIC_STORAGE_BIT);
    if (glGetError() == GL_OUT_OF_MEMORY) {
        capacity_ = count_ = 0;
        buffer_ = {};
        return Error{ErrorCode::unsupported, "The graphics memory does not hold the cut's " +
                                                 std::to_string(count / 3) + " triangles; fold more."};
    }
    if (keep && count_ > 0)
        glCopyNamedBufferSubData(buffer_.id(), larger.id(), 0, 0, static_cast<GLsizeiptr>(count_ * index_bytes));
    buffer_ = std::move(larger);
    capacity_ = wanted;
    return {};
}

Result<void> GpuIndices::upload_all(std::span<const std::uint32_t> indices) {
    count_ = 0;
    if (auto reserved = reserve(indices.size(), false); !reserved) return reserved;
    if (indices.empty()) return {};
    glInvalidateBufferData(buffer_.id()); // so that the driver need not wait for the last frame
    glNamedBufferSubData(buffer_.id(), 0, static_cast<GLsizeiptr>(indices.size_bytes()), indices.data());
    uploaded_bytes_ = indices.size_bytes();
    return {};
}

// A place that comes twice gets its last value both times, whichever the GPU does first. What lies beyond the end is
// nobody's.
void GpuIndices::patch(std::span<const vdtree::IndexWrite> writes, std::span<const std::uint32_t> indices) {
    for (std::size_t i = 0; i < writes.size();) {
        const std::size_t part = next_part_;
        next_part_ = (next_part_ + 1) % part_count;
        if (in_use_[part]) wait_for(in_use_[part].get());
        Write* const out = mapped_ + part * part_writes;
        std::size_t count = 0;
        for (; i < writes.size() && count < part_writes; ++i) {
            const std::uint32_t place = writes[i].place;
            if (place < indices.size()) out[count++] = {place, indices[place]};
        }
        apply(part, count);
        in_use_[part].reset(glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0));
        uploaded_bytes_ += count * sizeof(Write);
    }
    glMemoryBarrier(GL_ELEMENT_ARRAY_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
}

void GpuIndices::apply(std::size_t part, std::size_t writes) {
    if (writes == 0) return;
    glBindBufferRange(GL_SHADER_STORAGE_BUFFER, writes_binding, staging_.id(),
                      static_cast<GLintptr>(part * part_writes * sizeof(Write)),
                      static_cast<GLsizeiptr>(writes * sizeof(Write)));
    run_on_windows(*patch_, writes, buffer_.id(), capacity_, index_bytes, window_indices_);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, writes_binding, 0);
}

} // namespace unseen::render
