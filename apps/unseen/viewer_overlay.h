// Text and rings over the viewer's picture, made again where they change.
#pragma once

#include <string>
#include <vector>

#include <glm/vec2.hpp>

#include <unseen/render/internal/overlay.h>

#include "screen_text.h"

namespace unseen::app {

// A closed line through pixels of the window.
struct Ring {
    std::vector<glm::dvec2> points;
    bool is_dashed = false;
    bool operator==(const Ring&) const = default;
};

// What lies over a frame. What is empty is not there.
struct OverlayContent {
    std::vector<TextLine> status; // top left
    std::vector<TextLine> keys;   // below it
    std::string message;          // bottom left, above all else
    std::vector<Ring> rings;
    double line_px = 18; // of text
};

class ViewerOverlay {
public:
    explicit ViewerOverlay(const render::Context& context);

    Result<void> draw(render::Target& window, const OverlayContent& content);

private:
    // What an overlay shows: `content`, which is lines of text or a ring.
    template <class Content>
    struct Shown {
        explicit Shown(const render::Context& context) : overlay(context) {}

        render::Overlay overlay;
        Content content;
        double line_px = 0;
        glm::dvec2 room_px = glm::dvec2(0); // that it had
        glm::ivec2 size = glm::ivec2(0), corner = glm::ivec2(0);
    };
    using Panel = Shown<std::vector<TextLine>>;
    using DrawnRing = Shown<Ring>;
    template <class Content>
    static Result<void> fill(Shown<Content>& shown, const Content& content, double line_px, glm::dvec2 room_px);

    render::Context context_;
    Panel status_, keys_, message_;
    std::vector<DrawnRing> rings_;
};

} // namespace unseen::app
