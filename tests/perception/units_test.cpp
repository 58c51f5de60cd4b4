// Quantities: arithmetic and conversions. What must not compile is in tests/static/units_static_test.cpp.
#include <unseen/perception/units.h>

#include "testing.h"

namespace unseen::perception::units_test {

TEST(Units, ConvertDegreesToRadiansAndBack) {
    EXPECT_DOUBLE_EQ(to_radians(180.0_deg).value(), std::numbers::pi);
    EXPECT_DOUBLE_EQ(to_degrees(Radians(std::numbers::pi / 6)).value(), 30);
    EXPECT_DOUBLE_EQ(to_degrees(to_radians(12.345_deg)).value(), 12.345);
}

TEST(Units, AddScaleAndCompareWithinOneUnit) {
    EXPECT_EQ((2.0_deg + 3.0_deg).value(), 5);
    EXPECT_EQ((2.0_deg - 3.0_deg).value(), -1);
    EXPECT_EQ((-2.0_m).value(), -2);
    EXPECT_EQ((0.5 * 3.0_m).value(), 1.5);
    EXPECT_EQ((3.0_m * 0.5).value(), 1.5);
    EXPECT_EQ((3.0_m / 2).value(), 1.5);
    EXPECT_EQ(3.0_cdm2 / 2.0_cdm2, 1.5);
    EXPECT_LT(1.0_cpd, 2.0_cpd);
    EXPECT_EQ(Hertz(), 0.0_Hz);
}

TEST(Units, KeepNotANumberUnordered) {
    const Luminance nan(std::numeric_limits<double>::quiet_NaN());
    EXPECT_FALSE(nan < 1.0_cdm2);
    EXPECT_FALSE(nan >= 1.0_cdm2);
    EXPECT_FALSE(nan == nan);
}

TEST(Units, NyquistFrequencyIsHalfTheSamplingRate) { EXPECT_EQ(nyquist(34.0_ppd), 17.0_cpd); }

TEST(Units, WorkInConstantExpressions) {
    static_assert(to_radians(180.0_deg).value() == std::numbers::pi);
    static_assert(nyquist(60.0_ppd) == 30.0_cpd);
}

} // namespace unseen::perception::units_test
