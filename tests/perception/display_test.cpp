// The display model: geometry, photometry, transfer functions and what it refuses.
#include <unseen/perception/display.h>
#include <unseen/vdtree/colour.h>

#include "testing.h"

namespace unseen::perception::display_test {

constexpr TransferFunction transfer_functions[] = {TransferFunction::srgb, TransferFunction::gamma,
                                                   TransferFunction::linear};
constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
// Relative; a few operations in double.
constexpr double rounding = 1e-14;

TEST(Display, DefaultHasTheFieldOfThePaper) {
    const Display display;
    EXPECT_TRUE(validate(display));
    EXPECT_NEAR(pixels_per_degree(display).value(), 34.3569, 5e-5);   // published to 4 decimals
    EXPECT_NEAR(physical_field(display, 512).value(), 14.8192, 5e-5); // 2 atan(256 * 0.254 / 500)
    EXPECT_NEAR(physical_field(display, 1024).value(), 29.16, 5e-3);
}

TEST(Display, PixelsPerDegreeOfA4kScreen) {
    Display display;
    display.width_px = 3840;
    display.pixel_pitch = Metres(0.7 / 3840);
    display.distance = Metres(0.7);
    EXPECT_NEAR(pixels_per_degree(display).value(), 67.0206, 5e-5);
}

TEST(Display, FieldGrowsLessThanThePixels) {
    const Display display;
    EXPECT_LT(physical_field(display, 1600).value(), 1600 * physical_field(display, 1).value());
    EXPECT_LT(physical_field(display, 1000000), Degrees(180));
}

TEST(Display, AmbientLightRaisesBlackAndWhiteAlike) {
    Display display;
    display.ambient = Lux(100);
    display.reflectivity = 0.01;
    EXPECT_NEAR(black_level(display).value(), 0.5 + 1 / M_PI, rounding);
    EXPECT_NEAR(to_luminance(display, 0).value(), black_level(display).value(), rounding);
    EXPECT_NEAR(to_luminance(display, 1).value(), 100 + 1 / M_PI, 100 * rounding);
}

TEST(Display, RelativeLuminanceMapsAffinelyAndBack) {
    Display display;
    display.ambient = Lux(250);
    for (const double relative : {-0.5, 0.0, 0.18, 0.5, 1.0, 3.0})
        EXPECT_NEAR(to_relative(display, to_luminance(display, relative)), relative, 10 * rounding);
    const double low = to_luminance(display, 0.2).value(), high = to_luminance(display, 0.6).value();
    EXPECT_NEAR(to_luminance(display, 0.4).value(), (low + high) / 2, 100 * rounding);
}

TEST(Display, SrgbCodesFollowTheStandard) {
    const Display display;
    EXPECT_EQ(decode(display, 0), 0);
    EXPECT_DOUBLE_EQ(decode(display, 1), 1);
    EXPECT_NEAR(decode(display, 0.5), 0.21404114, 5e-9);
    EXPECT_NEAR(decode(display, 0.04), 0.04 / 12.92, rounding);
    EXPECT_NEAR(encode(display, 0.18), 0.46135613, 5e-9);
}

TEST(Display, GammaIsAPower) {
    Display display;
    display.transfer = TransferFunction::gamma;
    display.gamma = 2.4;
    EXPECT_DOUBLE_EQ(decode(display, 0.3), std::pow(0.3, 2.4));
    display.transfer = TransferFunction::linear;
    EXPECT_EQ(decode(display, 0.3), 0.3);
}

TEST(Display, TransferFunctionsKeepOrderBelowZero) {
    Display display;
    for (const TransferFunction transfer : transfer_functions) {
        display.transfer = transfer;
        EXPECT_DOUBLE_EQ(decode(display, -0.5), -decode(display, 0.5));
        EXPECT_DOUBLE_EQ(encode(display, -0.5), -encode(display, 0.5));
        EXPECT_TRUE(std::isnan(decode(display, not_a_number)));
    }
}

// SMPTE ST 2084: code 0.508 is about 100 cd/m2, and 1 is 10,000.
TEST(Display, PqIsAbsoluteAndClipsAtThePeak) {
    Display display;
    display.transfer = TransferFunction::pq;
    display.peak = Luminance(10000);
    EXPECT_NEAR(decode(display, 0.508078421) * 10000, 100, 0.01);
    EXPECT_NEAR(decode(display, 1), 1, rounding);
    EXPECT_NEAR(decode(display, 0), 0, rounding);
    for (double code = 0.05; code < 1; code += 0.05) EXPECT_NEAR(encode(display, decode(display, code)), code, 1e-9);
    display.peak = Luminance(1000);
    EXPECT_NEAR(decode(display, 0.508078421) * 1000, 100, 0.01);
    EXPECT_EQ(decode(display, 0.9), 1);
    EXPECT_DOUBLE_EQ(decode(display, -0.5), -decode(display, 0.5));
    EXPECT_TRUE(std::isnan(decode(display, not_a_number)));
    EXPECT_TRUE(validate(display));
    display.peak = Luminance(20000);
    EXPECT_FALSE(validate(display));
}

TEST(Display, TablesAreInterpolated) {
    Display display;
    display.transfer = TransferFunction::table;
    display.table = {0, 0.1, 0.3, 1};
    ASSERT_TRUE(validate(display));
    EXPECT_DOUBLE_EQ(decode(display, 0.5), 0.2);
    EXPECT_DOUBLE_EQ(decode(display, 1), 1);
    EXPECT_DOUBLE_EQ(decode(display, -0.5), -0.2);
    EXPECT_TRUE(std::isnan(decode(display, not_a_number)));
    EXPECT_TRUE(std::isnan(encode(display, not_a_number)));
    for (double code = 0; code <= 1; code += 1.0 / 64) EXPECT_NEAR(encode(display, decode(display, code)), code, 1e-12);
    const std::vector<double> bad[] = {
        {}, {0, 1}, {0, 0.5, 0.5, 1}, {0, 0.6, 0.4, 1}, {0.1, 0.5, 1}, {0, 0.5, 0.9}, {0, not_a_number, 1}};
    for (const auto& table : bad) {
        display.table = table;
        EXPECT_THAT(error_in(validate(display)), HasSubstr("table")) << table.size();
    }
}

// Against the tangents themselves, half a pixel to either side would be the derivative: here from the angle on,
// outwards.
TEST(Display, PixelsPerDegreeGrowAsideOnFlatScreens) {
    const Display display;
    const double ppd = pixels_per_degree(display).value();
    const double delta = 0.5 / ppd * std::numbers::pi / 180;
    EXPECT_NEAR(pixels_per_degree_at(display, Degrees(0)).value(), ppd, 1e-6);
    for (const double angle : {1.0, 10.0, 22.0, 45.0, 80.0}) {
        const double a = angle * std::numbers::pi / 180;
        const double expected = ppd * (std::tan(a + delta) - std::tan(a)) / std::tan(delta);
        EXPECT_NEAR(pixels_per_degree_at(display, Degrees(angle)).value() / expected, 1, 1e-9) << angle;
        EXPECT_NEAR(expected / (ppd / std::pow(std::cos(a), 2)), 1, 0.01);
        EXPECT_EQ(pixels_per_degree_at(display, Degrees(-angle)), pixels_per_degree_at(display, Degrees(angle)));
    }
    EXPECT_TRUE(std::isfinite(pixels_per_degree_at(display, Degrees(90)).value()));
    EXPECT_EQ(coarsest_pixels_per_degree(display), pixels_per_degree(display));
    EXPECT_EQ(finest_pixels_per_degree(display), pixels_per_degree(display));
}

TEST(Display, HeadsetsHaveThePixelsOfTheirLens) {
    Display display;
    display.lens = {{0, 20}, {20, 18}, {50, 12}};
    display.field_deg = 100;
    ASSERT_TRUE(validate(display));
    // The picture's, at its centre; what a change fills; and what no detail is finer than.
    EXPECT_NEAR(pixels_per_degree(display).value(), 34.3569, 5e-5);
    EXPECT_EQ(coarsest_pixels_per_degree(display).value(), 12);
    EXPECT_EQ(finest_pixels_per_degree(display).value(), 20);
    Display coarse = display;
    coarse.pixel_pitch = coarse.pixel_pitch * 4;
    EXPECT_NEAR(coarsest_pixels_per_degree(coarse).value(), 34.3569 / 4, 1e-3)
        << "the picture is coarser than the panel";
    EXPECT_EQ(finest_pixels_per_degree(coarse).value(), 20);
    EXPECT_DOUBLE_EQ(pixels_per_degree_at(display, Degrees(10)).value(), 19);
    EXPECT_DOUBLE_EQ(pixels_per_degree_at(display, Degrees(35)).value(), 15);
    EXPECT_DOUBLE_EQ(pixels_per_degree_at(display, Degrees(80)).value(), 12);
    const std::vector<Display::PixelsPerDegreeAt> bad[] = {
        {{0, 20}},           {{1, 20}, {2, 20}},           {{0, 20}, {0, 20}},           {{0, 20}, {10, 0}},
        {{0, 20}, {10, -1}}, {{0, not_a_number}, {10, 1}}, {{0, 20}, {not_a_number, 1}}, {{0, 20}, {200, 1}},
        {{0, 1e9}, {1, 1}}};
    for (const auto& lens : bad) {
        display.lens = lens;
        EXPECT_THAT(error_in(validate(display)), HasSubstr("pixels_per_degree_at"));
    }
    set_pixels_per_degree(display, PixelsPerDegree(30));
    EXPECT_NEAR(pixels_per_degree(display).value(), 30, 1e-9);
}

TEST(Display, LuminanceWeightsSumToOne) {
    EXPECT_NEAR(rec709_weights[0] + rec709_weights[1] + rec709_weights[2], 1, rounding);
}

struct BadDisplay {
    const char* field;
    void (*spoil)(Display&, double);
    std::vector<double> values;
};

TEST(Display, ValidationNamesTheField) {
    const BadDisplay cases[] = {
        {"width_px", [](Display& d, double v) { d.width_px = int(v); }, {0, -1, 2e6}},
        {"height_px", [](Display& d, double v) { d.height_px = int(v); }, {0, -5}},
        {"pixel_pitch_m",
         [](Display& d, double v) { d.pixel_pitch = Metres(v); },
         {0, -1, 2, infinity, not_a_number, 1e-300, 1e-320}},
        {"viewing_distance_m",
         [](Display& d, double v) { d.distance = Metres(v); },
         {0, -1, 1e-300, 1e-4, 1e5, infinity, not_a_number}},
        {"peak_cdm2", [](Display& d, double v) { d.peak = Luminance(v); }, {0, -1, 1e7, infinity, not_a_number}},
        {"below the peak of", [](Display& d, double v) { d.peak = Luminance(v); }, {0.5, 0.1}},
        {"black_cdm2",
         [](Display& d, double v) { d.black = Luminance(v); },
         {0, -1, 1e-300, 1e-8, 100, 101, infinity, not_a_number}},
        {"ambient_lux", [](Display& d, double v) { d.ambient = Lux(v); }, {-1, 1e7, infinity, not_a_number}},
        {"reflectivity", [](Display& d, double v) { d.reflectivity = v; }, {-0.1, 1.1, infinity, not_a_number}},
        {"field_deg", [](Display& d, double v) { d.field_deg = v; }, {-1, 1e-9, 360, infinity, not_a_number}},
        {"transfer",
         [](Display& d, double v) {
             d.transfer = TransferFunction::gamma;
             d.gamma = v;
         },
         {0, -2.2, 1e-9, 100, infinity, not_a_number}},
    };
    for (const BadDisplay& bad : cases) {
        for (const double value : bad.values) {
            Display display;
            bad.spoil(display, value);
            const auto result = validate(display);
            ASSERT_FALSE(result) << bad.field << " " << value;
            EXPECT_EQ(result.error().code, ErrorCode::invalid_argument);
            EXPECT_THAT(result.error().message, HasSubstr(bad.field)) << value;
        }
    }
}

} // namespace unseen::perception::display_test
