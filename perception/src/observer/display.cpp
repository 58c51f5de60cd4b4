// The display model: photometry (black level, transfer function) and viewing geometry of a flat screen.
#include <unseen/perception/display.h>

#include <algorithm>

#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/number_text.h>

namespace unseen::perception {
namespace {

Error bad(std::string message) { return invalid_argument("display: " + std::move(message)); }
Error bad(std::string rule, double value) { return bad(std::move(rule) + ", but is " + number_text(value)); }

// !(value > 0) is true for NaN as well.
bool positive(double value) { return value > 0 && std::isfinite(value); }

// SMPTE ST 2084 (2014): 0..1 to cd/m2 and back, 10,000 at most.
constexpr double pq_m1 = 2610.0 / 16384, pq_m2 = 2523.0 / 4096 * 128;
constexpr double pq_c1 = 3424.0 / 4096, pq_c2 = 2413.0 / 4096 * 32, pq_c3 = 2392.0 / 4096 * 32;
constexpr double pq_peak_cdm2 = 10000;
double pq_decode(double code) {
    const double root = std::pow(code, 1 / pq_m2);
    return pq_peak_cdm2 * std::pow(std::max(root - pq_c1, 0.0) / (pq_c2 - pq_c3 * root), 1 / pq_m1);
}
double pq_encode(double cdm2) {
    const double power = std::pow(cdm2 / pq_peak_cdm2, pq_m1);
    return std::pow((pq_c1 + pq_c2 * power) / (1 + pq_c3 * power), pq_m2);
}

// Beyond 1 the last step goes on, so that values stay ordered.
double table_decode(const std::vector<double>& table, double code) {
    const double position = code * static_cast<double>(table.size() - 1);
    // NaN takes the first step, and stays NaN.
    const std::size_t i =
        position > 0 ? static_cast<std::size_t>(std::min(position, static_cast<double>(table.size() - 2))) : 0;
    return table[i] + (position - static_cast<double>(i)) * (table[i + 1] - table[i]);
}
double table_encode(const std::vector<double>& table, double linear) {
    const auto above = std::upper_bound(table.begin() + 1, table.end() - 1, linear);
    const std::size_t i = static_cast<std::size_t>(above - table.begin()) - 1;
    return (static_cast<double>(i) + (linear - table[i]) / (table[i + 1] - table[i])) /
           static_cast<double>(table.size() - 1);
}

// What no display reaches: values beyond are a slip of the unit.
constexpr double smallest_pitch_m = 1e-9, largest_pitch_m = 1, nearest_m = 1e-3, farthest_m = 1e4;
constexpr double darkest_cdm2 = 1e-7; // a tenth of what a rested eye sees
constexpr double brightest_cdm2 = 1e6, brightest_ambient_lux = 1e6;
constexpr double least_gamma = 0.1, largest_gamma = 10, most_ppd = 1e5, least_field_deg = 0.1;

std::string in_brackets(const char* name, std::size_t i) {
    return std::string(name).append("[").append(std::to_string(i)).append("]");
}

Result<void> check_transfer(const Display& d) {
    if (d.transfer == TransferFunction::gamma && !(d.gamma >= least_gamma && d.gamma <= largest_gamma))
        return bad("transfer must be a gamma from 0.1 to 10", d.gamma);
    if (d.transfer == TransferFunction::pq && !(d.peak.value() <= pq_peak_cdm2))
        return bad("peak_cdm2 must be at most 10000 cd/m2 with the transfer function pq", d.peak.value());
    if (d.transfer != TransferFunction::table) return {};
    constexpr std::size_t least_size = 3, largest_size = 65536;
    if (d.table.size() < least_size || d.table.size() > largest_size)
        return bad("transfer_table must have 3 to 65536 values, but has " + std::to_string(d.table.size()));
    if (d.table.front() != 0 || d.table.back() != 1)
        return bad("transfer_table must go from 0 to 1, but goes from " + number_text(d.table.front()) + " to " +
                   number_text(d.table.back()));
    for (std::size_t i = 1; i < d.table.size(); ++i)
        if (!(d.table[i] > d.table[i - 1]))
            return bad(in_brackets("transfer_table", i) + " must be above the value before it, but is " +
                       number_text(d.table[i]));
    return {};
}

Result<void> check_lens(const Display& d) {
    if (d.field_deg != 0 && !(d.field_deg >= least_field_deg && d.field_deg < 360))
        return bad("field_deg must be from 0.1 to 360", d.field_deg);
    if (d.lens.empty()) return {};
    if (d.lens.size() == 1 || d.lens.size() > 10'000)
        return bad("pixels_per_degree_at must have 2 to 10000 angles, but has " + std::to_string(d.lens.size()));
    if (d.lens.front().angle_deg != 0)
        return bad("pixels_per_degree_at[0] must be at 0 degrees, but is at " + number_text(d.lens.front().angle_deg));
    for (std::size_t i = 0; i < d.lens.size(); ++i) {
        const Display::PixelsPerDegreeAt& at = d.lens[i];
        if (i > 0 && !(at.angle_deg > d.lens[i - 1].angle_deg && at.angle_deg <= 180))
            return bad(in_brackets("pixels_per_degree_at", i) +
                       " must be at a larger angle than the one before it, up to 180 degrees, but is at " +
                       number_text(at.angle_deg));
        if (!(positive(at.pixels_per_degree) && at.pixels_per_degree <= most_ppd))
            return bad(in_brackets("pixels_per_degree_at", i) +
                       " must have pixels per degree above 0 and at most 1e5, but has " +
                       number_text(at.pixels_per_degree));
    }
    return {};
}

} // namespace

Result<void> validate(const Display& d) {
    constexpr int most_pixels = 1'000'000; // a side
    for (const auto& [name, pixels] : {std::pair("width_px", d.width_px), std::pair("height_px", d.height_px)}) {
        const std::string but = ", but is " + std::to_string(pixels);
        if (pixels <= 0) return bad(name + (" must be above 0" + but));
        if (pixels > most_pixels) return bad(name + (" must be at most 1000000" + but));
    }
    if (!(d.pixel_pitch.value() >= smallest_pitch_m && d.pixel_pitch.value() <= largest_pitch_m))
        return bad("pixel_pitch_m (or the diagonal_m that it follows from) must be a length from 1e-9 to 1 metre",
                   d.pixel_pitch.value());
    if (!(d.distance.value() >= nearest_m && d.distance.value() <= farthest_m))
        return bad("viewing_distance_m must be a length from 1 mm to 10 km", d.distance.value());
    if (!positive(pixels_per_degree(d).value()))
        return bad("pixel_pitch_m " + number_text(d.pixel_pitch.value()) + " m at viewing_distance_m " +
                   number_text(d.distance.value()) + " m gives no finite number of pixels per degree");
    if (!(positive(d.peak.value()) && d.peak.value() <= brightest_cdm2))
        return bad("peak_cdm2 must be above 0 and at most 1e6 cd/m2", d.peak.value());
    if (!(d.black.value() >= darkest_cdm2 && d.black < d.peak))
        return bad("black_cdm2 must be at least 1e-7 and below the peak of " + number_text(d.peak.value()) +
                   " cd/m2, but is " + number_text(d.black.value()));
    if (auto ok = check_transfer(d); !ok) return ok;
    if (auto ok = check_lens(d); !ok) return ok;
    if (!(d.ambient.value() >= 0 && d.ambient.value() <= brightest_ambient_lux))
        return bad("ambient_lux must be 0 to 1e6 lux", d.ambient.value());
    if (!(d.reflectivity >= 0 && d.reflectivity <= 1)) return bad("reflectivity must lie in 0..1", d.reflectivity);
    return {};
}

PixelsPerDegree pixels_per_degree(const Display& display) {
    return PixelsPerDegree(1 / physical_field(display, 1).value());
}

PixelsPerDegree coarsest_pixels_per_degree(const Display& display) {
    double least = pixels_per_degree(display).value();
    for (const Display::PixelsPerDegreeAt& at : display.lens) least = std::min(least, at.pixels_per_degree);
    return PixelsPerDegree(least);
}

PixelsPerDegree finest_pixels_per_degree(const Display& display) {
    if (display.lens.empty()) return pixels_per_degree(display);
    double most = 0;
    for (const Display::PixelsPerDegreeAt& at : display.lens) most = std::max(most, at.pixels_per_degree);
    return PixelsPerDegree(most);
}

PixelsPerDegree pixels_per_degree_at(const Display& display, Degrees from_centre) {
    const double angle_deg = std::abs(from_centre.value());
    if (std::isnan(angle_deg)) return PixelsPerDegree(angle_deg);
    const std::vector<Display::PixelsPerDegreeAt>& lens = display.lens;
    if (lens.empty()) {
        constexpr double nearly_grazing_deg = 89.9;
        const double ppd = pixels_per_degree(display).value(), delta_deg = std::min(0.5 / ppd, nearly_grazing_deg);
        const double a = to_radians(Degrees(std::min(angle_deg, nearly_grazing_deg - delta_deg))).value();
        const double delta = to_radians(Degrees(delta_deg)).value();
        // tan(a + d) - tan a = sin d / (cos(a + d) cos a), without cancellation.
        return PixelsPerDegree(ppd * std::cos(delta) / (std::cos(a + delta) * std::cos(a)));
    }
    const auto above = std::find_if(lens.begin(), lens.end(),
                                    [&](const Display::PixelsPerDegreeAt& at) { return at.angle_deg > angle_deg; });
    if (above == lens.end()) return PixelsPerDegree(lens.back().pixels_per_degree);
    const Display::PixelsPerDegreeAt &lo = *(above - 1), &hi = *above;
    const double t = (angle_deg - lo.angle_deg) / (hi.angle_deg - lo.angle_deg);
    return PixelsPerDegree(lo.pixels_per_degree + t * (hi.pixels_per_degree - lo.pixels_per_degree));
}

void set_pixels_per_degree(Display& display, PixelsPerDegree ppd) {
    const double half_pixel_rad = to_radians(Degrees(1 / ppd.value())).value() / 2;
    display.pixel_pitch = 2 * std::tan(half_pixel_rad) * display.distance;
    display.lens.clear();
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
    case TransferFunction::srgb: return std::copysign(srgb_to_linear(magnitude), code);
    case TransferFunction::gamma: return std::copysign(std::pow(magnitude, display.gamma), code);
    case TransferFunction::pq:
        return std::copysign(std::min(pq_decode(std::min(magnitude, 1.0)) / display.peak.value(), 1.0), code);
    case TransferFunction::table: return std::copysign(table_decode(display.table, magnitude), code);
    case TransferFunction::linear: break;
    }
    return code;
}

double encode(const Display& display, double linear) {
    const double magnitude = std::abs(linear);
    switch (display.transfer) {
    case TransferFunction::srgb: return std::copysign(linear_to_srgb(magnitude), linear);
    case TransferFunction::gamma: return std::copysign(std::pow(magnitude, 1 / display.gamma), linear);
    case TransferFunction::pq: return std::copysign(pq_encode(magnitude * display.peak.value()), linear);
    case TransferFunction::table: return std::copysign(table_encode(display.table, magnitude), linear);
    case TransferFunction::linear: break;
    }
    return linear;
}

} // namespace unseen::perception
