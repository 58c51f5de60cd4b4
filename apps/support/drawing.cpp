#include "drawing.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <vector>

#include <cairo.h>

#include "printable.h"

namespace unseen::app {
namespace {

constexpr int largest_side = 32767;         // of cairo's images
constexpr const char* font = "DejaVu Sans"; // without it, what fontconfig has in its place
constexpr double dash_px[] = {7, 7}; // with the round ends of a line two pixels wide: nine, and five between them

std::string shown_size(int width, int height) { return std::to_string(width) + " x " + std::to_string(height); }

Error failure(cairo_status_t status, int width, int height) {
    return {status == CAIRO_STATUS_NO_MEMORY ? ErrorCode::unsupported : ErrorCode::invalid_argument,
            "Cannot draw " + shown_size(width, height) + " pixels: " + cairo_status_to_string(status) + "."};
}

// Cairo takes nothing else, and draws nothing any more once it was given something else.
std::string as_utf8(std::string_view text) {
    std::string clean;
    while (!text.empty()) {
        const std::size_t length = printable_bytes(text);
        clean += length > 0 ? text.substr(0, length) : "?";
        text.remove_prefix(std::max<std::size_t>(length, 1));
    }
    return clean;
}

// Chooses the font without hints, so that text scales with its height.
void choose_font(cairo_t* context, double height_px) {
    cairo_select_font_face(context, font, CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_font_options_t* options = cairo_font_options_create();
    cairo_font_options_set_hint_style(options, CAIRO_HINT_STYLE_NONE);
    cairo_font_options_set_hint_metrics(options, CAIRO_HINT_METRICS_OFF);
    cairo_font_options_set_antialias(options, CAIRO_ANTIALIAS_GRAY);
    cairo_set_font_options(context, options);
    cairo_font_options_destroy(options);
    cairo_set_font_size(context, 1000);
    cairo_font_extents_t extents;
    cairo_font_extents(context, &extents);
    cairo_set_font_size(context, 1000 * height_px / (extents.ascent + extents.descent));
}

void set_colour(cairo_t* context, glm::vec3 colour) {
    cairo_set_source_rgb(context, static_cast<double>(colour.r), static_cast<double>(colour.g),
                         static_cast<double>(colour.b));
}

double advance_of(cairo_t* context, const std::string& text) {
    cairo_text_extents_t extents;
    cairo_text_extents(context, text.c_str(), &extents);
    return std::max(extents.x_advance, extents.x_bearing + extents.width);
}

std::uint32_t code_of(float value) {
    return static_cast<std::uint32_t>(value > 0 ? std::min(value, 1.0f) * 255 + 0.5f : 0);
} // 0 for NaN

} // namespace

void Drawing::End::operator()(cairo_t* context) const { cairo_destroy(context); }
void Drawing::End::operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }

Result<Drawing> Drawing::on_image(int width, int height, bool is_transparent) {
    if (!(width >= 1 && height >= 1 && width <= largest_side && height <= largest_side))
        return Error{ErrorCode::invalid_argument, "Cannot draw " + shown_size(width, height) +
                                                      " pixels: a picture with text has 1 to " +
                                                      std::to_string(largest_side) + " a side."};
    Drawing drawing;
    drawing.width_ = width;
    drawing.height_ = height;
    const auto format = is_transparent ? CAIRO_FORMAT_ARGB32 : CAIRO_FORMAT_RGB24;
    drawing.surface_.reset(cairo_image_surface_create(format, width, height));
    drawing.context_.reset(cairo_create(drawing.surface_.get()));
    if (const auto status = cairo_status(drawing.context_.get()); status != CAIRO_STATUS_SUCCESS)
        return failure(status, width, height);
    cairo_set_line_cap(drawing.context_.get(), CAIRO_LINE_CAP_ROUND);
    cairo_set_line_join(drawing.context_.get(), CAIRO_LINE_JOIN_ROUND);
    return drawing;
}

Result<Drawing> Drawing::create(int width, int height, glm::vec3 background) {
    auto drawing = on_image(width, height, false);
    if (drawing) drawing->fill({0, 0}, {width, height}, background);
    return drawing;
}

Result<Drawing> Drawing::layer(int width, int height) { return on_image(width, height, true); }

void Drawing::fill(glm::dvec2 corner, glm::dvec2 size, glm::vec3 colour) {
    set_colour(context_.get(), colour);
    cairo_rectangle(context_.get(), corner.x, corner.y, size.x, size.y);
    cairo_fill(context_.get());
}

void Drawing::round_fill(glm::dvec2 corner, glm::dvec2 size, double radius, glm::vec4 colour) {
    constexpr double quarter = std::numbers::pi / 2;
    const double r = std::min(radius, std::min(size.x, size.y) / 2);
    const glm::dvec2 low = corner + r, high = corner + size - r;
    cairo_t* const context = context_.get();
    cairo_set_source_rgba(context, static_cast<double>(colour.r), static_cast<double>(colour.g),
                          static_cast<double>(colour.b), static_cast<double>(colour.a));
    cairo_new_path(context);
    cairo_arc(context, high.x, low.y, r, -quarter, 0);
    cairo_arc(context, high.x, high.y, r, 0, quarter);
    cairo_arc(context, low.x, high.y, r, quarter, 2 * quarter);
    cairo_arc(context, low.x, low.y, r, 2 * quarter, 3 * quarter);
    cairo_fill(context);
}

void Drawing::line(std::span<const glm::dvec2> points, glm::vec3 colour, double width, bool dashed) {
    set_colour(context_.get(), colour);
    cairo_set_line_width(context_.get(), width);
    cairo_set_dash(context_.get(), dash_px, dashed ? 2 : 0, 0);
    cairo_new_path(context_.get()); // text leaves a point behind
    for (const glm::dvec2 point : points) cairo_line_to(context_.get(), point.x, point.y);
    cairo_stroke(context_.get());
}

void Drawing::line(glm::dvec2 from, glm::dvec2 to, glm::vec3 colour, double width, bool dashed) {
    const glm::dvec2 points[] = {from, to};
    line(points, colour, width, dashed);
}

void Drawing::text(glm::dvec2 at, std::string_view text, glm::vec3 colour, double height_px, Align align) {
    cairo_t* const context = context_.get();
    const std::string clean = as_utf8(text);
    set_colour(context, colour);
    choose_font(context, height_px);
    cairo_font_extents_t extents;
    cairo_font_extents(context, &extents);
    const double before = align == Align::left ? 0 : align == Align::centre ? 0.5 : 1; // of the width
    cairo_move_to(context, at.x - before * advance_of(context, clean), at.y + extents.ascent);
    cairo_show_text(context, clean.c_str());
}

void Drawing::picture(glm::dvec2 corner, const perception::Image& picture) {
    const std::unique_ptr<cairo_surface_t, End> source(
        cairo_image_surface_create(CAIRO_FORMAT_RGB24, picture.width, picture.height));
    if (cairo_surface_status(source.get()) == CAIRO_STATUS_SUCCESS) {
        unsigned char* row = cairo_image_surface_get_data(source.get());
        const int stride = cairo_image_surface_get_stride(source.get());
        const bool is_grey = picture.channels == 1;
        for (int y = 0; y < picture.height; ++y, row += stride) {
            for (int x = 0; x < picture.width; ++x) {
                const std::uint32_t pixel = code_of(picture.at(x, y, 0)) << 16 |
                                            code_of(picture.at(x, y, is_grey ? 0 : 1)) << 8 |
                                            code_of(picture.at(x, y, is_grey ? 0 : 2));
                std::memcpy(row + sizeof pixel * static_cast<std::size_t>(x), &pixel, sizeof pixel);
            }
        }
        cairo_surface_mark_dirty(source.get());
    }
    cairo_save(context_.get());
    cairo_set_source_surface(context_.get(), source.get(), corner.x, corner.y); // brings the surface's error here, too
    cairo_pattern_set_filter(cairo_get_source(context_.get()), CAIRO_FILTER_NEAREST);
    cairo_paint(context_.get());
    cairo_restore(context_.get());
}

void Drawing::clip(glm::dvec2 corner, glm::dvec2 size) {
    cairo_save(context_.get());
    cairo_rectangle(context_.get(), corner.x, corner.y, size.x, size.y);
    cairo_clip(context_.get());
}
void Drawing::end_clip() { cairo_restore(context_.get()); }

Result<std::vector<std::uint32_t>> Drawing::pixels() const {
    if (const auto status = cairo_status(context_.get()); status != CAIRO_STATUS_SUCCESS)
        return failure(status, width_, height_);
    cairo_surface_flush(surface_.get());
    const unsigned char* row = cairo_image_surface_get_data(surface_.get());
    const int stride = cairo_image_surface_get_stride(surface_.get());
    const auto width = static_cast<std::size_t>(width_), height = static_cast<std::size_t>(height_);
    std::vector<std::uint32_t> pixels(width * height);
    for (std::size_t y = 0; y < height; ++y, row += stride) std::memcpy(&pixels[y * width], row, 4 * width);
    return pixels;
}

Result<perception::Image> Drawing::image() const {
    const auto drawn = pixels();
    if (!drawn) return drawn.error();
    perception::Image image{width_, height_, 3, {}};
    image.values.reserve(3 * drawn->size());
    for (const std::uint32_t pixel : *drawn)
        for (const int shift : {16, 8, 0}) image.values.push_back(static_cast<float>(pixel >> shift & 255) / 255);
    return image;
}

Result<std::vector<glm::u8vec4>> Drawing::layer_pixels() const {
    const auto drawn = pixels();
    if (!drawn) return drawn.error();
    const bool is_opaque = cairo_image_surface_get_format(surface_.get()) == CAIRO_FORMAT_RGB24;
    // Cairo's codes are multiplied by alpha, and rounded.
    const auto straight = [&](std::uint32_t pixel) {
        const std::uint32_t alpha = is_opaque ? 255 : pixel >> 24;
        const auto code = [&](int shift) {
            const std::uint32_t part = pixel >> shift & 255;
            return alpha == 0 ? 0U : std::min((part * 255 + alpha / 2) / alpha, 255U);
        };
        return glm::u8vec4(code(16), code(8), code(0), alpha);
    };
    std::vector<glm::u8vec4> codes;
    codes.reserve(drawn->size());
    std::uint32_t last = 0; // most pixels are like the one before
    glm::u8vec4 last_straight = straight(last);
    for (const std::uint32_t pixel : *drawn) {
        if (pixel != last) last_straight = straight(last = pixel);
        codes.push_back(last_straight);
    }
    return codes;
}

Result<void> Drawing::write(const std::filesystem::path& file) const {
    const auto drawn = image();
    return drawn ? perception::write_image(file, *drawn) : drawn.error();
}

double Drawing::text_width(std::string_view text, double height_px) {
    const std::unique_ptr<cairo_surface_t, End> surface(cairo_image_surface_create(CAIRO_FORMAT_RGB24, 1, 1));
    const std::unique_ptr<cairo_t, End> context(cairo_create(surface.get()));
    choose_font(context.get(), height_px);
    return advance_of(context.get(), as_utf8(text));
}

double Drawing::fitting_height(std::string_view text, double height_px, double most_width) {
    const double width = text_width(text, height_px);
    return width > most_width ? height_px * std::max(most_width, 0.0) / width : height_px;
}

} // namespace unseen::app
