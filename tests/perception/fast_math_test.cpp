// The judge's functions of float against those of the standard library.
#include "judge/fast_math.h"

#include "judge/modern_masking.h"
#include "testing.h"

namespace unseen::perception::fast_math_test {

constexpr double tolerance = 4e-7; // as the header says
constexpr int steps = 100'000;

TEST(FastMath, IsNearTheStandardLibrary) {
    for (int i = 0; i <= steps; ++i) {
        const double share = static_cast<double>(i) / steps;
        const float number = std::exp2(static_cast<float>(-125 + 250 * share));
        const double log2_number = std::log2(static_cast<double>(number));
        ASSERT_NEAR(fast_log2(number), log2_number, tolerance * std::max(1.0, std::abs(log2_number))) << number;
        const auto exponent = static_cast<float>(-126 + 253 * share);
        ASSERT_NEAR(fast_exp2(exponent) / std::exp2(static_cast<double>(exponent)), 1, tolerance) << exponent;
        const double angle = std::numbers::pi * share;
        const auto y = static_cast<float>(7 * std::sin(angle)), x = static_cast<float>(7 * std::cos(angle));
        ASSERT_NEAR(fast_angle(y, x), std::atan2(static_cast<double>(y), static_cast<double>(x)), tolerance) << angle;
    }
}

TEST(FastMath, IsExactWhereItCanBe) {
    EXPECT_EQ(fast_log2(1), 0);
    EXPECT_EQ(fast_log2(8), 3);
    EXPECT_EQ(fast_exp2(0), 1);
    EXPECT_EQ(fast_exp2(-3), 0.125f);
    EXPECT_EQ(fast_angle(0, 2), 0);
    // Out of its range it stays finite.
    EXPECT_GT(fast_exp2(-1e30f), 0);
    EXPECT_LT(fast_exp2(1e30f), std::numeric_limits<float>::infinity());
}

TEST(FastMath, ElevatesThresholdsAsDalySays) {
    constexpr double of_elevation = 1e-5; // as modern_masking.h says
    EXPECT_EQ(fast_daly_elevation(0), 1);
    for (int i = 0; i <= 1000; ++i) {
        const double masker = std::pow(10, -6 + 15e-3 * i);
        ASSERT_NEAR(static_cast<double>(fast_daly_elevation(static_cast<float>(masker))) / daly_elevation(masker), 1,
                    of_elevation)
            << masker;
    }
}

} // namespace unseen::perception::fast_math_test
