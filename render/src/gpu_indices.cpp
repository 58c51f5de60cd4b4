#include "gpu_indices.h"

#include <algorithm>
#include <string>

#include "shaders.h"

namespace unseen::render {
namespace {

constexpr unsigned group_size = 64; // of patch.comp
constexpr std::uint64_t index_bytes = sizeof(std::uint32_t);
constexpr GLuint64 wait_ns = 1'000'000'000; // a turn of waiting for the GPU; it repeats
constexpr GLuint writes_binding = 0, window_binding = 1;
constexpr int write_count_location = 0, window_first_location = 1, window_size_location = 2;

void wait_for(GLsync fence) {
    GLenum state = GL_TIMEOUT_EXPIRED;
    while (state == GL_TIMEOUT_EXPIRED) state = glClientWaitSync(fence, GL_SYNC_FLUSH_COMMANDS_BIT, wait_ns);
}

// Windows onto the index buffer begin where a shader's binding may begin.
std::uint64_t indices_in_a_window() {
    GLint64 most_bytes = 0;
    GLint alignment = 1;
    glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &most_bytes);
    glGetIntegerv(GL_SHADER_STORAGE_BUFFER_OFFSET_ALIGNMENT, &alignment);
    const auto step = std::max<std::uint64_t>(static_cast<std::uint64_t>(alignment), index_bytes);
    return static_cast<std::uint64_t>(most_bytes) / step * step / index_bytes;
}

} // namespace

Result<void> GpuIndices::prepare_patching() {
    if (patch_) return {};
    const ShaderSource source[] = {{ShaderSource::Stage::compute, shaders::patch_comp}};
    const auto patch = programs_->named("patch indices", source);
    if (!patch) return patch.error();
    patch_ = *patch;
    window_indices_ = indices_in_a_window();
    constexpr GLbitfield access = GL_MAP_WRITE_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    constexpr auto bytes = static_cast<GLsizeiptr>(part_count * part_writes * sizeof(Write));
    staging_ = Buffer::create("changes of triangles");
    glNamedBufferStorage(staging_.id(), bytes, nullptr, access);
    mapped_ = static_cast<Write*>(glMapNamedBufferRange(staging_.id(), 0, bytes, access));
    return {};
}

Result<void> GpuIndices::update(const IndexState& state) {
    uploaded_bytes_ = 0;
    if (state.version != 0 && state.version == version_) return {};
    ++changes_;
    const bool follows = can_follow(state);
    version_ = 0; // until it is done
    if (follows)
        if (auto prepared = prepare_patching(); !prepared) return count_ = 0, prepared;
    if (follows && mapped_ && window_indices_ > 0) {
        if (auto reserved = reserve(state.indices.size(), true); !reserved) return reserved;
        patch(*state.writes, state.indices);
    } else if (auto uploaded = upload_all(state.indices); !uploaded) {
        return uploaded;
    }
    count_ = state.indices.size();
    version_ = state.version;
    return {};
}

// The changes lead here, and are less than the whole.
bool GpuIndices::can_follow(const IndexState& state) const {
    return version_ != 0 && state.writes && state.writes_from == version_ &&
           state.writes->size() * sizeof(Write) < state.indices.size_bytes();
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

// One pass for each window onto the index buffer that a shader can see: nearly always one.
void GpuIndices::apply(std::size_t part, std::size_t writes) {
    if (writes == 0) return;
    glBindBufferRange(GL_SHADER_STORAGE_BUFFER, writes_binding, staging_.id(),
                      static_cast<GLintptr>(part * part_writes * sizeof(Write)),
                      static_cast<GLsizeiptr>(writes * sizeof(Write)));
    patch_->set(write_count_location, static_cast<unsigned>(writes));
    patch_->use();
    for (std::uint64_t first = 0; first < capacity_; first += window_indices_) {
        const std::uint64_t size = std::min(window_indices_, capacity_ - first);
        patch_->set(window_first_location, static_cast<unsigned>(first));
        patch_->set(window_size_location, static_cast<unsigned>(size));
        glBindBufferRange(GL_SHADER_STORAGE_BUFFER, window_binding, buffer_.id(),
                          static_cast<GLintptr>(first * index_bytes), static_cast<GLsizeiptr>(size * index_bytes));
        glDispatchCompute(static_cast<GLuint>((writes + group_size - 1) / group_size), 1, 1);
    }
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, writes_binding, 0);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, window_binding, 0);
}

} // namespace unseen::render
