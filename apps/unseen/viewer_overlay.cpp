#include "viewer_overlay.h"

#include <algorithm>
#include <cmath>

namespace unseen::app {
namespace {

// In line heights.
constexpr double panel_margin = 0.6, ring_width = 0.11;
constexpr double most_of_height = 1.0 / 3; // of the window's, for the status

Result<Layer> layer_of(const std::vector<TextLine>& lines, double line_px, glm::dvec2 room_px) {
    return text_panel(lines, line_px, room_px);
}
Result<Layer> layer_of(const Ring& ring, double line_px, glm::dvec2 window_px) {
    return outline(ring.points, std::max(1.0, ring_width * line_px), ring.is_dashed, glm::ivec2(window_px));
}

} // namespace

ViewerOverlay::ViewerOverlay(const render::Context& context)
    : context_(context), status_(context), keys_(context), message_(context) {}

template <class Content>
Result<void> ViewerOverlay::fill(Shown<Content>& shown, const Content& content, double line_px, glm::dvec2 room_px) {
    if (shown.content == content && shown.line_px == line_px && shown.room_px == room_px) return {};
    const auto layer = layer_of(content, line_px, room_px);
    if (!layer) return layer.error();
    if (auto set = shown.overlay.set_image({layer->width, layer->height, layer->pixels}); !set) return set;
    shown.content = content;
    shown.line_px = line_px;
    shown.room_px = room_px;
    shown.size = {layer->width, layer->height};
    shown.corner = layer->corner;
    return {};
}

Result<void> ViewerOverlay::draw(render::Target& window, const OverlayContent& content) {
    const glm::ivec2 size(window.width(), window.height());
    rings_.erase(rings_.begin() + static_cast<std::ptrdiff_t>(std::min(rings_.size(), content.rings.size())),
                 rings_.end());
    while (rings_.size() < content.rings.size()) rings_.emplace_back(context_);
    for (std::size_t i = 0; i < rings_.size(); ++i) {
        if (auto filled = fill(rings_[i], content.rings[i], content.line_px, size); !filled) return filled;
        if (auto drawn = rings_[i].overlay.draw(window, rings_[i].corner); !drawn) return drawn;
    }

    // The status, below it the keys; the message at the bottom, and over both where there is no room beside.
    const int edge = static_cast<int>(std::lround(panel_margin * content.line_px));
    const glm::dvec2 room = glm::max(glm::dvec2(size - 2 * edge), 0.0);
    std::vector<TextLine> message;
    for (std::string& line : wrapped(content.message, content.line_px, 0.9 * room.x))
        message.push_back({std::move(line)});
    const glm::dvec2 top(room.x, room.y * most_of_height);
    if (auto filled = fill(status_, content.status, content.line_px, top); !filled) return filled;
    const int below = edge + status_.size.y + (status_.size.y > 0 ? edge / 2 : 0);
    const glm::dvec2 rest(room.x, std::max(0, size.y - below - edge));
    if (auto filled = fill(keys_, content.keys, content.line_px, rest); !filled) return filled;
    if (auto filled = fill(message_, message, content.line_px, room); !filled) return filled;
    if (auto drawn = status_.overlay.draw(window, {edge, edge}); !drawn) return drawn;
    if (auto drawn = keys_.overlay.draw(window, {edge, below}); !drawn) return drawn;
    return message_.overlay.draw(window, {edge, size.y - edge - message_.size.y});
}

} // namespace unseen::app
