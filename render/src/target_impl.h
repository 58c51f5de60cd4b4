// What a target holds.
#pragma once

#include <unseen/render/target.h>

#include "context_impl.h"

namespace unseen::render {

// Fails unless the part is a pixel at least and lies in what is so large; `what`: "the target".
Result<void> check_part(const PixelBox& part, int width, int height, const char* what);

struct Target::Impl {
    Impl(const Context& context_, int width_, int height_)
        : context(context_), width(width_), height(height_), guard(context_) {}

    Result<void> make(const TargetOptions& options);
    Result<void> adopt(const ForeignFramebuffer& foreign);

    // Binds it to draw to one of its attachments, and to no other; with a `mask` to that one as the second.
    void bind(int attachment, std::optional<int> mask = {}) const;
    Result<void> check_attachment(int attachment) const;
    Result<void> check_readable() const;
    Result<void> read_colour(int attachment, const PixelBox& part, std::span<glm::vec4> pixels) const;

    PixelBox whole() const { return {0, 0, width, height}; }

    // How the attachment wants its colours; depth: it has none at all.
    Output output(int attachment) const {
        return outputs.empty() ? Output::depth : outputs[static_cast<std::size_t>(attachment)];
    }

    Context context; // first, and so gone last
    int width, height;
    int samples = 0; // of the hardware, in foreign ones
    unsigned id = 0;
    FramebufferObject framebuffer; // what id names, unless it is foreign
    bool is_foreign = false;
    bool top_row_first = true;
    bool has_depth = true;
    std::vector<Output> outputs; // of the attachments
    std::vector<Texture2d> colours;
    Texture2d depth;
    ContextGuard guard;
};

} // namespace unseen::render
