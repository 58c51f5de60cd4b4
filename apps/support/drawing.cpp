#include "drawing.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <vector>

#include <cairo-svg.h>
#include <cairo.h>

#include <unseen/vdtree/internal/atomic_file.h>

namespace unseen::app {
namespace {

constexpr int largest_side = 32767;         // of cairo's images
constexpr const char* font = "DejaVu Sans"; // without it, what fontconfig has in its place
constexpr double dash_px[] = {7, 7}; // with the round ends of a line two pixels wide: nine, and five between them

std::string shown_size(int width, int height) { return std::to_string(width) + " x " + std::to_string(height); }

Error failure(cairo_status_t status, const std::string& what) {
    return {status == CAIRO_STATUS_NO_MEMORY ? ErrorCode::unsupported : ErrorCode::invalid_argument,
            "Cannot draw " + what + ": " + cairo_status_to_string(status) + "."};
}

// Cairo must not be unwound: what does not fit into memory is its own error.
cairo_status_t append(void* text, const unsigned char* bytes, unsigned int count) {
    try {
        static_cast<std::string*>(text)->append(reinterpret_cast<const char*>(bytes), count);
        return CAIRO_STATUS_SUCCESS;
    } catch (const std::exception&) {
        return CAIRO_STATUS_NO_MEMORY;
    }
}

// How many bytes of a character begin the text; 0 where they are no UTF-8.
std::size_t character_length(std::string_view text) {
    const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U; };
    const unsigned first = byte(0);
    const std::size_t length = first < 0x80                    ? 1
                               : first >= 0xC2 && first < 0xE0 ? 2
                               : first >= 0xE0 && first < 0xF0 ? 3
                               : first >= 0xF0 && first < 0xF5 ? 4
                                                               : 0;
    for (std::size_t i = 1; i < length; ++i)
        if ((byte(i) & 0xC0) != 0x80) return 0;
    const bool is_overlong = (first == 0xE0 && byte(1) < 0xA0) || (first == 0xF0 && byte(1) < 0x90);
    const bool is_surrogate = first == 0xED && byte(1) >= 0xA0, is_beyond = first == 0xF4 && byte(1) >= 0x90;
    return is_overlong || is_surrogate || is_beyond ? 0 : length;
}

// Cairo takes nothing else, and draws nothing any more once it was given something else.
std::string as_utf8(std::string_view text) {
    std::string clean;
    while (!text.empty()) {
        const std::size_t length = character_length(text);
        const bool is_printable =
            length > 1 || (length == 1 && static_cast<unsigned char>(text[0]) >= 0x20 && text[0] != 0x7F);
        clean += is_printable ? text.substr(0, length) : "?";
        text.remove_prefix(std::max<std::size_t>(length, 1));
    }
    return clean;
}

// Of the font at a height of one pixel; text scales with it, as hints do not move it.
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

// At the origin of the context as it is turned.
void show(cairo_t* context, const std::string& text, double height_px, Align align) {
    choose_font(context, height_px);
    cairo_font_extents_t extents;
    cairo_font_extents(context, &extents);
    const double width = advance_of(context, text);
    const double left = align == Align::left ? 0 : align == Align::centre ? -width / 2 : -width;
    cairo_move_to(context, left, extents.ascent);
    cairo_show_text(context, text.c_str());
}

std::uint32_t code_of(float value) {
    return static_cast<std::uint32_t>(value > 0 ? std::min(value, 1.0f) * 255 + 0.5f : 0);
} // 0 for NaN

} // namespace

void Drawing::End::operator()(cairo_t* context) const { cairo_destroy(context); }
void Drawing::End::operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }

Result<void> Drawing::check_size(int width, int height) {
    if (width >= 1 && height >= 1 && width <= largest_side && height <= largest_side) return {};
    return Error{ErrorCode::invalid_argument, "Cannot draw " + shown_size(width, height) +
                                                  " pixels: a picture with text has 1 to " +
                                                  std::to_string(largest_side) + " a side."};
}

Result<Drawing> Drawing::on(std::unique_ptr<cairo_surface_t, End> surface, int width, int height) {
    Drawing drawing;
    drawing.width_ = width;
    drawing.height_ = height;
    drawing.surface_ = std::move(surface);
    drawing.context_.reset(cairo_create(drawing.surface_.get()));
    if (const auto status = cairo_status(drawing.context_.get()); status != CAIRO_STATUS_SUCCESS)
        return failure(status, shown_size(width, height) + " pixels");
    cairo_set_line_cap(drawing.context_.get(), CAIRO_LINE_CAP_ROUND);
    cairo_set_line_join(drawing.context_.get(), CAIRO_LINE_JOIN_ROUND);
    return drawing;
}

