// Sensitivity to moving gratings against golden values.
#include <unseen/perception/internal/motion.h>

#include "spatiovelocity.h"
#include "testing.h"

namespace unseen::perception::motion_test {

using support::spatiovelocity_sensitivity;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
// Relative: the golden values have nine digits, so half a unit in the last of a number that starts with 1.
constexpr double golden_tolerance = 6e-9;
constexpr double rounding = 1e-12;

double factor(double cpd, double deg_s) { return velocity_factor(CyclesPerDegree(cpd), DegreesPerSecond(deg_s)); }

TEST(Motion, AgreesWithThePublishedProgram) {
    std::ifstream file("tests/data/csf_spatiovelocity_golden.csv");
    int rows = 0;
    for (std::string line; std::getline(file, line);) {
        const bool is_temporal = line.starts_with("temporal,");
        if (!is_temporal && !line.starts_with("velocity,")) continue;
        std::istringstream cells(line.substr(line.find(',') + 1));
        double cpd = 0, second = 0, golden = 0;
        char comma = 0;
        ASSERT_TRUE(cells >> cpd >> comma >> second >> comma >> golden) << line;
        const double deg_s = is_temporal ? second / cpd : second;
        const double still = spatiovelocity_sensitivity(cpd, 0);
        EXPECT_NEAR(still * factor(cpd, deg_s) / golden, 1, golden_tolerance) << line;
        ++rows;
    }
    EXPECT_EQ(rows, 46);
}

TEST(Motion, FactorIsTheRatioToRestEvenWhereBothUnderflow) {
    for (const double cpd : {0.1, 1.0, 8.0, 30.0}) {
        for (const double deg_s : {0.0, 0.1, 0.5, 3.0, 20.0}) {
            const double moving = spatiovelocity_sensitivity(cpd, deg_s);
            const double still = spatiovelocity_sensitivity(cpd, 0);
            EXPECT_NEAR(factor(cpd, deg_s) / (moving / still), 1, rounding) << cpd << " cpd, " << deg_s << " degrees/s";
        }
    }
    // At 2000 cpd the sensitivity is 1e-370 at rest.
    EXPECT_EQ(spatiovelocity_sensitivity(2000, 0), 0);
    EXPECT_EQ(factor(2000, 0), 1);
    EXPECT_GT(factor(2000, 0.2), 0);
    EXPECT_LT(factor(2000, 0.2), 1);
    EXPECT_EQ(factor(60, 1000), 0);
}

TEST(Motion, FineDetailFadesTheFasterItMoves) {
    for (const double cpd : {8.0, 16.0, 32.0}) {
        double before = infinity;
        for (double deg_s = 1; deg_s < 50; deg_s *= 1.3) {
            EXPECT_LT(factor(cpd, deg_s), before);
            before = factor(cpd, deg_s);
        }
    }
}

TEST(Motion, OutsideOfItsDomainIsNotANumber) {
    for (const double bad : {0.0, -1.0, infinity, not_a_number}) EXPECT_TRUE(std::isnan(factor(bad, 1))) << bad;
    for (const double bad : {-1.0, infinity, not_a_number}) EXPECT_TRUE(std::isnan(factor(4, bad))) << bad;
}

} // namespace unseen::perception::motion_test
