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

} // namespace unseen::perception::csf_test
