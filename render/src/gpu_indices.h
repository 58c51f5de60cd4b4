// The index buffer on the GPU: kept current by what changed, or brought there as a whole.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include <unseen/vdtree/cut.h>

#include "gl.h"
#include "program.h"

namespace unseen::render {

// The buffer lies in the GPU's own memory, which drawing reads fastest. Changes go through a small buffer that stays
// mapped. The CPU writes pairs of place and value to the next of its parts. It waits only where the GPU has not yet
// read what was there three parts ago. A compute pass puts the values in their places, in order with the drawing before
// and after it. The bytes that are uploaded are those of the changes. Where a whole buffer is less, or the GPU maps
// nothing, the whole is uploaded. The small buffer and the pass are made for the first change. Move-only; needs a
// current context for everything.
class GpuIndices {
public:
    explicit GpuIndices(Programs& programs) : programs_(&programs) {} // which outlive it; does no GL

    // Fails where the memory does not suffice; then there are no indices.
    Result<void> update(const vdtree::Cut& cut);

    unsigned buffer() const noexcept { return buffer_.id(); } // another one after it has grown; 0 at first
    std::uint64_t count() const noexcept { return count_; }
    std::uint64_t uploaded_bytes() const noexcept { return uploaded_bytes_; } // by the last update
    std::uint64_t changes() const noexcept { return changes_; }               // how often an update found other indices

private:
    struct DeleteSync {
        void operator()(GLsync sync) const { glDeleteSync(sync); }
    };
    using Fence = std::unique_ptr<std::remove_pointer_t<GLsync>, DeleteSync>;
    struct Write {
        std::uint32_t place = 0, value = 0;
    };
    static constexpr std::size_t part_count = 3; // of the frames that a driver is usually ahead
    static constexpr std::size_t part_writes = std::size_t{1} << 16;

    Result<void> prepare_patching();
    Result<void> upload_all(std::span<const std::uint32_t> indices);
    Result<void> reserve(std::uint64_t count, bool keep);
    bool can_follow(const vdtree::Cut& cut) const;
    void patch(std::span<const vdtree::IndexWrite> writes, std::span<const std::uint32_t> indices);
    void apply(std::size_t part, std::size_t writes);

    Programs* programs_;
    Buffer buffer_;
    std::uint64_t capacity_ = 0, count_ = 0; // indices
    std::uint64_t version_ = 0;
    std::uint64_t uploaded_bytes_ = 0;
    std::uint64_t changes_ = 0;

    const Program* patch_ = nullptr; // null: nothing was patched yet
    Buffer staging_;
    Write* mapped_ = nullptr; // null: not to be had
    std::array<Fence, part_count> in_use_;
    std::size_t next_part_ = 0;
    std::uint64_t window_indices_ = 0; // as many as a shader may see at a time
};

void draw_triangles(const Program& program, const VertexArray& arrays, const GpuIndices& indices);

// Shaders see a buffer through windows, which begin where a binding may begin. How many elements one of them holds, each
// of so many bytes.
std::uint64_t elements_in_a_window(std::uint64_t element_bytes);
// Runs a compute program in groups of 64 over `count` changes, once for each window onto a buffer of `size` elements:
// nearly always one.
void run_on_windows(const Program& program, std::size_t count, unsigned buffer, std::uint64_t size,
                    std::uint64_t element_bytes, std::uint64_t window);

} // namespace unseen::render
