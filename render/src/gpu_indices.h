// The index buffer of a cut on the GPU: made there from what changed, or brought there as a whole.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <unseen/vdtree/active_triangles.h>

#include "gl.h"
#include "program.h"

namespace unseen::render {

// While little changes from one update to the next, the GPU holds the cut as vdtree::ActiveTriangles does. What changes is
// uploaded, 16 bytes each; a compute pass takes it up, and another one makes the index buffer. After a jump, for small
// cuts, and where the processor draws, the index buffer is uploaded as a whole. Cuts that do not move have nothing else.
// Where this GL has no room for more, it is so, too, and why_whole() says why. Move-only; needs a current context for
// everything.
class GpuIndices {
public:
    // `makes`: see Context::Impl. Does no GL. The programs outlive it.
    GpuIndices(Programs& programs, bool makes) : programs_(&programs), makes_(makes) {}

    // Fails where the memory does not suffice; then there are no indices.
    Result<void> update(const vdtree::Cut& cut);

    unsigned buffer() const noexcept { return buffer_.id(); } // another one after it has grown; 0 at first
    std::uint64_t count() const noexcept { return count_; }
    std::uint64_t uploaded_bytes() const noexcept { return uploaded_bytes_; } // by the last update
    std::uint64_t changes() const noexcept { return changes_; }               // how often an update found another cut
    const std::string& why_whole() const noexcept { return why_whole_; } // empty: it need not be uploaded as a whole

private:
    // The cut as the GPU holds it.
    struct Form {
        explicit Form(const vdtree::VertexTree& tree) : triangles(tree) {}
        vdtree::ActiveTriangles triangles;
        const Program *take_up = nullptr, *index = nullptr;
        Buffer changes, corners, wedges;
        std::uint64_t capacity = 0; // triangles that `corners` has room for
    };

    Result<void> reserve(std::uint64_t count);
    Result<void> upload_all(std::span<const std::uint32_t> indices);
    bool is_worth_following(const vdtree::Cut& cut) const;
    Result<void> follow(const vdtree::Cut& cut);
    Result<void> make_form(const vdtree::VertexTree& tree);
    Result<void> upload_form();
    void upload_changes();
    void make_indices();

    Programs* programs_;
    bool makes_;
    Buffer buffer_;
    std::uint64_t capacity_ = 0, count_ = 0; // indices
    std::uint64_t revision_ = 0;             // of the cut; 0: of none
    std::uint64_t uploaded_bytes_ = 0;
    std::uint64_t changes_ = 0;
    std::optional<Form> form_; // made for the first change
    std::string why_whole_;
};

void draw_triangles(const Program& program, const VertexArray& arrays, const GpuIndices& indices);

} // namespace unseen::render
