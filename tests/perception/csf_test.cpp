// castleCSF and stelaCSF against the published programs, and at the edges of their domain.
#include <unseen/perception/csf.h>

#include "testing.h"

namespace unseen::perception::csf_test {

// Relative. The golden values have 9 digits; the forms themselves agree to about 1e-8.
constexpr double golden_tolerance = 1e-6;
constexpr std::array models = {CsfModel::castle, CsfModel::stela};

struct GoldenRow {
    Stimulus stimulus;
    double castle, stela;
};

// tests/data/csf_golden.csv: numbers that the published programs of castleCSF and stelaCSF computed.
std::vector<GoldenRow> golden_rows() {
    std::ifstream file("tests/data/csf_golden.csv");
    std::vector<GoldenRow> rows;
    for (std::string line; std::getline(file, line);) {
        if (line.empty() || !std::isdigit(static_cast<unsigned char>(line[0]))) continue;
        std::array<double, 8> v{};
        std::istringstream cells(line);
        for (double& value : v) {
            std::string cell;
            std::getline(cells, cell, ',');
            value = std::stod(cell);
        }
        rows.push_back({{.frequency = CyclesPerDegree(v[0]),
                         .luminance = Luminance(v[2]),
                         .eccentricity = Degrees(v[1]),
                         .temporal = Hertz(v[3]),
                         .area = SquareDegrees(v[4]),
                         .field = v[5] == 0 ? VisualField::temporal : VisualField::nasal},
                        v[6],
                        v[7]});
    }
    return rows;
}

TEST(Csf, AgreesWithThePublishedPrograms) {
    const auto rows = golden_rows();
    ASSERT_EQ(rows.size(), 200u);
    for (const GoldenRow& row : rows) {
        EXPECT_NEAR(sensitivity(CsfModel::castle, row.stimulus) / row.castle, 1, golden_tolerance);
        EXPECT_NEAR(sensitivity(CsfModel::stela, row.stimulus) / row.stela, 1, golden_tolerance);
    }
}

TEST(Csf, WorstFieldIsTheMoreSensitiveOne) {
    for (const CsfModel model : models) {
        for (GoldenRow row : golden_rows()) {
            Stimulus s = row.stimulus;
            s.field = VisualField::nasal;
            const double nasal = sensitivity(model, s);
            s.field = VisualField::temporal;
            const double temporal = sensitivity(model, s);
            s.field = VisualField::worst;
            EXPECT_EQ(sensitivity(model, s), std::max(nasal, temporal));
        }
    }
}

TEST(Csf, FieldsAgreeAtTheFovea) {
    for (const CsfModel model : models) {
        const double nasal = sensitivity(model, {.field = VisualField::nasal});
        EXPECT_EQ(nasal, sensitivity(model, {.field = VisualField::temporal}));
    }
}

TEST(Csf, SurvivesDimLight) {
    // Below 0.0113 cd/m2 the peak of castle's transient channel would lie below 0 Hz.
    EXPECT_NEAR(sensitivity(CsfModel::castle, {.frequency = CyclesPerDegree(1), .luminance = Luminance(0.01)}), 5.56,
                0.005);
    double before = 0;
    for (double luminance = 1e-3; luminance < 1; luminance *= 1.1) {
        const double s =
            sensitivity(CsfModel::castle, {.frequency = CyclesPerDegree(1), .luminance = Luminance(luminance)});
        ASSERT_TRUE(std::isfinite(s)) << luminance;
        EXPECT_GT(s, 0);
        EXPECT_LT(s, 100);
        if (before > 0) EXPECT_NEAR(std::log(s / before), 0, 0.5) << "a jump at " << luminance;
        before = s;
    }
}

TEST(Csf, KeepsItsDigitsInBrightLight) {
    // 1 - (1 + p4/L)^-p5, written like that, has lost 4 of 16 digits here and its slope all of them.
    const auto at = [](double luminance) { return sensitivity(CsfModel::castle, {.luminance = Luminance(luminance)}); };
    EXPECT_GT(at(1e3), at(1e4));
    EXPECT_GT(at(1e4), 0);
    // The fall towards 1/L is smooth: the second difference of log S is small against the first.
    const double step1 = std::log(at(1.0e6) / at(1.1e6)), step2 = std::log(at(1.1e6) / at(1.21e6));
    EXPECT_NEAR(step2 / step1, 1, 0.01);
}

TEST(Csf, FallsWithEccentricityAndAboveThePeak) {
    for (const CsfModel model : models) {
        for (double cpd = 4; cpd < 60; cpd *= 1.3) {
            const auto at = [&](double frequency, double degrees) {
                return sensitivity(model, {.frequency = CyclesPerDegree(frequency), .eccentricity = Degrees(degrees)});
            };
            EXPECT_LT(at(1.3 * cpd, 0), at(cpd, 0));
            EXPECT_LT(at(cpd, 10), at(cpd, 5));
            // Exponentially: equal steps lose equal shares.
            EXPECT_NEAR(at(cpd, 10) / at(cpd, 5), at(cpd, 5) / at(cpd, 0), 1e-12);
        }
    }
}

TEST(Csf, OutsideOfItsDomainIsNotANumber) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    for (const CsfModel model : models) {
        for (const double bad : {0.0, -1.0, infinity, nan}) {
            EXPECT_TRUE(std::isnan(sensitivity(model, {.frequency = CyclesPerDegree(bad)}))) << bad;
            EXPECT_TRUE(std::isnan(sensitivity(model, {.luminance = Luminance(bad)}))) << bad;
            EXPECT_TRUE(std::isnan(sensitivity(model, {.area = SquareDegrees(bad)}))) << bad;
        }
        for (const double bad : {-1.0, infinity, nan}) {
            EXPECT_TRUE(std::isnan(sensitivity(model, {.eccentricity = Degrees(bad)}))) << bad;
            EXPECT_TRUE(std::isnan(sensitivity(model, {.temporal = Hertz(bad)}))) << bad;
        }
    }
}

