// Quantities: arithmetic and conversions. What must not compile is in tests/static/units_static_test.cpp.
#include <unseen/perception/units.h>

#include "testing.h"

namespace unseen::perception::units_test {

TEST(Units, ConvertDegreesToRadiansAndBack) {
    EXPECT_DOUBLE_EQ(to_radians(Degrees(180)).value(), std::numbers::pi);
    EXPECT_DOUBLE_EQ(to_degrees(Radians(std::numbers::pi / 6)).value(), 30);
    EXPECT_DOUBLE_EQ(to_degrees(to_radians(Degrees(12.345))).value(), 12.345);
}

TEST(Units, AddScaleAndCompareWithinOneUnit) {
    EXPECT_EQ((Degrees(2) + Degrees(3)).value(), 5);
    EXPECT_EQ((Degrees(2) - Degrees(3)).value(), -1);
    EXPECT_EQ((-Metres(2)).value(), -2);
    EXPECT_EQ((0.5 * Metres(3)).value(), 1.5);
    EXPECT_EQ((Metres(3) * 0.5).value(), 1.5);
    EXPECT_EQ((Metres(3) / 2).value(), 1.5);
    EXPECT_EQ(Luminance(3) / Luminance(2), 1.5);
    EXPECT_LT(CyclesPerDegree(1), CyclesPerDegree(2));
    EXPECT_EQ(Hertz(), Hertz(0));
}

TEST(Units, KeepNotANumberUnordered) {
    const Luminance nan(std::numeric_limits<double>::quiet_NaN());
    EXPECT_FALSE(nan < Luminance(1));
    EXPECT_FALSE(nan >= Luminance(1));
    EXPECT_FALSE(nan == nan);
}

TEST(Units, NyquistFrequencyIsHalfTheSamplingRate) { EXPECT_EQ(nyquist(PixelsPerDegree(34)), CyclesPerDegree(17)); }

TEST(Units, WorkInConstantExpressions) {
    static_assert(to_radians(Degrees(180)).value() == std::numbers::pi);
    static_assert(nyquist(PixelsPerDegree(60)) == CyclesPerDegree(30));
}

} // namespace unseen::perception::units_test
