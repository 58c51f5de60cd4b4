// The display: from relative luminance and code values to cd/m2, from pixels to visual angle.
#pragma once

#include <unseen/perception/units.h>
#include <unseen/vdtree/result.h>

namespace unseen::perception {

enum class TransferFunction {
    srgb,
    gamma,
    linear,
    pq,    // SMPTE ST 2084, of HDR displays: absolute up to 10,000 cd/m2, clipped at the peak
    table, // measured, see Display::table
};

// A flat screen, seen from straight in front of its centre (which is also the centre of the window). Or, with `lens`, a
// headset: then pitch and distance are those of the flat picture that is drawn for it, whose directions the viewer sees
// where they are; the lens says how fine the panel's pixels are there. Default: the 20-inch monitor of the 2001 paper's
// field, 34.357 pixels per degree at its centre.
struct Display {
    // How many pixels a degree has at an angle from the centre of the view.
    struct PixelsPerDegreeAt {
        double angle_deg = 0;
        double pixels_per_degree = 0;
    };

    std::string name = "20-inch 1600x1200 at 0.5 m";
    int width_px = 1600;
    int height_px = 1200;
    Metres pixel_pitch{0.000254}; // distance between pixel centres
    Metres distance{0.5};         // from the eye to the screen
    Luminance peak{100};
    Luminance black{0.5}; // of the screen itself, without ambient light; above 0 (Weber contrast needs a floor)
    TransferFunction transfer = TransferFunction::srgb;
    double gamma = 2.2;        // used by TransferFunction::gamma
    std::vector<double> table; // used by TransferFunction::table: linear light of equidistant codes from 0 to 1, both
                               // included; from 0 to 1, strictly ascending, interpolated
    Lux ambient{0};
    double reflectivity = 0.005; // share of the ambient light that the screen scatters back, 0..1
    // For headsets: angles strictly ascending from 0, at least two; interpolated, and constant beyond the last. Empty:
    // flat.
    std::vector<PixelsPerDegreeAt> lens;
    double field_deg =
        0; // of headsets: the whole field of view across; 0: that of the screen. Nothing is computed from it
};

// Finite and positive sizes within what a display can be, 0 < black < peak, reflectivity in 0..1, tables as above. The
// error names the field by its key in a display profile.
Result<void> validate(const Display& display);

// At the centre of the screen, where a flat picture has the fewest: 1 / (2 atan(pitch / (2 distance))). Of headsets: of
// the flat picture, not the panel. This is what frequencies in a picture are told by, such as a judge's.
PixelsPerDegree pixels_per_degree(const Display& display);
// Pixels per degree where pixels are largest: a change fills at least one. Headsets: the picture's centre, or where the
// panel is coarsest.
PixelsPerDegree coarsest_pixels_per_degree(const Display& display);
// Pixels per degree where pixels are smallest: no detail exceeds its nyquist(). Headsets: where the panel is finest.
PixelsPerDegree finest_pixels_per_degree(const Display& display);
// At an angle from the centre, along the radius; above 0. Flat screens: ppd (tan(a + delta) - tan a) / tan delta, delta
// half a pixel, so about ppd / cos^2 a; angles are clamped so that a + delta is at most 89.9 degrees. Headsets: by the
// lens's table.
PixelsPerDegree pixels_per_degree_at(const Display& display, Degrees from_centre);
// Sets the pixel pitch so that the centre has `ppd` at the display's distance; the display is flat then.
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

} // namespace unseen::perception
