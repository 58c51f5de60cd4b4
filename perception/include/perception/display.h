// The display: from relative luminance and code values to cd/m2, from pixels to visual angle.
#pragma once

#include <string>

#include <perception/units.h>
#include <vdtree/result.h>

namespace unseen::perception {

enum class TransferFunction { srgb, gamma, linear };

// A flat screen, seen from straight in front of its centre (which is also the centre of the window).
// Default: the 20-inch monitor of the 2001 paper's field, 34.357 pixels per degree at its centre.
struct Display {
    std::string name = "20-inch 1600x1200 at 0.5 m";
    int width_px = 1600;
    int height_px = 1200;
    Metres pixel_pitch{0.000254};   // distance between pixel centres
    Metres distance{0.5};           // from the eye to the screen
    Luminance peak{100};
    Luminance black{0.5};           // of the screen itself, without ambient light; above 0 (Weber contrast needs a floor)
    TransferFunction transfer = TransferFunction::srgb;
    double gamma = 2.2;             // used by TransferFunction::gamma
    Lux ambient{0};
    double reflectivity = 0.005;    // share of the ambient light that the screen scatters back, 0..1
};

// Finite and positive sizes, 0 < black < peak, reflectivity in 0..1. The error names the field.
Result<void> validate(const Display& display);

// At the centre of the screen: 1 / (2 atan(pitch / (2 distance))).
PixelsPerDegree pixels_per_degree(const Display& display);
// Sets the pixel pitch so that the centre has `ppd` at the display's distance.
void set_pixels_per_degree(Display& display, PixelsPerDegree ppd);
// The field that `pixels` centred pixels fill: 2 atan(pixels pitch / (2 distance)).
Degrees physical_field(const Display& display, int pixels);

// The screen's darkest luminance: black + ambient reflectivity / pi.
Luminance black_level(const Display& display);
// Relative luminance 0..1 (linear) to cd/m2: black_level + (peak - black) y. Affine, so it keeps order and midpoints.
Luminance to_luminance(const Display& display, double relative);
// The inverse; not clamped.
double to_relative(const Display& display, Luminance luminance);
// A code value 0..1 to relative linear light, and back.
double decode(const Display& display, double code);
double encode(const Display& display, double linear);

// Rec. 709 weights of linear RGB.
inline constexpr double luminance_weights[3] = {0.2126, 0.7152, 0.0722};

} // namespace unseen::perception
