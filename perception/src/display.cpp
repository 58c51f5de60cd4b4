// The display model: photometry (black level, transfer function) and viewing geometry of a flat screen.
#include <perception/display.h>

#include <array>
#include <charconv>
#include <cmath>
#include <numbers>

namespace unseen::perception {
namespace {

std::string number(double value) {
    std::array<char, 32> text;
    const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
    return std::string(text.data(), end);
}

Error bad(std::string message) { return Error{ErrorCode::invalid_argument, "display: " + std::move(message)}; }

// !(value > 0) is true for NaN as well.
bool positive(double value) { return value > 0 && std::isfinite(value); }

// IEC 61966-2-1. The threshold of `encode` is the image of that of `decode` to the standard's own rounding.
double srgb_decode(double code) {
    return code <= 0.04045 ? code / 12.92 : std::pow((code + 0.055) / 1.055, 2.4);
}
double srgb_encode(double linear) {
    return linear <= 0.0031308 ? linear * 12.92 : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

} // namespace

Result<void> validate(const Display& d) {
    if (d.width_px <= 0) return bad("width_px must be above 0, but is " + std::to_string(d.width_px));
    if (d.height_px <= 0) return bad("height_px must be above 0, but is " + std::to_string(d.height_px));
    if (!positive(d.pixel_pitch.value())) {
        return bad("pixel_pitch must be a length above 0 metres, but is " + number(d.pixel_pitch.value()));
    }
    if (!positive(d.distance.value())) {
        return bad("distance must be a length above 0 metres, but is " + number(d.distance.value()));
    }
    if (!positive(pixels_per_degree(d).value())) {
        return bad("pixel_pitch " + number(d.pixel_pitch.value()) + " m at distance " + number(d.distance.value()) +
                   " m gives no finite number of pixels per degree");
    }
    if (!positive(d.peak.value())) return bad("peak must be above 0 cd/m2, but is " + number(d.peak.value()));
    if (!(d.black.value() > 0 && d.black < d.peak)) {
        return bad("black must be above 0 and below the peak of " + number(d.peak.value()) + " cd/m2, but is " +
                   number(d.black.value()));
    }
    if (d.transfer == TransferFunction::gamma && !positive(d.gamma)) {
        return bad("gamma must be above 0, but is " + number(d.gamma));
    }
    if (!(d.ambient.value() >= 0 && std::isfinite(d.ambient.value()))) {
        return bad("ambient must be 0 lux or more, but is " + number(d.ambient.value()));
    }
    if (!(d.reflectivity >= 0 && d.reflectivity <= 1)) {
        return bad("reflectivity must lie in 0..1, but is " + number(d.reflectivity));
    }
    return {};
}

PixelsPerDegree pixels_per_degree(const Display& display) {
    return PixelsPerDegree(1 / physical_field(display, 1).value());
}

void set_pixels_per_degree(Display& display, PixelsPerDegree ppd) {
    const double half_pixel_rad = to_radians(Degrees(1 / ppd.value())).value() / 2;
    display.pixel_pitch = 2 * std::tan(half_pixel_rad) * display.distance;
}

Degrees physical_field(const Display& display, int pixels) {
    return to_degrees(Radians(2 * std::atan(0.5 * pixels * display.pixel_pitch / display.distance)));
}

Luminance black_level(const Display& display) {
    // A Lambertian reflector under E lux has the luminance E reflectivity / pi.
    return display.black + Luminance(display.ambient.value() * display.reflectivity / std::numbers::pi);
}

Luminance to_luminance(const Display& display, double relative) {
    return black_level(display) + (display.peak - display.black) * relative;
}

double to_relative(const Display& display, Luminance luminance) {
    return (luminance - black_level(display)) / (display.peak - display.black);
}

// Both are mirrored below 0, so that values out of range stay ordered instead of becoming NaN.
double decode(const Display& display, double code) {
    const double magnitude = std::abs(code);
    switch (display.transfer) {
    case TransferFunction::srgb: return std::copysign(srgb_decode(magnitude), code);
    case TransferFunction::gamma: return std::copysign(std::pow(magnitude, display.gamma), code);
    case TransferFunction::linear: break;
    }
    return code;
}

double encode(const Display& display, double linear) {
    const double magnitude = std::abs(linear);
    switch (display.transfer) {
    case TransferFunction::srgb: return std::copysign(srgb_encode(magnitude), linear);
    case TransferFunction::gamma: return std::copysign(std::pow(magnitude, 1 / display.gamma), linear);
    case TransferFunction::linear: break;
    }
    return linear;
}

} // namespace unseen::perception
