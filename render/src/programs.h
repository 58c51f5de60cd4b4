// The programs of a context, compiled when they are first asked for.
#pragma once

#include <compare>
#include <map>
#include <span>
#include <string_view>

#include "program.h"

namespace unseen::render {

// Where a surface's colours go.
enum class Output {
    linear,  // as they are, with the luminance in a
    display, // opaque; the framebuffer encodes them
    encoded, // opaque, encoded as sRGB by the shader
    depth,   // nowhere: only depth is drawn
};

struct ProgramKey {
    bool lit = false, textured = false, flat = false, wireframe = false;
    Output output = Output::linear;
    bool compares = false; // drops pixels that look like a picture: compare.frag
    bool stippled = false; // drops pixels of a pattern: stipple.frag; not of what compares
    int casting = 0;       // lights that cast shadows, and are drawn with them
    bool mask = false;     // writes the shadows' mask as well
    bool share = false;    // writes which share of its light comes to a surface, and nothing else
    auto operator<=>(const ProgramKey&) const = default;
};

// Programs stay where they are as long as this does. Needs a current context for everything.
class Programs {
public:
    Result<const Program*> surface(ProgramKey key);
    std::size_t surface_count() const noexcept { return surfaces_.size(); }

    // The one program of this label, a literal.
    Result<const Program*> named(std::string_view label, std::span<const ShaderSource> sources,
                                 std::span<const std::string_view> defines = {});

private:
    std::map<ProgramKey, Program> surfaces_;
    std::map<std::string_view, Program> named_;
};

} // namespace unseen::render