TEST(Csf, IsFiniteOverTheWholeDomain) {
    for (const CsfModel model : models) {
        for (const double cpd : {1e-6, 0.0625, 1.0, 64.0, 1e3}) {
            for (const double luminance : {1e-6, 1e-3, 0.0113, 1.0, 1e4, 1e8}) {
                for (const double hertz : {0.0, 1e-3, 8.0, 200.0}) {
                    const double s = sensitivity(model, {.frequency = CyclesPerDegree(cpd),
                                                         .luminance = Luminance(luminance),
                                                         .eccentricity = Degrees(120),
                                                         .temporal = Hertz(hertz),
                                                         .area = patch_area(CyclesPerDegree(cpd))});
                    EXPECT_TRUE(std::isfinite(s) && s >= 0) << cpd << " cpd, " << luminance << " cd/m2, " << hertz;
                }
            }
        }
    }
}

TEST(Csf, PatchHasARadiusOfOneAndAHalfCycles) {
    EXPECT_DOUBLE_EQ(patch_area(CyclesPerDegree(1.5)).value(), std::numbers::pi);
    EXPECT_DOUBLE_EQ(patch_area(CyclesPerDegree(3)).value(), std::numbers::pi / 4);
}

TEST(Csf, WiderPatchesAreSeenBetterByTheLawOfArea) {
    const SquareDegrees unlimited(std::numeric_limits<double>::infinity());
    for (const double cpd : {0.25, 0.5, 1.0, 2.0, 8.0, 30.0}) {
        const CyclesPerDegree frequency(cpd);
        EXPECT_NEAR(summation_gain(frequency, patch_area(frequency)), 1, 1e-12);
        EXPECT_EQ(summation_share(frequency, patch_area(frequency) * 0.5), 0);
        EXPECT_NEAR(summation_share(frequency, unlimited), 1, 1e-12);
        double last = 0;
        for (double deg2 = 1e-3; deg2 < 1e5; deg2 *= 3) {
            const SquareDegrees area(deg2);
            const double gain = summation_gain(frequency, area);
            EXPECT_GT(gain, last);
            last = gain;
            // castleCSF's sustained channel, which is nearly all that sees what stands still.
            const auto castle = [&](SquareDegrees patch) {
                return sensitivity(CsfModel::castle, {.frequency = frequency, .area = patch});
            };
            EXPECT_NEAR(gain / (castle(area) / castle(patch_area(frequency))), 1, 0.03) << cpd << " cpd, " << deg2;
            // A person's own law meets castle's where patches are as small as tables have them.
            const double share = summation_share(frequency, area);
            EXPECT_NEAR(summation_gain(frequency, area, 1.7), gain * std::pow(1.7, share), 1e-9 * gain);
        }
        EXPECT_NEAR(summation_gain(frequency, unlimited, 0.6), 0.6 * summation_gain(frequency, unlimited), 1e-12);
    }
    // docs/model.md's numbers.
    EXPECT_NEAR(summation_gain(CyclesPerDegree(0.5), unlimited), 2.16, 0.01);
    EXPECT_NEAR(summation_gain(CyclesPerDegree(4), unlimited), 3.4, 0.05);
    for (const auto& [cpd, deg2, own] :
         {std::array{0.0, 1.0, 1.0}, {1.0, 0.0, 1.0}, {1.0, -1.0, 1.0}, {1.0, 1.0, 0.0}, {1.0, 1.0, std::nan("")}})
        EXPECT_TRUE(std::isnan(summation_gain(CyclesPerDegree(cpd), SquareDegrees(deg2), own)));
}

TEST(Csf, ModelsHaveNames) {
    for (const CsfModel model : models) {
        EXPECT_EQ(*require(csf_model(name(model))), model);
    }
    EXPECT_THAT(error_in(csf_model("castel")),
                testing::AllOf(testing::HasSubstr("castel"), testing::HasSubstr("castle")));
}

} // namespace unseen::perception::csf_test
