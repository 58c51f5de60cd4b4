// Spatiovelocity sensitivity against golden values, and the geometry of motion on the retina.
#include <unseen/perception/motion.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

namespace unseen::perception::motion_test {
namespace {

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
        const DegreesPerSecond velocity(is_temporal ? second / cpd : second);
        EXPECT_NEAR(spatiovelocity_sensitivity(CyclesPerDegree(cpd), velocity) / golden, 1, golden_tolerance) << line;
        ++rows;
    }
    EXPECT_EQ(rows, 46);
}

TEST(Motion, KnowsThreeSetsOfConstants) {
    const auto at = [](double cpd, double deg_s, const Spatiovelocity& c) {
        return spatiovelocity_sensitivity(CyclesPerDegree(cpd), DegreesPerSecond(deg_s), c);
    };
    // By arithmetic with fifty digits.
    EXPECT_NEAR(at(4, 2, kelly_1979) / 9.7111301574547525e+01, 1, rounding);
    EXPECT_NEAR(at(0.5, 30, kelly_1979) / 4.9673801396258654e+01, 1, rounding);
    EXPECT_NEAR(at(4, 2, daly_1998) / 1.2755780615230648e+02, 1, rounding);
    EXPECT_NEAR(at(0.5, 30, daly_1998) / 3.9292116838323828e+01, 1, rounding);
    EXPECT_NEAR(at(4, 2, laird_2006) / 8.6440602465270814e+01, 1, rounding);
    EXPECT_NEAR(at(0.5, 30, laird_2006) / 5.1397243220101359e+01, 1, rounding);
}

TEST(Motion, FactorIsTheRatioToRestEvenWhereBothUnderflow) {
    for (const double cpd : {0.1, 1.0, 8.0, 30.0}) {
        for (const double deg_s : {0.0, 0.1, 0.5, 3.0, 20.0}) {
            const double moving = spatiovelocity_sensitivity(CyclesPerDegree(cpd), DegreesPerSecond(deg_s));
            const double still = spatiovelocity_sensitivity(CyclesPerDegree(cpd), DegreesPerSecond(0));
            EXPECT_NEAR(factor(cpd, deg_s) / (moving / still), 1, rounding) << cpd << " cpd, " << deg_s << " degrees/s";
        }
    }
    // At 2000 cpd the sensitivity is 1e-370 at rest.
    EXPECT_EQ(spatiovelocity_sensitivity(CyclesPerDegree(2000), DegreesPerSecond(0)), 0);
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
    for (const double bad : {0.0, -1.0, infinity, not_a_number}) {
        EXPECT_TRUE(std::isnan(factor(bad, 1))) << bad;
        EXPECT_TRUE(std::isnan(spatiovelocity_sensitivity(CyclesPerDegree(bad), DegreesPerSecond(1)))) << bad;
    }
    for (const double bad : {-1.0, infinity, not_a_number}) {
        EXPECT_TRUE(std::isnan(factor(4, bad))) << bad;
        EXPECT_TRUE(std::isnan(spatiovelocity_sensitivity(CyclesPerDegree(4), DegreesPerSecond(bad)))) << bad;
    }
    EXPECT_TRUE(std::isnan(sight_rotation({0, 0, 0}, {1, 0, 0}).x));
    EXPECT_TRUE(std::isnan(sight_rotation({not_a_number, 0, 1}, {1, 0, 0}).x));
}

TEST(Motion, SightTurnsAsObjectsPassAndHeadsTurn) {
    // 1 m/s across the line of sight at 2 m is half a radian a second; along it, nothing.
    const double half_radian = 0.5 * 180 / std::acos(-1.0);
    const glm::dvec3 across = sight_rotation({0, 0, -2}, {1, 0, 0});
    EXPECT_NEAR(glm::length(across), half_radian, rounding * 100);
    EXPECT_LT(across.y, 0) << "to the right is a turn about -y";
    EXPECT_EQ(glm::length(sight_rotation({0, 0, -2}, {0, 0, 5})), 0);
    // A head that turns along keeps it where it is.
    EXPECT_NEAR(glm::length(sight_rotation({0, 0, -2}, {1, 0, 0}, across)), 0, rounding * 100);
    // Far away or in tiny units, the angle is the same.
    EXPECT_NEAR(glm::length(sight_rotation({0, 0, -2e200}, {1e200, 0, 0})), half_radian, rounding * 100);
}

TEST(Motion, EyesFollowAlmost) {
    EXPECT_EQ(pursuit_velocity(DegreesPerSecond(0)).value(), 0.15);
    EXPECT_DOUBLE_EQ(pursuit_velocity(DegreesPerSecond(10)).value(), 8.35);
    EXPECT_EQ(pursuit_velocity(DegreesPerSecond(1000)).value(), 80);
    EXPECT_DOUBLE_EQ(retinal_velocity_of_target(DegreesPerSecond(10)).value(), 1.65);
    EXPECT_DOUBLE_EQ(retinal_velocity_of_target(DegreesPerSecond(0)).value(), 0.15);
    EXPECT_DOUBLE_EQ(retinal_velocity_of_target(DegreesPerSecond(100)).value(), 20);
    EXPECT_TRUE(std::isnan(retinal_velocity_of_target(DegreesPerSecond(not_a_number)).value()));
}

TEST(Motion, WhatIsFollowedStandsStillAndTheRestMoves) {
    const glm::dvec3 ahead(0, 0, -1);
    const glm::dvec3 target(0, 10, 0), eye = pursuit_rotation(target);
    // The target itself, as by Daly's formula.
    EXPECT_NEAR(retinal_velocity(ahead, target, eye).value(), retinal_velocity_of_target(DegreesPerSecond(10)).value(),
                rounding * 10);
    // What stands in the world beside it moves as fast as the eye, and what goes the other way faster.
    EXPECT_NEAR(retinal_velocity(ahead, glm::dvec3(0), eye).value(), 8.35, rounding * 10);
    EXPECT_NEAR(retinal_velocity(ahead, -target, eye).value(), 18.35, rounding * 100);
    // On the axis of the eye's turn nothing is displaced.
    EXPECT_NEAR(retinal_velocity({0, 5, 0}, glm::dvec3(0), eye).value(), 0, rounding);
    // An eye that follows nothing.
    EXPECT_EQ(pursuit_rotation(glm::dvec3(0)), glm::dvec3(0));
    EXPECT_NEAR(retinal_velocity(ahead, target, glm::dvec3(0)).value(), 10, rounding * 10);
}

} // namespace
} // namespace unseen::perception::motion_test
