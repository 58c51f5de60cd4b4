// Text, lines and pictures on one image, by cairo.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <glm/gtc/type_precision.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <unseen/perception/image.h>

struct _cairo;
struct _cairo_surface;

namespace unseen::app {

// Where a line of text is held.
enum class Align { left, centre, right };

// Colours are code values 0..1, what a PNG holds, and kept to 8 bits. Places are in pixels from the top left corner of
// the surface, those of pixels at half. What lies outside is clipped. Not for several threads at once.
class Drawing {
public:
    // Fails where a side is not in 1..32767 pixels, and where there is not enough memory.
    static Result<Drawing> create(int width, int height, glm::vec3 background);
    // An image that is transparent where nothing is drawn, to be laid over others: see layer_pixels().
    static Result<Drawing> layer(int width, int height);

    int width() const noexcept { return width_; }
    int height() const noexcept { return height_; }

    void fill(glm::dvec2 corner, glm::dvec2 size, glm::vec3 colour);
    // With round corners; the share `colour.a` covers what is there.
    void round_fill(glm::dvec2 corner, glm::dvec2 size, double radius, glm::vec4 colour);
    // From point to point, antialiased, with round ends.
    void line(std::span<const glm::dvec2> points, glm::vec3 colour, double width = 1, bool dashed = false);
    void line(glm::dvec2 from, glm::dvec2 to, glm::vec3 colour, double width = 1, bool dashed = false);
    // One line of UTF-8 (what is none comes out as question marks), `height_px` from the top of its letters to the
    // bottom. `at` is the top left corner of it, or the middle of its upper edge, or the top right corner.
    void text(glm::dvec2 at, std::string_view text, glm::vec3 colour, double height_px, Align align = Align::left);
    // Copies an image of code values, grey or RGB.
    void picture(glm::dvec2 corner, const perception::Image& picture);

    // From now on nothing is drawn outside of the box.
    void clip(glm::dvec2 corner, glm::dvec2 size);
    void end_clip();

    // What was drawn, of an image; of a layer, over black. Errors are those of drawing.
    Result<perception::Image> image() const;
    // The same as a file of whatever kind the ending says. It is replaced whole or not at all.
    Result<void> write(const std::filesystem::path& file) const;
    // Codes, and how much of the pixel they cover, which is not multiplied in; row-major from the top left.
    Result<std::vector<glm::u8vec4>> layer_pixels() const;

    // How wide text() comes out; where it is wider than `most`, the height at which it fits.
    static double text_width(std::string_view text, double height_px);
    static double fitting_height(std::string_view text, double height_px, double most_width);

private:
    struct End {
        void operator()(_cairo* context) const;
        void operator()(_cairo_surface* surface) const;
    };
    Drawing() = default;
    static Result<Drawing> on_image(int width, int height, bool is_transparent);
    // What cairo holds of each pixel, row by row from the top left.
    Result<std::vector<std::uint32_t>> pixels() const;

    int width_ = 0, height_ = 0;
    std::unique_ptr<_cairo_surface, End> surface_;
    std::unique_ptr<_cairo, End> context_;
};

} // namespace unseen::app