Result<Drawing> Drawing::create(int width, int height, glm::vec3 background, Kind kind) {
    if (auto valid = check_size(width, height); !valid) return valid.error();
    std::unique_ptr<std::string> svg;
    std::unique_ptr<cairo_surface_t, End> surface;
    if (kind == Kind::svg) {
        svg = std::make_unique<std::string>();
        surface.reset(cairo_svg_surface_create_for_stream(append, svg.get(), width, height));
        cairo_svg_surface_set_document_unit(surface.get(), CAIRO_SVG_UNIT_PX);
    } else {
        surface.reset(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height));
    }
    auto drawing = on(std::move(surface), width, height);
    if (!drawing) return drawing;
    drawing->svg_ = std::move(svg);
    drawing->fill({0, 0}, {width, height}, background);
    return drawing;
}

Result<Drawing> Drawing::layer(int width, int height) {
    if (auto valid = check_size(width, height); !valid) return valid.error();
    return on(std::unique_ptr<cairo_surface_t, End>(cairo_image_surface_create(CAIRO_FORMAT_ARGB32, width, height)),
              width, height);
}

Result<Drawing> Drawing::for_file(const std::filesystem::path& file, int width, int height, glm::vec3 background) {
    std::string ending = file.extension().string();
    std::transform(ending.begin(), ending.end(), ending.begin(),
                   [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
    return create(width, height, background, ending == ".svg" ? Kind::svg : Kind::image);
}

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
    cairo_save(context_.get());
    cairo_translate(context_.get(), at.x, at.y);
    set_colour(context_.get(), colour);
    show(context_.get(), as_utf8(text), height_px, align);
    cairo_restore(context_.get());
}

void Drawing::text_upward(glm::dvec2 at, std::string_view text, glm::vec3 colour, double height_px, Align align) {
    cairo_save(context_.get());
    cairo_translate(context_.get(), at.x, at.y);
    cairo_rotate(context_.get(), -std::numbers::pi / 2);
    set_colour(context_.get(), colour);
    show(context_.get(), as_utf8(text), height_px, align);
    cairo_restore(context_.get());
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

Result<void> Drawing::check_pixels() const {
    if (svg_) return Error{ErrorCode::invalid_argument, "A drawing in SVG has no pixels."};
    if (const auto status = cairo_status(context_.get()); status != CAIRO_STATUS_SUCCESS)
        return failure(status, shown_size(width_, height_) + " pixels");
    cairo_surface_flush(surface_.get());
    return {};
}

Result<perception::Image> Drawing::image() const {
    if (auto valid = check_pixels(); !valid) return valid.error();
    const unsigned char* row = cairo_image_surface_get_data(surface_.get());
    const int stride = cairo_image_surface_get_stride(surface_.get());
    perception::Image image{width_, height_, 3, {}};
    image.values.reserve(image.index(0, height_, 0));
    for (int y = 0; y < height_; ++y, row += stride) {
        for (int x = 0; x < width_; ++x) {
            std::uint32_t pixel = 0;
            std::memcpy(&pixel, row + sizeof pixel * static_cast<std::size_t>(x), sizeof pixel);
            for (const int shift : {16, 8, 0}) image.values.push_back(static_cast<float>(pixel >> shift & 255) / 255);
        }
    }
    return image;
}

Result<std::vector<glm::u8vec4>> Drawing::layer_pixels() const {
    if (auto valid = check_pixels(); !valid) return valid.error();
    const unsigned char* row = cairo_image_surface_get_data(surface_.get());
    const int stride = cairo_image_surface_get_stride(surface_.get());
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
    std::vector<glm::u8vec4> pixels(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
    auto out = pixels.begin();
    std::uint32_t last = 0; // most pixels are like the one before
    glm::u8vec4 last_straight = straight(last);
    for (int y = 0; y < height_; ++y, row += stride) {
        for (int x = 0; x < width_; ++x) {
            std::uint32_t pixel = 0;
            std::memcpy(&pixel, row + sizeof pixel * static_cast<std::size_t>(x), sizeof pixel);
            if (pixel != last) last_straight = straight(last = pixel);
            *out++ = last_straight;
        }
    }
    return pixels;
}

Result<void> Drawing::write(const std::filesystem::path& file) {
    if (!svg_) {
        const auto drawn = image();
        return drawn ? perception::write_image(file, *drawn) : drawn.error();
    }
    cairo_status_t status = cairo_status(context_.get());
    cairo_surface_finish(surface_.get());
    if (status == CAIRO_STATUS_SUCCESS) status = cairo_surface_status(surface_.get());
    if (status != CAIRO_STATUS_SUCCESS) return failure(status, "'" + file.string() + "'");
    auto out = vdtree::AtomicFile::create(file);
    if (!out) return out.error();
    if (auto written = out->write(*svg_); !written) return written;
    return out->commit();
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
